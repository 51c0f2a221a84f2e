"""Build the wheel, install it into an empty environment, and run it, as `make wheel` does.

Dependencies are taken from this environment, so that nothing is fetched. The wheel must have every
file that the program needs.
"""

import subprocess
import sys
import sysconfig
import tempfile
import venv
from pathlib import Path

_PROJECT = Path(__file__).parents[2]
_COMMANDS = (
    "--version",
    "scenes",
    "compare fig12 --preset fast --duration 0.5",
    "report fig12 --preset fast --duration 0.5",
    "model fig12 --out fig12.xml",
)


def _main() -> None:
    """End with an error where the wheel cannot be built, installed or run."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _run_wheel(folder)
    print("the wheel runs by itself")


def _run_wheel(folder: Path) -> None:
    """Build the wheel into a folder, install it into an environment there, and run COMMANDS."""
    _call(sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(folder), at=_PROJECT)
    (wheel,) = folder.glob("*.whl")
    venv.create(folder / "env", with_pip=True)
    python = folder / "env" / "bin" / "python"
    _call(str(python), "-m", "pip", "install", "--quiet", "--no-deps", "--no-index", str(wheel))
    # Dependencies from here, but not this checkout, which is known by a .pth file alone.
    site = Path(sysconfig.get_paths()["purelib"])
    empty = folder / "empty"
    empty.mkdir()
    environment = {"PATH": "/usr/bin:/bin", "PYTHONPATH": str(site), "HOME": str(empty)}
    for command in _COMMANDS:
        _call(
            str(folder / "env" / "bin" / "robotball"), *command.split(), at=empty, env=environment
        )
    code = "import robotball, validation; print(robotball.__file__, validation.__file__)"
    found = _call(str(python), "-c", code, at=empty, env=environment)
    assert found.count(str(folder / "env")) == 2, found


def _call(*words: str, at: Path | None = None, env: dict[str, str] | None = None) -> str:
    done = subprocess.run(words, cwd=at, env=env, capture_output=True, text=True)
    if done.returncode:
        sys.exit(f"{' '.join(words)} failed:\n{done.stdout}{done.stderr}")
    return done.stdout


if __name__ == "__main__":
    _main()

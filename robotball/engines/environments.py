"""Python environments of engines: make them with uv, and call functions in their processes.

Each engine has its own environment, so that engines do not constrain each other's packages. An
environment is made with the newest Python on this machine that the engine's newest release
supports. If this is our own Python version, the environment contains only the engine and its
requirements. Everything else, including robotball, comes from our environment, which is searched
second. With another Python version our compiled packages cannot be loaded, so the environment
contains all that robotball requires, in the versions that the engine needs, and only robotball
itself is added. An environment is not run if robotball did not make it or if another user may
change it.

A process runs the environment's interpreter and ends when its pipe to us closes. The engine's
output goes to standard error.
"""

import json
import operator
import os
import pickle
import re
import signal
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from functools import partial
from importlib.metadata import Distribution, distribution, distributions
from pathlib import Path
from shutil import which
from subprocess import PIPE
from typing import Any, TypeVar

from robotball.errors import InputError, warn
from robotball.files.replacing import foreign_in, is_own
from robotball.processes import answered, end_when_closed

_T = TypeVar("_T")
_DATA = Path(os.environ.get("XDG_DATA_HOME", ""))
ENVIRONMENTS = (_DATA if _DATA.is_absolute() else Path("~/.local/share")) / "robotball" / "engines"
_PYENV = Path(os.environ.get("PYENV_ROOT") or "~/.pyenv")
with suppress(RuntimeError):  # the user has no home folder
    ENVIRONMENTS, _PYENV = ENVIRONMENTS.expanduser(), _PYENV.expanduser()
_UV = Path(os.environ.get("UV_PYTHON_INSTALL_DIR") or ENVIRONMENTS.parents[1] / "uv" / "python")
_MADE = "made_by_robotball.txt"  # a file with the Python, the versions and newer releases
_OWN_NAME = f"python3.{sys.version_info[1]}"
# Our paths go after the paths of the environment. Our paths are not stored in the environment,
# because checkouts may share it. An installed robotball is beside compiled packages that another
# Python cannot load.
_OURS = [str(Path(__file__).parents[2]), sysconfig.get_path("purelib")]
_BESIDE = _OURS[0].endswith("-packages")
_START = (
    f"import sys; own = sys.version_info[1] == {sys.version_info[1]}; sys.path += {_OURS}[:1 + own]"
    f"; import robotball; own or not {_BESIDE} or sys.path.pop(); from {__name__} import _main"
    "; _main()"
)
_ASKED = "import sys, ensurepip; print('python%d.%d' % sys.version_info[:2])"


def pythons() -> dict[str, Path]:
    """Return the Pythons of this machine that robotball supports, by version, newest first.

    Searches the PATH and the folders of pyenv and uv. For each version it returns the first Python
    that can make environments; for our own version, our interpreter.
    """
    path = _path()
    # PYENV_ROOT may be unset or wrong.
    pyenvs = {_PYENV: None} | {shims.parent: None for shims in path if shims.name == "shims"}
    kept = [bins for pyenv in pyenvs for bins in pyenv.glob("versions/*/bin")]
    folders = [*path, *kept, *_UV.glob("*/bin")]
    interpreters: dict[str, Path] = {}
    for name in (f"python{version}" for version in _supported()):
        there = filter(None, (which(name, path=str(folder)) for folder in folders))
        paths = [sys.executable] if name == _OWN_NAME else there
        right = [Path(python) for python in paths if _name_of(python) == name]
        interpreters |= {name.removeprefix("python"): python for python in right[:1]}
    return interpreters


def _path() -> list[Path]:
    """Return the absolute folders of the PATH: a relative folder could belong to anyone."""
    return [folder for folder in map(Path, os.get_exec_path()) if folder.is_absolute()]


def _supported() -> list[str]:
    bounds = distribution("robotball").metadata["Requires-Python"]
    low, end = sorted(int(minor) for minor in re.findall(r"3\.(\d+)", bounds))
    return [f"3.{minor}" for minor in range(end - 1, low - 1, -1)]


def _name_of(python: str) -> str:
    """Return a Python's name, such as python3.13, or "" if it cannot make environments."""
    command = [python, "-I", "-c", _ASKED]
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()


def python_named(name: str) -> Path:
    """Return the Python with a version or path. Raises InputError if it is not found."""
    known = pythons()
    if (python := which(known.get(name, name))) is None:
        raise InputError(f"no Python {name} found: give a path, or {', '.join(known)}")
    return Path(python)


def _numbers(release: str) -> list[int]:
    return [int(number) for number in re.findall(r"\d+", release)]


def name_of(requirement: str) -> str:
    return re.split(r"[^\w.-]", requirement)[0]


def _normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def _newest(home: Path, version: str, requirement: str) -> str:
    """Return the newest release that has wheels for a Python version, "" if none has."""
    asked = ("pip", "compile", "--no-annotate", "--only-binary", ":all:", "--python-version")
    begins = f"{_normal(name_of(requirement))}=="
    with suppress(InputError):
        pins = _uv(home, "", *asked, version, "-", text=requirement).splitlines()
        return next((pin.removeprefix(begins) for pin in pins if pin.startswith(begins)), "")
    return ""


def newer_releases(python: Path, requirements: Iterable[str]) -> list[str]:
    """Ask the package index for newer releases of required packages and of their parts.

    The name of a part begins with the same word, such as mujoco-core. Returns names with versions.
    """
    words = tuple(name_of(requirement).split("-")[0] for requirement in requirements)
    asked = ("pip", "list", "--outdated", "--format", "json", "--python", str(python))
    answer = json.loads(_uv(python.parents[1], "the package index did not answer", *asked))
    outdated = (package for package in answer if package["name"].startswith(words))
    return [f"{package['name']} {package['latest_version']}" for package in outdated]


def interpreter_of(home: Path, requirements: Iterable[str] = ()) -> Path | None:
    """Return the interpreter of an environment, or None if the environment is not usable.

    The marker file is written last, so an environment without it is incomplete. An environment of
    another Python version is outdated if robotball's requirements have changed. Raises InputError
    if another user may change the environment, if its Python is missing, or if a package is older
    than its requirement.
    """
    if not (_packages(home) / _MADE).exists():
        return None
    _check_own(home, inside=True)
    if python_name(home) != _OWN_NAME:
        held = next((package for package in _held(home) if package.name == "robotball"), None)
        if held is None or _required(held) != _required(distribution("robotball")):
            return None
    python = (home / "bin" / "python").absolute()
    if not os.access(python, os.X_OK):
        raise InputError(f"{python} does not exist any more: {_again(python)}")
    for requirement in requirements:
        release = versions_in(home, [requirement]).partition(" ")[2]
        if release and _numbers(release) < _numbers(requirement.partition(">=")[2]):
            raise InputError(f"{home} has {release}, older than {requirement}: {_again(python)}")
    return python


def _again(python: Path) -> str:
    return f"install again: robotball engines --install {python.parents[1].name}"


def _check_own(home: Path, inside: bool) -> None:
    """Raise InputError if another user may change an environment, or a file in it."""
    foreign = foreign_in(home) if inside else None if is_own(home) else home
    if foreign is not None:
        raise InputError(
            f"{foreign} is not run, because another user owns it or may write to it: give another "
            "folder with --environments"
        )


def versions_in(home: Path, requirements: Iterable[str]) -> str:
    """Return names and versions of the required packages that an environment holds."""
    names = {name_of(requirement) for requirement in requirements}
    held = (package for package in _held(home) if package.name in names)
    return ", ".join(sorted(f"{package.name} {package.version}" for package in held))


def said_of(home: Path) -> list[str]:
    """Return the lines of the marker file: versions and Python, then newer releases."""
    mark = _packages(home) / _MADE
    return mark.read_text(encoding="utf-8").splitlines() if mark.exists() else []


def _held(home: Path) -> list[Distribution]:
    return [*distributions(path=[str(_packages(home))])]


def python_name(home: Path) -> str:
    """Return the name of an environment's Python, such as python3.13."""
    return _packages(home).parent.name


def _required(robotball: Distribution) -> list[str]:
    return [line for line in robotball.requires or () if "extra ==" not in line]


def make(home: Path, requirements: Sequence[str], python: Path | None = None) -> Path:
    """Make an environment with uv, replacing an existing one, and return its folder.

    python: the interpreter; None for the newest one here that the newest release of the first
    requirement supports. Raises InputError if uv is missing or fails, or if the folder holds
    anything but an environment.
    """
    home = home.absolute()
    if home.is_dir() and any(home.iterdir()) and not (home / "pyvenv.cfg").is_file():
        raise InputError(
            f"{home} is not an environment, and its files would be lost: move that folder, or give "
            "another one with --environments"
        )
    home.mkdir(mode=0o700, parents=True, exist_ok=True)
    home.chmod(0o700)
    _check_own(home, inside=False)  # the contents are replaced
    releases = {version: _newest(home, version, requirements[0]) for version in _supported()}
    if python is None:
        # max takes the first of equal releases, which belongs to the newest Python.
        known = pythons()
        python = known[max(known, key=lambda version: _numbers(releases[version]))]
    failure = f"{home.name} cannot be installed"
    _uv(home, failure, "venv", "--clear", "--python", str(python), str(home))
    _install(home, failure, *requirements)
    if python_name(home) != _OWN_NAME:
        _add_ours(home, failure)
    package, _, release = versions_in(home, requirements[:1]).partition(" ")
    newer = {wheel for wheel in releases.values() if _numbers(wheel) > _numbers(release)}
    wheels = ", ".join(f"{wheel or 'none'} for {version}" for version, wheel in releases.items())
    summary = f"{versions_in(home, requirements)} with {python_name(home)}; newest wheels: {wheels}"
    mark = [summary, *(f"{package} {wheel}" for wheel in sorted(newer, key=_numbers))]
    (_packages(home) / _MADE).write_text("\n".join(mark), encoding="utf-8")
    return home


def _install(home: Path, failure: str, *requirements: str) -> None:
    asked = ("pip", "install", "--python", str(home / "bin" / "python"), *requirements)
    # Environments share the files of uv's cache, unless others may change these.
    _uv(home, failure, *asked, "--link-mode", "hardlink")
    if foreign_in(home) is not None:
        _uv(home, failure, *asked, "--link-mode", "copy", "--reinstall")


def _add_ours(home: Path, failure: str) -> None:
    """Install robotball's requirements that the engine did not bring, and robotball's metadata."""
    ours, held = distribution("robotball"), _held(home)
    names = {_normal(package.name) for package in held}
    needed = [line for line in _required(ours) if name_of(line) not in names]
    pinned = (f"{package.name}=={package.version}" for package in held)
    _install(home, failure, *needed, *pinned)
    # robotball reads its own version at run time.
    facts = _packages(home) / f"robotball-{ours.version}.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text(ours.read_text("METADATA") or "", encoding="utf-8")


def _uv(home: Path, failure: str, *arguments: str, text: str = "") -> str:
    """Return uv's output. Raises InputError if uv is missing, or with `failure` and uv's reason."""
    folders = (sysconfig.get_path("scripts"), *map(str, _path()))
    if (uv := which("uv", path=os.pathsep.join(folders))) is None:
        raise InputError("engines are installed with uv, which is not found here: pip install uv")
    done = subprocess.run(
        [uv, *arguments, "--quiet", "--no-python-downloads"],
        cwd=home.parent, umask=0o077, input=text, capture_output=True, text=True,
    )  # fmt: skip
    if done.returncode:
        # uv's hints name options of uv that robotball does not have.
        lines = done.stderr.partition("\nhint:")[0].splitlines()
        raise InputError(f"{failure}: {' '.join(line.strip(' ×│╰─▶') for line in lines)}")
    return done.stdout


def _packages(home: Path) -> Path:
    """Return the folder of an environment's packages, even before it exists."""
    ours = home / "lib" / _OWN_NAME / "site-packages"
    return next(home.glob("lib/python3.*/site-packages"), ours)


def call(python: Path | str, function: Callable[..., _T], *arguments: Any) -> _T:
    """Return the result of a function that is called in a process of another interpreter.

    Warnings and an InputError of the function are repeated here. Raises InputError if the function
    or its arguments cannot be pickled, and if the process fails; the message has the last line that
    the process printed.
    """
    try:
        job = pickle.dumps(partial(function, *arguments))
    except (AttributeError, TypeError, pickle.PicklingError) as error:
        raise InputError(f"{python} can call only functions of a module: {error}") from None
    ours, theirs = os.pipe()
    # Only we hold the pipe's other end, so the process ends when we do.
    with os.fdopen(ours), os.fdopen(theirs, "w"), tempfile.TemporaryFile() as output:
        command = [python, "-P", "-c", _START, str(ours)]
        done = subprocess.run(command, input=job, stdout=PIPE, stderr=output, pass_fds=[ours])
        output.seek(0)
        text = output.read().decode(errors="replace")
        lines = [line for line in text.split("\n") if line.strip()]
        why = lines[-1] if lines else "it ended without a message"
        if why.startswith(("ModuleNotFoundError", "ImportError")):
            why += f"; {_again(Path(python))}"
    if done.returncode or not done.stdout:
        killed = f"ended by {signal.Signals(-done.returncode).name}" if done.returncode < 0 else ""
        raise InputError(f"{python}: {killed or why}")
    answer: tuple[_T, InputError | None, list[str]] = pickle.loads(done.stdout)
    for line in answer[2]:
        warn(line)
    if answer[1] is not None:
        raise answer[1]
    return answer[0]


def _main() -> None:
    """Call the pickled function from standard input, and write its answer to the pipe."""
    end_when_closed(int(sys.argv[1]))
    with os.fdopen(os.dup(1), "wb") as answer:
        os.dup2(2, 1)  # engines print to standard output
        result = answered(operator.call, pickle.load(sys.stdin.buffer))
        if not isinstance(result[1], InputError | None):
            raise result[1]  # the reader may lack this class; it shows the last line printed
        pickle.dump(result, answer)
    os._exit(0)  # some engines crash in their clean-up

"""Environments of engines: made with uv, and the processes in which functions run there.

An engine has an environment of its own, so that none decides on another's packages, by the newest
Python of this machine that its newest release supports. It holds the engine and what that requires.
By a Python like ours, everything else, robotball among it, comes from our environment, which is
searched after it. Another Python cannot use our compiled packages: its environment holds all that
robotball requires, in the versions that the engine asks for, and of ours robotball alone is added.
So MuJoCo of another version is only another environment. One that was not made here, or that
another user may change, is not run.

A process is started by the environment's interpreter, with a pipe whose closing ends it. What the
engine prints goes to standard error.
"""

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
with suppress(RuntimeError):  # of a user without a home
    ENVIRONMENTS, _PYENV = ENVIRONMENTS.expanduser(), _PYENV.expanduser()
_UV = Path(os.environ.get("UV_PYTHON_INSTALL_DIR") or ENVIRONMENTS.parents[1] / "uv" / "python")
_MADE = "made_by_robotball.txt"  # among the packages; it says by which Python, and why
_OWN_NAME = f"python3.{sys.version_info[1]}"
# Ours come after its own. They are those of now, as other checkouts use the environment too. Beside
# a robotball that is installed lie compiled packages, which another Python cannot load.
_OURS = [str(Path(__file__).parents[2]), sysconfig.get_path("purelib")]
_BESIDE = _OURS[0].endswith("-packages")
_START = (
    f"import sys; own = sys.version_info[1] == {sys.version_info[1]}; sys.path += {_OURS}[:1 + own]"
    f"; import robotball; own or not {_BESIDE} or sys.path.pop(); from {__name__} import _main"
    "; _main()"
)
_ASKED = "import sys, ensurepip; print('python%d.%d' % sys.version_info[:2])"


def pythons() -> dict[str, Path]:
    """Return the Pythons of this machine on which robotball runs, by version, the newest first.

    They are looked for on the PATH and where pyenv and uv keep theirs. Of each version it is the
    first that can make environments; of our own version it is ours.
    """
    own = _path()
    # Pyenv may be elsewhere than PYENV_ROOT says, or that may not be set.
    pyenvs = {_PYENV: None} | {each.parent: None for each in own if each.name == "shims"}
    kept = [bins for pyenv in pyenvs for bins in pyenv.glob("versions/*/bin")]
    folders = [*own, *kept, *_UV.glob("*/bin")]
    found: dict[str, Path] = {}
    for name in (f"python{version}" for version in _supported()):
        there = filter(None, (which(name, path=str(each)) for each in folders))
        paths = [sys.executable] if name == _OWN_NAME else there
        right = [Path(each) for each in paths if _name_of(each) == name]
        found |= {name.removeprefix("python"): each for each in right[:1]}
    return found


def _path() -> list[Path]:
    """Return the folders of the PATH; one that is not absolute may be anybody's."""
    return [each for each in map(Path, os.get_exec_path()) if each.is_absolute()]


def _supported() -> list[str]:
    """Return the Python versions that robotball runs on, the newest first."""
    bounds = distribution("robotball").metadata["Requires-Python"]
    low, end = sorted(int(minor) for minor in re.findall(r"3\.(\d+)", bounds))
    return [f"3.{minor}" for minor in range(end - 1, low - 1, -1)]


def _name_of(python: str) -> str:
    """Return the name of a Python, as python3.13; empty for one that makes no environments."""
    command = [python, "-I", "-c", _ASKED]
    return subprocess.run(command, capture_output=True, text=True, check=False).stdout.strip()


def python_named(given: str) -> Path:
    """Return the Python of a version or a path. Raises InputError for none of this machine."""
    known = pythons()
    if (python := which(known.get(given, given))) is None:
        raise InputError(f"there is no Python {given} here: give a path, or {', '.join(known)}")
    return Path(python)


def _numbers(release: str) -> list[int]:
    return [int(each) for each in re.findall(r"\d+", release)]


def name_of(requirement: str) -> str:
    """Return the name of the package that is required."""
    return re.split(r"[^\w.-]", requirement)[0]


def _normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def _newest(home: Path, version: str, requirement: str) -> str:
    """Return the newest release that a Python version can have from wheels alone, "" for none."""
    asked = ("pip", "compile", "--no-annotate", "--only-binary", ":all:", "--python-version")
    begins = f"{_normal(name_of(requirement))}=="
    with suppress(InputError):
        pins = _uv(home, "", *asked, version, "-", text=requirement).splitlines()
        return next((pin.removeprefix(begins) for pin in pins if pin.startswith(begins)), "")
    return ""


def interpreter_of(home: Path) -> Path | None:
    """Return the interpreter of an environment, None where there is none.

    The mark is written last: an environment without it was not made to its end, and is none. Nor
    is one of another Python that holds what another robotball requires.
    Raises InputError for one that is not this user's alone.
    """
    if not (_packages(home) / _MADE).exists():
        return None
    _check_own(home, inside=True)
    if python_name(home) != _OWN_NAME:  # ours could not lend it its packages
        held = next((each for each in _held(home) if each.name == "robotball"), None)
        if held is None or _required(held) != _required(distribution("robotball")):
            return None
    return (home / "bin" / "python").absolute()


def _check_own(home: Path, inside: bool) -> None:
    """Raise InputError where others may change an environment, or what is inside it."""
    foreign = foreign_in(home) if inside else None if is_own(home) else home
    if foreign is not None:
        raise InputError(
            f"{foreign} belongs to another user, or others may write there, so it is not run: give "
            "another folder with --environments"
        )


def versions_in(home: Path, requirements: Iterable[str]) -> str:
    """Return names and versions of the packages required, of those that an environment holds."""
    names = {name_of(each) for each in requirements}
    return ", ".join(
        sorted(f"{each.name} {each.version}" for each in _held(home) if each.name in names)
    )


def said_of(home: Path) -> list[str]:
    """Return by which Python an environment is, and the newer releases that it cannot have."""
    mark = _packages(home) / _MADE
    return mark.read_text(encoding="utf-8").splitlines() if mark.exists() else []


def _held(home: Path) -> list[Distribution]:
    return [*distributions(path=[str(_packages(home))])]


def python_name(home: Path) -> str:
    """Return the name of an environment's Python, as python3.13."""
    return _packages(home).parent.name


def _required(robotball: Distribution) -> list[str]:
    """Return what robotball requires, without its extras."""
    return [each for each in robotball.requires or () if "extra ==" not in each]


def make(home: Path, requirements: Sequence[str], python: Path | None = None) -> Path:
    """Make an environment anew with uv, and return its folder.

    python: which one; None for the newest of this machine that the newest release of the first
    requirement supports.
    Raises InputError if uv is missing or fails, and in place of a folder that holds something else.
    """
    home = home.absolute()
    if home.is_dir() and any(home.iterdir()) and not (home / "pyvenv.cfg").is_file():
        raise InputError(
            f"{home} is no environment, and would be lost: move it, or give another folder with "
            "--environments"
        )
    home.mkdir(mode=0o700, parents=True, exist_ok=True)
    home.chmod(0o700)
    _check_own(home, inside=False)  # what is inside goes
    releases = {each: _newest(home, each, requirements[0]) for each in _supported()}
    if python is None:
        # Of Pythons with the same release the first, which is the newest.
        known = pythons()
        python = known[max(known, key=lambda version: _numbers(releases[version]))]
    failure = f"{home.name} cannot be installed"
    _uv(home, failure, "venv", "--clear", "--python", str(python), str(home))
    _install(home, failure, *requirements)
    if python_name(home) != _OWN_NAME:
        _add_ours(home, failure)
    package, _, release = versions_in(home, requirements[:1]).partition(" ")
    newer = {each for each in releases.values() if _numbers(each) > _numbers(release)}
    wheels = ", ".join(f"{each or 'none'} for {version}" for version, each in releases.items())
    by = f"{versions_in(home, requirements)} by {python_name(home)}; newest wheels: {wheels}"
    mark = [by, *(f"{package} {each}" for each in sorted(newer, key=_numbers))]
    (_packages(home) / _MADE).write_text("\n".join(mark), encoding="utf-8")
    return home


def _install(home: Path, failure: str, *requirements: str) -> None:
    # Copies, as links would lead to uv's cache, where others may be allowed to write.
    asked = ("pip", "install", "--link-mode", "copy", "--python", str(home / "bin" / "python"))
    _uv(home, failure, *asked, *requirements)


def _add_ours(home: Path, failure: str) -> None:
    """Install what robotball requires and the engine has not brought, and say what that is."""
    ours, held = distribution("robotball"), _held(home)
    names = {_normal(each.name) for each in held}
    needed = [each for each in _required(ours) if name_of(each) not in names]
    _install(home, failure, *needed, *(f"{each.name}=={each.version}" for each in held))
    # Code of robotball asks for its version.
    facts = _packages(home) / f"robotball-{ours.version}.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text(ours.read_text("METADATA") or "", encoding="utf-8")


def _uv(home: Path, failure: str, *arguments: str, text: str = "") -> str:
    """Return what uv prints. Raises InputError without uv, and the failure with uv's reason.

    uv runs in the folder of environments, as it reads settings of the current one. What it makes
    is for this user alone.
    """
    folders = (sysconfig.get_path("scripts"), *map(str, _path()))
    if (uv := which("uv", path=os.pathsep.join(folders))) is None:
        raise InputError("engines are installed with uv, which is not found here: pip install uv")
    done = subprocess.run(
        [uv, *arguments, "--quiet", "--no-python-downloads"],
        cwd=home.parent, umask=0o077, input=text, capture_output=True, text=True,
    )  # fmt: skip
    if done.returncode:
        # Hints are of options that we do not offer.
        lines = done.stderr.partition("\nhint:")[0].splitlines()
        raise InputError(f"{failure}: {' '.join(line.strip(' ×│╰─▶') for line in lines)}")
    return done.stdout


def _packages(home: Path) -> Path:
    """Return the folder of an environment's packages; of one that is not made, where ours are."""
    ours = home / "lib" / _OWN_NAME / "site-packages"
    return next(home.glob("lib/python3.*/site-packages"), ours)


def _last_word(said: str) -> str:
    words = [line for line in said.split("\n") if line.strip()]
    return words[-1] if words else "it ended without a word"


def call(python: Path | str, function: Callable[..., _T], *given: Any) -> _T:
    """Return what a function gives in a process of another interpreter.

    Its warnings are issued here, and its InputError is raised. Raises InputError too where function
    or arguments cannot be pickled, and where the process ends otherwise, with its last word.
    """
    try:
        job = pickle.dumps(partial(function, *given))
    except (AttributeError, TypeError, pickle.PicklingError) as error:
        raise InputError(f"{python} takes what stands in a module alone: {error}") from None
    ours, theirs = os.pipe()
    # The pipe's other end is ours alone: the run ends where we do.
    with os.fdopen(ours), os.fdopen(theirs, "w"), tempfile.TemporaryFile() as said:
        command = [python, "-P", "-c", _START, str(ours)]
        done = subprocess.run(command, input=job, stdout=PIPE, stderr=said, pass_fds=[ours])
        said.seek(0)
        why = _last_word(said.read().decode(errors="replace"))
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
    """Read a function with its arguments, write what it gives, and end when the reader does."""
    end_when_closed(int(sys.argv[1]))
    with os.fdopen(os.dup(1), "wb") as answer:
        os.dup2(2, 1)  # what engines print
        found = answered(operator.call, pickle.load(sys.stdin.buffer))
        if not isinstance(found[1], InputError | None):
            raise found[1]  # of a kind that may be unknown to the reader, who has its last word
        pickle.dump(found, answer)
    os._exit(0)  # some engines end badly

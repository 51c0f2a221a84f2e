"""Environments of engines: made by venv and pip, and the processes in which functions run there.

An engine has an environment of its own, so that none decides on another's packages. It holds the
engine and what that requires; everything else, robotball among it, comes from our environment,
which is searched after it. So MuJoCo of another version is only another environment. One that was
not made here, or that another user may change, is not run.

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
import venv
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from functools import partial
from importlib.metadata import distributions
from pathlib import Path
from subprocess import PIPE
from typing import Any, TypeVar

import robotball
from robotball.errors import InputError, warn
from robotball.files.replacing import is_own
from robotball.processes import answered, end_when_closed

_T = TypeVar("_T")
_DATA = Path(os.environ.get("XDG_DATA_HOME", ""))
ENVIRONMENTS = (_DATA if _DATA.is_absolute() else Path("~/.local/share")) / "robotball" / "engines"
with suppress(RuntimeError):  # of a user without a home
    ENVIRONMENTS = ENVIRONMENTS.expanduser()
_MADE = "made_by_robotball.txt"  # among the packages: those of another Python are none
# Ours come after its own. They are those of now, as other checkouts use the environment too.
_OURS = [str(Path(robotball.__file__).parents[1]), sysconfig.get_path("purelib")]
_START = f"import sys; sys.path += {_OURS}; from {__name__} import _main; _main()"


def interpreter_of(home: Path) -> Path | None:
    """Return the interpreter of an environment, None where there is none.

    The mark is written last: an environment without it was not made to its end, and is none.
    Raises InputError for one that is not this user's alone.
    """
    if not (_packages(home) / _MADE).exists():
        return None
    _check_own(home)
    return (home / "bin" / "python").absolute()


def _check_own(home: Path) -> None:
    if not is_own(home):
        raise InputError(
            f"{home} belongs to another user, or others may write there, so it is not run: give "
            "another folder with --environments"
        )


def versions_in(home: Path, requirements: Iterable[str]) -> str:
    """Return names and versions of the packages required, of those that an environment holds."""
    names = {re.split(r"[^\w.-]", each)[0] for each in requirements}
    there = distributions(path=[str(_packages(home))])
    return ", ".join(sorted(f"{each.name} {each.version}" for each in there if each.name in names))


def make(home: Path, requirements: Sequence[str]) -> Path:
    """Make an environment anew by venv and pip, and return its folder.

    Raises InputError where pip fails, and in place of a folder that holds something else.
    """
    if home.is_dir() and any(home.iterdir()) and not (home / "pyvenv.cfg").is_file():
        raise InputError(
            f"{home} is no environment, and would be lost: move it, or give another folder with "
            "--environments"
        )
    home.mkdir(mode=0o700, parents=True, exist_ok=True)
    home.chmod(0o700)
    _check_own(home)
    venv.create(home, clear=True, with_pip=True)
    failure = f"{home.name} cannot be installed"
    pip(home / "bin" / "python", failure, "install", "--quiet", *requirements)
    (_packages(home) / _MADE).touch()
    return home


def pip(python: Path, failure: str, *arguments: str) -> str:
    """Return what an environment's pip prints. Raises InputError, the failure and pip's reason."""
    command = [str(python), "-P", "-m", "pip", "--disable-pip-version-check", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise InputError(f"{failure}: {_last_word(done.stderr)}")
    return done.stdout


def _packages(home: Path) -> Path:
    """Return the folder of an environment's packages."""
    base = {"base": str(home), "platbase": str(home)}
    return Path(sysconfig.get_path("purelib", vars=base))


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

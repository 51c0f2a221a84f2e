"""Environments of engines: made by venv and pip, and the processes in which functions run there.

An engine has an environment of its own, so that none decides on another's packages. It holds the
engine and what that requires; everything else, robotball among it, comes from our environment,
which is searched after it. So MuJoCo of another version is only another environment.

A process is started by the environment's interpreter, with a pipe whose closing ends it. What the
engine prints goes to standard error.
"""

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
from importlib.metadata import distributions
from pathlib import Path
from subprocess import PIPE
from typing import Any

import robotball
from robotball.errors import InputError, warn
from robotball.processes import answered, end_when_closed

_LINK = "zz_robotball.pth"


def interpreter_of(home: Path) -> Path | None:
    """Return the interpreter of an environment, None where there is none.

    The link is written last: an environment without it was not made to its end, and is none.
    """
    return (home / "bin" / "python").absolute() if (_packages(home) / _LINK).exists() else None


def versions_in(home: Path, requirements: Iterable[str]) -> dict[str, str]:
    """Return the versions of the packages required, by name, of those that an environment holds."""
    there = {each.name: each.version for each in distributions(path=[str(_packages(home))])}
    names = (re.split(r"[^\w.-]", each)[0] for each in requirements)
    return {name: there[name] for name in names if name in there}


def make(home: Path, requirements: Sequence[str]) -> Path:
    """Make an environment anew by venv and pip, and return its folder.

    Raises InputError where pip fails, and in place of a folder that holds something else.
    """
    if home.is_dir() and any(home.iterdir()) and not (home / "pyvenv.cfg").is_file():
        raise InputError(
            f"{home} is no environment, and would be lost: move it, or give another folder with "
            "--environments"
        )
    venv.create(home, clear=True, with_pip=True)
    python = home / "bin" / "python"
    command = [str(python), "-m", "pip", "install", "--quiet", *requirements]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        raise InputError(f"{home.name} cannot be installed: {_last_word(done.stderr)}")
    # Our packages come after its own.
    ours: Sequence[str] = (str(Path(robotball.__file__).parents[1]), sysconfig.get_path("purelib"))
    (_packages(home) / _LINK).write_text("\n".join(ours) + "\n")
    return home


def _packages(home: Path) -> Path:
    """Return the folder of an environment's packages."""
    base = {"base": str(home), "platbase": str(home)}
    return Path(sysconfig.get_path("purelib", vars=base))


def _last_word(said: str) -> str:
    words = [line for line in said.split("\n") if line.strip()]
    return words[-1] if words else "it ended without a word"


def call(python: Path | str, function: Callable[..., Any], *given: Any) -> Any:
    """Return what a function gives in a process of another interpreter.

    Function and arguments are pickled. Its warnings are issued here, and its InputError is raised;
    raises RuntimeError, with its last word, where the process ends otherwise.
    """
    ours, theirs = os.pipe()
    command = [str(python), "-m", __name__, str(ours)]
    with tempfile.TemporaryFile() as said:
        try:
            # The pipe's other end is ours alone: the run ends where we do.
            running = subprocess.Popen(
                command, stdin=PIPE, stdout=PIPE, stderr=said, pass_fds=(ours,)
            )
            answer, _ = running.communicate(pickle.dumps((function, given)))
        finally:
            os.close(ours)
            os.close(theirs)
        said.seek(0)
        spoken = said.read().decode(errors="replace")
    if running.returncode < 0:
        raise RuntimeError(f"its process was ended by {signal.Signals(-running.returncode).name}")
    if not answer:
        raise RuntimeError(_last_word(spoken))
    result, error, lines = pickle.loads(answer)
    for line in lines:
        warn(line)
    if error is not None:
        raise error
    return result


def _apply(job: tuple[Callable[..., Any], Sequence[Any]]) -> Any:
    function, given = job
    return function(*given)


def _main() -> None:
    """Read a function with its arguments, write what it gives, and end when the reader does."""
    answer = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what engines print
    end_when_closed(int(sys.argv[1]))
    result, error, lines = answered(_apply, pickle.load(sys.stdin.buffer))
    if not (error is None or isinstance(error, InputError)):
        raise error  # of a kind that may be unknown to the reader: its last word is read
    pickle.dump((result, error, lines), answer)
    answer.flush()
    os._exit(0)  # some engines end badly


if __name__ == "__main__":
    _main()

"""Call functions that users wrote: controllers, drives, engines of packages, files that are run."""

import sysconfig
import traceback
from collections.abc import Callable
from typing import Any, TypeVar

from robotball.errors import InputError

_T = TypeVar("_T")


def call_users(what: str, function: Callable[..., _T], *given: Any, at: float | None = None) -> _T:
    """Call a function that a user wrote, or code of theirs, at a time [s] of the run.

    Whatever it raises becomes an InputError with the user's file and line. That includes SystemExit
    and other exceptions that are no `Exception`, which would end the program without a word.
    KeyboardInterrupt passes, as Ctrl-C and other signals end the program with it.
    """
    try:
        return function(*given)
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        when = "" if at is None else f" at t = {at:g} s"
        why = f"{type(error).__name__}: {error}".rstrip(": ")
        raise InputError(f"{what}{when}{_line_of(error)}: {why}") from error


def _line_of(error: BaseException) -> str:
    """Return ", in FILE line N" for an error raised in a user's file, else ""."""
    frames = traceback.extract_tb(error.__traceback__)[1:]
    # A file that is run, and an object that is copied, has Python's own frames around it.
    pythons = ("<frozen", sysconfig.get_path("stdlib"))
    users = [
        frame
        for frame in frames
        # A backport that other packages import loads entry points in place of Python's own module.
        if not frame.filename.startswith(pythons) and "/importlib_metadata/" not in frame.filename
    ]
    own = [each for each in users if each.filename == users[0].filename]
    return f", in {own[-1].filename} line {own[-1].lineno}" if own else ""

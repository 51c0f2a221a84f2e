"""The one exception that a user's input can raise, the one warning, and checks that raise it.

And MuJoCo's own warnings, which several rooms keep from being printed.
"""

import difflib
import math
import sys
import sysconfig
import threading
import traceback
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from numbers import Real
from typing import Any, TypeVar

# In SI units, far beyond any ball, and small enough that products of a few do not overflow.
LARGEST = 1e50
_MOST_COUNTED = 10_000_000  # of anything that is counted: more fill the memory
END_ROUNDING = 1e-9  # relative: a time so little beyond the end of a run is taken as the end
_LONGEST_WORD, LONGEST_LINE = 200, 500  # characters of a message
_FEW = 12  # names that a message lists, so that it stays a line
_PACKAGES = ("robotball", "validation")
_WARNED_BY: list[Any] = []  # MuJoCo's function for warnings before each block that is silent
_SILENCING = threading.Lock()
_T = TypeVar("_T")


class InputError(ValueError):
    """Refuse input that cannot be used.

    The message is one line with the value, its limit and what to do.

    Parameters
    ----------
    message : str
        The line. Line breaks become blanks, and long words lose their middle.

    Examples
    --------
    >>> import robotball as rb
    >>> rb.preset("fats")
    Traceback (most recent call last):
        ...
    robotball.errors.InputError: no preset is called 'fats'; did you mean fast?
    """

    def __init__(self, message: str) -> None:
        # A quoted key or a file's name may hold a line break of its own, and be of any length.
        words = (_shortened(word, _LONGEST_WORD) for word in message.split())
        super().__init__(_shortened(" ".join(words), LONGEST_LINE))


def _shortened(text: str, most: int) -> str:
    """Return a text without its middle, where it is longer than `most` characters."""
    half = (most - 1) // 2
    return text if len(text) <= most else f"{text[:half]}…{text[-half:]}"


class SceneWarning(UserWarning):
    """Warn of a scene that runs, though perhaps not as its author means it.

    The message is one line.

    Examples
    --------
    >>> import warnings
    >>> import robotball as rb
    >>> rate = rb.Sine(mean=2.0, amplitude=0.05, frequency=200.0)
    >>> scene = rb.load_scene("fig12").with_hinges(command={"frame": rate})
    >>> with warnings.catch_warnings(record=True) as caught:
    ...     warnings.simplefilter("always")
    ...     motion = rb.simulate(scene, 0.1, settings="fast")
    >>> print(caught[0].category.__name__)
    SceneWarning
    """


class UnitWarning(InputError, SceneWarning):  # noqa: N818
    """Ask whether a number of a user's file is in another unit than it takes.

    It is a warning of the library, and the command raises it, unless one insists by `--as-given`.
    """


def warn(line: str, kind: type[SceneWarning] = SceneWarning) -> None:
    """Issue a warning at the line outside these packages that asked for the work."""
    # Python's default filter shows a warning once a line: at a line of ours, a script of many
    # scenes would see the first alone. `skip_file_prefixes` is not in Python 3.11.
    frame, level = sys._getframe(1), 2  # 1 is this function
    while frame.f_back and frame.f_globals.get("__name__", "").split(".")[0] in _PACKAGES:
        frame, level = frame.f_back, level + 1
    warnings.warn(line, kind, stacklevel=level)


def unknown(kind: str, name: object, known: Iterable[str]) -> InputError:
    """Return the error for an unknown name, with near matches or else the known names."""
    # Hyphens do not make options near to one another.
    words = {each.lstrip("-"): each for each in known}
    near = [words[each] for each in difflib.get_close_matches(str(name).lstrip("-"), words)]
    some = f"{len(words)}, as " if len(words) > _FEW else ""
    all_ = f"there are {some}{', '.join([*words.values()][:_FEW])}"
    hint = f"did you mean {' or '.join(near)}?" if near else all_
    return InputError(f"no {kind} is called {str(name)!r}; {hint}")


def too_many_steps(taken: int, reached: float, end: float, speed: float) -> InputError:
    """Return the error for a run that took its steps at `reached` s of `end`, at `speed` rad/s."""
    needed = f"some {taken * end / reached:.2g}" if reached > 0 else "endlessly many"
    return InputError(
        f"{taken} steps reach t = {reached:.4g} s of {end:g}: the ball turns at {speed:.3g} rad/s, "
        f"and the whole needs {needed} steps; shorten the motion or raise max_steps"
    )


def _check_number(what: str, value: object) -> None:
    # Python's numbers and NumPy's are; an array of one number is not.
    if not isinstance(value, Real):
        raise InputError(f"{what} must be a number, not {value!r}")
    try:
        float(value)
    except OverflowError:  # of a whole number with hundreds of digits
        raise InputError(f"{what} must be at most {LARGEST:g} in size") from None


def check_positive(what: str, value: float, unit: str = "") -> float:
    """Return `value`. Raises InputError unless it is positive and finite, not tiny or huge."""
    _check_number(what, value)
    if not (math.isfinite(value) and value > 0):
        raise InputError(f"{what} must be positive and finite, not {value:g} {unit}".rstrip())
    if not 1 / LARGEST <= value <= LARGEST:
        raise InputError(
            f"{what} must lie between {1 / LARGEST:g} and {LARGEST:g} {unit}, not at {value:g}"
        )
    return value


def check_not_negative(what: str, value: float, unit: str) -> None:
    """Raise InputError unless `value` is zero or passes `check_positive`."""
    if value != 0:
        check_positive(f"{what}, where it is not 0,", value, unit)


def check_size(what: str, value: float, unit: str = "", largest: float = LARGEST) -> None:
    """Raise InputError unless `value` is finite and at most `largest` in size."""
    _check_number(what, value)
    # Not `abs(value) > largest`, which would let NaN pass.
    if not abs(value) <= largest:
        line = f"{what} must be finite and at most {largest:g} in size, not {value:g} {unit}"
        raise InputError(line.rstrip())


def check_count(name: str, value: int, least: int, most: int = _MOST_COUNTED) -> int:
    """Return `value`. Raises InputError where it is below `least` or above `most`."""
    _check_number(name, value)
    if not least <= value <= most:
        bound = f"least {least}" if value < least else f"most {most}"
        raise InputError(f"{name} must be at {bound}, not {value}")
    return value


def check_seed(seed: int) -> int:
    """Return `seed`. Raises InputError where it can start no random numbers."""
    return check_count("seed", seed, 0, 2**63 - 1)


@contextmanager
def mujoco_silent() -> Iterator[None]:
    """Keep MuJoCo from printing its warnings in the block.

    It would write them to the terminal and to a file in the current folder. Its own counters, which
    the monitor reads, have them all the same. Blocks of several threads may overlap.
    """
    import mujoco  # which the equations do without

    with _SILENCING:
        _WARNED_BY.append(mujoco.get_mju_user_warning())
        mujoco.set_mju_user_warning(lambda _: None)
    try:
        yield
    finally:
        # The last block to end, whichever it is, finds what the first one found.
        with _SILENCING:
            mujoco.set_mju_user_warning(_WARNED_BY.pop())


def counted(count: int, noun: str) -> str:
    """Return a number and its noun, such as `1 rotor` or `2 rotors`."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


@contextmanager
def named(what: object) -> Iterator[None]:
    """Put the name of a file or of a part of it before the message of an InputError."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{what}: {error}") from None


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

"""InputError, SceneWarning and the argument checks that raise InputError.

`mujoco_silent` keeps MuJoCo from printing its warnings.
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

LARGEST = 1e50  # SI units: far beyond any ball, and products of a few such values do not overflow
_MAX_COUNT = 10_000_000  # of any counted thing; more would fill the memory
END_ROUNDING = 1e-9  # relative: a time beyond the end of a run by less counts as the end
_LONGEST_WORD, _LONGEST_LINE = 200, 500  # characters of a message
_MAX_LISTED = 12  # names that a message lists before it says how many there are
_PACKAGES = ("robotball", "validation")
_SAVED_HANDLERS: list[Any] = []  # MuJoCo's warning handler before each active `mujoco_silent`
_HANDLER_LOCK = threading.Lock()
_T = TypeVar("_T")


class InputError(ValueError):
    """Report invalid input in one line: the value, its limit and the remedy.

    Parameters
    ----------
    message : str
        The message. Line breaks become spaces; a long word or line is cut in the middle.

    Examples
    --------
    >>> import robotball as rb
    >>> rb.preset("fats")
    Traceback (most recent call last):
        ...
    robotball.errors.InputError: no preset is called 'fats'; did you mean fast?
    """

    def __init__(self, message: str) -> None:
        # A quoted key or file name may contain line breaks and have any length.
        words = (_shortened(word, _LONGEST_WORD) for word in message.split())
        super().__init__(_shortened(" ".join(words), _LONGEST_LINE))


class EarlyEndError(InputError):
    """Report that a motion ends early because the ball lifts off or a joint reaches its stop."""


def _shortened(text: str, most: int) -> str:
    half = (most - 1) // 2
    return text if len(text) <= most else f"{text[:half]}…{text[-half:]}"


class SceneWarning(UserWarning):
    """Warn that a scene can be simulated, but may differ from its author's intention.

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
    """Warn that a number in a user's file appears to be in the wrong unit.

    The library only warns. The commands stop with this error unless `--as-given` is passed.
    """


def warn(line: str, kind: type[SceneWarning] = SceneWarning) -> None:
    """Issue a warning, attributed to the first caller outside these packages."""
    # Python shows a warning once per source line. If it were attributed to a line of robotball, a
    # script that runs many scenes would see only the first. `skip_file_prefixes` needs Python 3.12.
    frame, level = sys._getframe(1), 2
    while frame.f_back and frame.f_globals.get("__name__", "").split(".")[0] in _PACKAGES:
        frame, level = frame.f_back, level + 1
    warnings.warn(line, kind, stacklevel=level)


def unknown(kind: str, name: object, known: Iterable[str]) -> InputError:
    """Return the error for an unknown name. It lists near matches, or else the known names."""
    # Strip the hyphens: all options start with them, so every option would be a near match.
    names = {name.lstrip("-"): name for name in known}
    matches = difflib.get_close_matches(str(name).lstrip("-"), names)
    count = f"{len(names)}, such as " if len(names) > _MAX_LISTED else ""
    listed = f"there are {count}{', '.join([*names.values()][:_MAX_LISTED])}"
    nearest = f"did you mean {' or '.join(names[match] for match in matches)}?"
    hint = nearest if matches else listed
    return InputError(f"no {kind} is called {str(name)!r}; {hint}")


def too_many_steps(taken: int, reached: float, end: float, speed: float) -> InputError:
    """Return the error for a run to `end` [s] that used all its steps before that time.

    taken: the number of steps; reached: the time reached [s]; speed: the ball's angular speed at
    that time [rad/s].
    """
    needed = f"about {taken * end / reached:.2g}" if reached > 0 else "infinitely many"
    return InputError(
        f"{taken} steps reach only t = {reached:.4g} s of {end:g} s, because the ball turns at "
        f"{speed:.3g} rad/s. The whole run needs {needed} steps: shorten it or raise max_steps"
    )


def _check_number(name: str, value: object) -> None:
    # `Real` covers Python's and NumPy's numbers, but not an array with one element.
    if not isinstance(value, Real):
        raise InputError(f"{name} must be a number, not {value!r}")
    try:
        float(value)
    except OverflowError:  # an integer with hundreds of digits
        raise InputError(f"{name} must be at most {LARGEST:g} in size") from None


def check_positive(name: str, value: float, unit: str = "") -> float:
    """Return `value`. Raises InputError unless it is in 1e-50 … 1e50 (`LARGEST`)."""
    _check_number(name, value)
    if not (math.isfinite(value) and value > 0):
        raise InputError(f"{name} must be positive and finite, not {value:g} {unit}".rstrip())
    if not 1 / LARGEST <= value <= LARGEST:
        raise InputError(
            f"{name} must lie between {1 / LARGEST:g} and {LARGEST:g} {unit}, not {value:g}"
        )
    return value


def check_not_negative(name: str, value: float, unit: str) -> None:
    """Raise InputError unless `value` is zero or passes `check_positive`."""
    if value != 0:
        check_positive(f"{name}, if not 0,", value, unit)


def check_size(name: str, value: float, unit: str = "", largest: float = LARGEST) -> None:
    """Raise InputError unless `value` is finite and its absolute value is at most `largest`."""
    _check_number(name, value)
    # `abs(value) > largest` would accept NaN.
    if not abs(value) <= largest:
        line = f"{name} must be finite and at most {largest:g} in size, not {value:g} {unit}"
        raise InputError(line.rstrip())


def check_count(name: str, value: int, least: int, most: int = _MAX_COUNT) -> int:
    """Return `value`. Raises InputError unless `least` <= `value` <= `most`."""
    _check_number(name, value)
    if not least <= value <= most:
        bound = f"least {least}" if value < least else f"most {most}"
        raise InputError(f"{name} must be at {bound}, not {value}")
    return value


def check_seed(seed: int) -> int:
    """Return `seed`. Raises InputError unless it is a valid seed for random numbers."""
    return check_count("seed", seed, 0, 2**63 - 1)


@contextmanager
def mujoco_silent() -> Iterator[None]:
    """Suppress MuJoCo's printed warnings in the block.

    MuJoCo would write them to the terminal and to a file in the current folder. The monitor reads
    MuJoCo's warning counters, which still count. Blocks in several threads may overlap.
    """
    import mujoco  # late: the equations can be integrated without MuJoCo

    with _HANDLER_LOCK:
        _SAVED_HANDLERS.append(mujoco.get_mju_user_warning())
        mujoco.set_mju_user_warning(lambda _: None)
    try:
        yield
    finally:
        # Blocks may end in any order: the last one to end restores the original handler.
        with _HANDLER_LOCK:
            mujoco.set_mju_user_warning(_SAVED_HANDLERS.pop())


def counted(count: int, noun: str) -> str:
    """Return a count with its noun: "1 rotor", "2 rotors"."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def percent(part: float) -> str:
    """Return a fraction as a percentage with two digits."""
    return f"{float(f'{100 * part:.2g}'):g} %"


@contextmanager
def named(name: object) -> Iterator[None]:
    """Prefix the message of any InputError in the block with a name, such as a file's."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{name}: {error}") from None


def call_users(name: str, function: Callable[..., _T], *args: Any, at: float | None = None) -> _T:
    """Call a function written by the user. at: time in the run [s], for the error message.

    Any exception becomes an InputError with the user's file and line, even SystemExit, which would
    end the program silently. KeyboardInterrupt is passed on, so that Ctrl-C ends the program.
    """
    try:
        return function(*args)
    except KeyboardInterrupt:
        raise
    except BaseException as error:
        when = "" if at is None else f" at t = {at:g} s"
        why = f"{type(error).__name__}: {error}".rstrip(": ")
        raise InputError(f"{name}{when}{_line_of(error)}: {why}") from error


def _line_of(error: BaseException) -> str:
    """Return ", in FILE line N" for an error raised in the user's file, else ""."""
    frames = traceback.extract_tb(error.__traceback__)[1:]
    # Running a file or copying an object adds stack frames of the standard library around those of
    # the user's code.
    standard_library = ("<frozen", sysconfig.get_path("stdlib"))
    users = [
        frame
        for frame in frames
        if not frame.filename.startswith(standard_library)
        and "/importlib_metadata/" not in frame.filename  # a backport of the standard library's
    ]
    in_file = [frame for frame in users if frame.filename == users[0].filename]
    return f", in {in_file[-1].filename} line {in_file[-1].lineno}" if in_file else ""

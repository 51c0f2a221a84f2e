"""How a hinge turns: its rate over time, with the derivative and the integral of it.

A drive is smooth between its breakpoints and continuous at them; both engines stop there.
Times are scalars or increasing columns, in s from the start of the motion; SI units.
"""

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

from robotball.custom import ROUNDING, Custom, Followed, Time
from robotball.errors import InputError, check_size
from robotball.rates import Ramp, Samples, Sine


@runtime_checkable
class Drive(Protocol):
    """What a hinge's rate must tell; an object of your own that tells it is a rate of a scene."""

    @property
    def breakpoints(self) -> tuple[float, ...]:
        """Times at which the rate is not smooth."""
        ...

    def rate(self, t: Time) -> Any:
        """The rate [rad/s]."""
        ...

    def acceleration(self, t: Time) -> Any:
        """Its derivative [rad/s²]; at a breakpoint, from there on."""
        ...

    def angle(self, t: Time) -> Any:
        """Its integral from 0 [rad]."""
        ...


@dataclass(frozen=True)
class Constant:
    """A rate that does not change [rad/s]."""

    value: float
    breakpoints: tuple[float, ...] = ()

    def rate(self, t: Time) -> Any:
        return self.value + 0.0 * t

    def acceleration(self, t: Time) -> Any:
        return 0.0 * t

    def angle(self, t: Time) -> Any:
        return self.value * t


@dataclass(frozen=True)
class Sum:
    """A rate that is the sum of others: numbers, Ramps, Sines, Samples, functions of time."""

    parts: tuple["Rate", ...]

    def __post_init__(self) -> None:
        parts = (part.parts if isinstance(part, Sum) else (part,) for part in self.parts)
        object.__setattr__(self, "parts", tuple(itertools.chain.from_iterable(parts)))
        if not self.parts:
            raise InputError("a sum needs at least one rate")


@dataclass(frozen=True)
class Total:
    """The drive of a Sum."""

    drives: tuple[Drive, ...]

    @property
    def breakpoints(self) -> tuple[float, ...]:
        return tuple(sorted({t for drive in self.drives for t in drive.breakpoints}))

    def rate(self, t: Time) -> Any:
        return sum(drive.rate(t) for drive in self.drives)

    def acceleration(self, t: Time) -> Any:
        return sum(drive.acceleration(t) for drive in self.drives)

    def angle(self, t: Time) -> Any:
        return sum(drive.angle(t) for drive in self.drives)


Rate = float | Ramp | Sine | Samples | Sum | Custom | Drive | Callable[[float], float]


def as_drive(rate: Rate, end: float) -> Drive:
    """The drive of a rate in a run from 0 to `end` [s].

    rate: a number [rad/s], a Ramp, a Sine, Samples, a Sum, a function of time, a Custom, or an
    object of one's own with a Drive's members. Raises InputError where it is none of these, not
    finite at the start, or samples that do not reach over the run.
    """
    drive: Drive
    if isinstance(rate, Samples):
        _check_covers(rate, end)
        drive = rate
    elif isinstance(rate, Sum):
        drives = tuple(as_drive(part, end) for part in rate.parts)
        steady = [each.value for each in drives if isinstance(each, Constant)]
        drive = Constant(sum(steady)) if len(steady) == len(drives) else Total(drives)
    elif isinstance(rate, Constant | Ramp | Sine | Total):
        drive = rate
    elif isinstance(rate, Custom):
        drive = Followed(rate, end)
    elif isinstance(rate, Drive):
        own = Custom(rate.rate, tuple(rate.breakpoints), rate.acceleration, rate.angle)
        drive = Followed(own, end)
    elif callable(rate):
        drive = Followed(Custom(rate), end)
    else:
        drive = Constant(_number(rate))
    check_size("a drive's rate at t = 0 s", float(drive.rate(0.0)), "rad/s")
    return drive


def _check_covers(samples: Samples, end: float) -> None:
    first, last = samples.times[0], samples.times[-1]
    if not (first <= 0 and last >= end * (1 - ROUNDING)):
        raise InputError(
            f"samples from t = {first:g} to {last:g} s do not reach over the run, from 0 to "
            f"{end:g} s; give more of them, or shorten the run"
        )


def _number(rate: Any) -> float:
    try:
        return float(rate)
    except (TypeError, ValueError):
        raise InputError(
            f"a rate is a number, a function of time, or a drive with breakpoints, rate, "
            f"acceleration and angle, not {rate!r}"
        ) from None


def turns(drive: Drive) -> bool:
    """Whether the hinge turns at all; a body whose rate is zero for good is fixed, motorless."""
    return drive != Constant(0.0)


def functions_of(drive: Drive) -> Iterator[Followed]:
    """What of a drive follows a function that is asked only when it is needed."""
    if isinstance(drive, Followed):
        yield drive
    if isinstance(drive, Total):
        for each in drive.drives:
            yield from functions_of(each)

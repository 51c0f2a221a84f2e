"""How a hinge turns: its rate over time, with the derivative and the integral of it.

A drive is smooth between its breakpoints and continuous at them; both engines stop there.
Times are scalars or increasing columns, in s from the start of the motion; SI units.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal, Protocol, runtime_checkable

import msgspec
import numpy as np

from robotball.errors import LARGEST, InputError, check_positive, check_size, warn
from robotball.polynomials import Polynomials, polynomials_of

Time = Any  # a float, or a column (n,)

LONGEST = 1e5  # s, that a function is followed: half a minute for a cheap one
ROUNDING = 1e-9  # relative: as far beyond the end a time is the end
FOLLOWED = 1e-12  # of the largest rate: a polynomial as near as that costs no accuracy
GIVEN = 1e-6  # relative: a derivative or integral that is given may be so far off the function


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
class Servo:
    """A velocity servo with a gain [N m s/rad] and, if it has one, a torque limit [N m]."""

    gain: float
    torque_limit: float | None = None

    def __post_init__(self) -> None:
        check_positive("a servo's gain", self.gain, "N m s/rad")
        if self.torque_limit is not None:
            check_positive("a servo's torque limit", self.torque_limit, "N m")


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


class Ramp(
    msgspec.Struct,
    frozen=True,
    forbid_unknown_fields=True,
    kw_only=True,
    tag_field="kind",
    tag="ramp",
):
    """A rate that goes from `initial` to `final` between two times, linearly or smoothly.

    The smooth one starts and ends without a jerk: 3u² - 2u³ of the way at the fraction u.
    """

    final: float  # rad/s
    end: float  # s
    initial: float = 0.0  # rad/s
    start: float = 0.0  # s
    shape: Literal["linear", "smooth"] = "linear"

    def __post_init__(self) -> None:
        if not 0 <= self.start < self.end:
            raise InputError(
                f"a ramp must start at 0 or later and end after that, not from "
                f"{self.start:g} to {self.end:g} s"
            )
        check_positive("the time that a ramp takes", self.end - self.start, "s")
        check_size("a ramp's initial rate", self.initial, "rad/s")
        check_size("a ramp's final rate", self.final, "rad/s")

    @property
    def breakpoints(self) -> tuple[float, ...]:
        return (self.start, self.end)

    def _fraction(self, t: Time) -> Any:
        return np.clip((t - self.start) / (self.end - self.start), 0.0, 1.0)

    def rate(self, t: Time) -> Any:
        u = self._fraction(t)
        done = u if self.shape == "linear" else u * u * (3 - 2 * u)
        return self.initial + (self.final - self.initial) * done

    def acceleration(self, t: Time) -> Any:
        u = self._fraction(t)
        inside = (t >= self.start) & (t < self.end)
        slope = 1.0 if self.shape == "linear" else 6 * u * (1 - u)
        return inside * slope * (self.final - self.initial) / (self.end - self.start)

    def angle(self, t: Time) -> Any:
        u = self._fraction(t)
        area = u * u / 2 if self.shape == "linear" else u**3 * (1 - u / 2)
        rise = (self.final - self.initial) * (self.end - self.start)
        after = np.maximum(t - self.end, 0.0)
        return self.initial * t + rise * area + (self.final - self.initial) * after


class Sine(
    msgspec.Struct,
    frozen=True,
    forbid_unknown_fields=True,
    kw_only=True,
    tag_field="kind",
    tag="sine",
):
    """A rate of mean + amplitude·sin(2π frequency t + phase)."""

    amplitude: float  # rad/s
    frequency: float  # Hz
    mean: float = 0.0  # rad/s
    phase: float = 0.0  # rad

    def __post_init__(self) -> None:
        check_positive("a sine's frequency", self.frequency, "Hz")
        check_size("a sine's amplitude", self.amplitude, "rad/s")
        check_size("a sine's mean", self.mean, "rad/s")
        check_size("a sine's phase", self.phase, "rad")

    @property
    def breakpoints(self) -> tuple[float, ...]:
        return ()

    def _phase(self, t: Time) -> Any:
        return 2 * np.pi * self.frequency * t + self.phase

    def rate(self, t: Time) -> Any:
        return self.mean + self.amplitude * np.sin(self._phase(t))

    def acceleration(self, t: Time) -> Any:
        return 2 * np.pi * self.frequency * self.amplitude * np.cos(self._phase(t))

    def angle(self, t: Time) -> Any:
        swing = (np.cos(self.phase) - np.cos(self._phase(t))) / (2 * np.pi * self.frequency)
        return self.mean * t + self.amplitude * swing


@dataclass(frozen=True)
class Custom:
    """A rate given by a function of time, continuous, and smooth between `breakpoints`.

    derivative [rad/s²] and integral [rad], functions of time as well, are taken from polynomials
    that follow the function, where they are not given. None is asked outside a run's times.
    """

    function: Callable[[float], float]
    breakpoints: tuple[float, ...] = ()
    derivative: Callable[[float], float] | None = None
    integral: Callable[[float], float] | None = None


@dataclass(frozen=True)
class Followed:
    """The drive of a Custom rate over a run from 0 to `end` [s], and nowhere else."""

    custom: Custom
    end: float

    @property
    def breakpoints(self) -> tuple[float, ...]:
        return self.custom.breakpoints

    def rate(self, t: Time) -> Any:
        return _each(self._rate, t)

    def acceleration(self, t: Time) -> Any:
        return _each(self._acceleration, t)

    def angle(self, t: Time) -> Any:
        return _each(self._angle, t)

    @cached_property
    def polynomials(self) -> Polynomials:
        """What follows the function over the whole run.

        Raises InputError where the function jumps, or where a derivative or integral given for it
        is not its own; warns where it is not smooth and no derivative is given.
        """
        if not self.end <= LONGEST:
            raise InputError(
                f"a drive's function can be followed to t = {LONGEST:g} s at most, not to "
                f"{self.end:g} s; a number, a Ramp or a Sine has no such limit"
            )
        inside = sorted({float(b) for b in self.breakpoints if 0 < b < self.end})
        found = polynomials_of(self._rate, [0.0, *inside, self.end])
        follows = found.off <= FOLLOWED * (1 + found.size)
        middles = (found.edges[:-1] + found.edges[1:])[follows] / 2
        if self.custom.derivative is not None:
            _check_own("derivative", self._acceleration, found.slope, middles, "rad/s²")
        elif not follows.all():
            warn(
                f"a drive's function is not smooth at t = {found.edges[found.off.argmax()]:.6g} s: "
                f"its derivative there follows it to {found.off.max():.1g} rad/s only; give "
                "Custom its breakpoints, or its derivative"
            )
        if self.custom.integral is not None:
            _check_own("integral", self._angle, found.area, middles, "rad")
        return found

    def _rate(self, t: float) -> float:
        value = float(self.custom.function(t := self._inside(t)))
        if not abs(value) <= LARGEST:
            raise InputError(
                f"a drive's function gives {value} at t = {t:g} s; it must be finite and at most "
                f"{LARGEST:g} rad/s"
            )
        return value

    def _acceleration(self, t: float) -> float:
        t, given = self._inside(t), self.custom.derivative
        return self.polynomials.slope(t) if given is None else float(given(t))

    def _angle(self, t: float) -> float:
        t, given = self._inside(t), self.custom.integral
        return self.polynomials.area(t) if given is None else float(given(t)) - float(given(0.0))

    def _inside(self, t: float) -> float:
        """The time, without the rounding that may carry it beyond the end."""
        if not t <= self.end * (1 + ROUNDING):
            raise InputError(f"t = {t:g} s is beyond the end of the run, {self.end:g} s")
        return min(t, self.end)


def _check_own(
    name: str, given: Callable[[float], float], own: Callable[[float], float], at: Any, unit: str
) -> None:
    """Raises InputError where what is given for a function is not its own at some time."""
    for t in at.tolist():
        theirs, ours = given(t), own(t)
        if not abs(theirs - ours) <= GIVEN * (1 + abs(ours)):
            raise InputError(
                f"the {name} given for a drive is {theirs:.6g} {unit} at t = {t:g} s, where that "
                f"of its function is {ours:.6g} {unit}"
            )


Rate = float | Ramp | Sine | Custom | Drive | Callable[[float], float]


def as_drive(rate: Rate, end: float) -> Drive:
    """The drive of a rate in a run from 0 to `end` [s].

    rate: a number [rad/s], a Ramp, a Sine, a function of time, a Custom, or an object of one's
    own with a Drive's members. Raises InputError where it is none of these, or not finite at the
    start.
    """
    drive: Drive
    if isinstance(rate, Constant | Ramp | Sine):
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


def _each(function: Callable[[float], float], t: Time) -> Any:
    if np.ndim(t) == 0:
        return function(float(t))
    return np.array([function(float(s)) for s in t])

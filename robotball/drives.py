"""How a hinge turns: its rate over time, with the derivative and the integral of it.

A drive is smooth between its breakpoints and continuous at them; both engines stop there.
Times are scalars or increasing columns, in s from the start of the motion; SI units.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, Protocol, runtime_checkable

import msgspec
import numpy as np

from robotball.custom import Custom, Followed, Time
from robotball.errors import InputError, check_positive, check_size


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

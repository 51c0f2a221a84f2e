"""How a hinge turns: its rate over time, with the derivative and the integral of it.

A drive is smooth between its breakpoints and continuous at them; both engines stop there.
Times are scalars or increasing columns, in s from the start of the motion; SI units.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal, Protocol

import msgspec
import numpy as np

from robotball.errors import LARGEST, InputError, check_positive, check_size

Time = Any  # a float, or a column (n,)

STENCIL = 2e-3  # s, between the points of a difference: rounding and truncation both near 1e-12
JUMP_WIDTH = 1e-9  # s, around a breakpoint
JUMP = 1e-4  # of 1 rad/s and the rate: more is no slope but a jump
PANEL = 0.25  # s, at most, of a quadrature by eight points
MOST_PANELS = 4e5  # 1e5 s: a quarter of a minute for a cheap function


class Drive(Protocol):
    """What a hinge's rate must tell."""

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
    """A rate given by a function of time, smooth between `breakpoints`.

    Its derivative is taken by differences and its integral by quadrature, both to about 1e-11.
    """

    function: Callable[[float], float]
    breakpoints: tuple[float, ...] = ()

    def rate(self, t: Time) -> Any:
        return _each(self._rate, t)

    def acceleration(self, t: Time) -> Any:
        return _each(self._acceleration, t)

    def angle(self, t: Time) -> Any:
        ends = np.atleast_1d(np.asarray(t, dtype=float))
        if not ends[-1] / PANEL < MOST_PANELS:
            raise InputError(
                f"a drive's function can be integrated to t = {PANEL * MOST_PANELS:g} s at most, "
                f"not to {ends[-1]:g} s; a number, a Ramp or a Sine has no such limit"
            )
        angles = np.cumsum([self._turn(a, b) for a, b in pairwise([0.0, *ends.tolist()])])
        return angles if np.ndim(t) else float(angles[0])

    def _rate(self, t: float) -> float:
        value = float(self.function(t))
        if not abs(value) <= LARGEST:
            raise InputError(
                f"a drive's function gives {value} at t = {t:g} s; it must be finite and at most "
                f"{LARGEST:g} rad/s"
            )
        return value

    def _acceleration(self, t: float) -> float:
        # The slope of the quartic through five points on this side of any breakpoint.
        below = max([b for b in self.breakpoints if b <= t], default=-np.inf)
        above = min([b for b in self.breakpoints if b > t], default=np.inf)
        step = min(STENCIL, (above - below) / 8)
        first = min(max(t - 2 * step, below), above - 4 * step)
        nodes = first + step * np.arange(5)
        return float(
            np.polynomial.Polynomial.fit(nodes, [self._rate(s) for s in nodes], 4).deriv()(t)
        )

    def _turn(self, begin: float, end: float) -> float:
        edges = [begin, *(b for b in self.breakpoints if begin < b < end), end]
        panels = [np.linspace(a, b, 2 + int((b - a) / PANEL)) for a, b in pairwise(edges)]
        parts = np.concatenate(panels)
        x, weights = np.polynomial.legendre.leggauss(8)
        middle, half = (parts[1:] + parts[:-1]) / 2, (parts[1:] - parts[:-1]) / 2
        values = [[self._rate(m + h * s) for s in x] for m, h in zip(middle, half, strict=True)]
        return float(half @ (np.array(values) @ weights))


Rate = float | Ramp | Sine | Custom | Callable[[float], float]


def as_drive(rate: Rate) -> Drive:
    """A drive of a number [rad/s], a drive, or a function of time.

    Raises InputError where the rate is not finite at the start, or a function of time jumps at one
    of its breakpoints.
    """
    if isinstance(rate, Ramp | Sine):
        drive: Drive = rate
    elif isinstance(rate, Custom) or callable(rate):
        drive = rate if isinstance(rate, Custom) else Custom(rate)
        _check_continuous(drive)
    else:
        drive = Constant(float(rate))
    check_size("a drive's rate at t = 0 s", float(drive.rate(0.0)), "rad/s")
    return drive


def _check_continuous(drive: Drive) -> None:
    for t in drive.breakpoints:
        before, after = drive.rate(max(t - JUMP_WIDTH, 0.0)), drive.rate(t + JUMP_WIDTH)
        jump = abs(float(after - before))
        if jump > JUMP * (1 + abs(before)):
            raise InputError(f"a drive's rate jumps by {jump:g} rad/s at t = {t:g} s; ramp it")


def turns(drive: Drive) -> bool:
    """Whether the hinge turns at all; a body whose rate is zero for good is fixed, motorless."""
    return drive != Constant(0.0)


def _each(function: Callable[[float], float], t: Time) -> Any:
    if np.ndim(t) == 0:
        return function(float(t))
    return np.array([function(float(s)) for s in t])

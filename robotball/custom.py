"""Rates given by functions of time: what a drive needs beside the function is found for it."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from robotball.errors import LARGEST, InputError, warn
from robotball.polynomials import Polynomials, polynomials_of

Time = Any  # a float, or a column (n,)

LONGEST = 1e5  # s, that a function is followed: half a minute for a cheap one
ROUNDING = 1e-9  # relative: as far beyond the end a time is the end
FOLLOWED = 1e-12  # of the largest rate: a polynomial as near as that costs no accuracy
GIVEN = 1e-6  # relative: a derivative or integral that is given may be so far off the function


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
        t = self._inside(t)
        try:
            value = float(self.custom.function(t))
        except Exception as error:  # whatever a user's function may raise
            raise InputError(
                f"a drive's function fails at t = {t:g} s: {type(error).__name__}: {error}"
            ) from error
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


def _each(function: Callable[[float], float], t: Time) -> Any:
    if np.ndim(t) == 0:
        return function(float(t))
    return np.array([function(float(s)) for s in t])

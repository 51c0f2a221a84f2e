"""Rates that can be written down: ramps, sines, samples; each with its derivative and integral.

They are commands of a hinge: rates [rad/s], or to some motors angles [rad] or torques [N m].
"""

from bisect import bisect_right
from functools import cached_property
from typing import Annotated, Any, Literal

import msgspec
import numpy as np

from robotball.custom import Time
from robotball.described import key
from robotball.errors import InputError, check_positive, check_size
from robotball.rotations import Array

COMMAND = "of the command"


class Ramp(
    msgspec.Struct,
    frozen=True,
    forbid_unknown_fields=True,
    kw_only=True,
    tag_field="kind",
    tag="ramp",
):
    """A rate that goes from `initial` to `final` between two times.

    At the fraction u of the time it is u of the way (linear); 3u² - 2u³ (smooth: no jump of the
    acceleration); or 10u³ - 15u⁴ + 6u⁵ (quintic: none of the jerk either).
    """

    final: Annotated[float, key("the value from `end` on", COMMAND)]
    end: Annotated[float, key("when the ramp ends", "s")]
    initial: Annotated[float, key("the value until `start`", COMMAND)] = 0.0
    start: Annotated[float, key("when the ramp starts", "s")] = 0.0
    shape: Annotated[
        Literal["linear", "smooth", "quintic"],
        key("`linear`; `smooth`: no jump of the slope; `quintic`: nor of the slope's slope"),
    ] = "linear"

    def __post_init__(self) -> None:
        if not 0 <= self.start < self.end:
            raise InputError(
                f"a ramp must start at 0 or later and end after that, not from "
                f"{self.start:g} to {self.end:g} s"
            )
        check_positive("the time that a ramp takes", self.end - self.start, "s")
        check_size("a ramp's initial value", self.initial)
        check_size("a ramp's final value", self.final)

    @property
    def breakpoints(self) -> tuple[float, ...]:
        return (self.start, self.end)

    def _fraction(self, t: Time) -> Any:
        return np.clip((t - self.start) / (self.end - self.start), 0.0, 1.0)

    def rate(self, t: Time) -> Any:
        u = self._fraction(t)
        done = {
            "linear": u,
            "smooth": u * u * (3 - 2 * u),
            "quintic": u**3 * (10 + u * (6 * u - 15)),
        }[self.shape]
        return self.initial + (self.final - self.initial) * done

    def acceleration(self, t: Time) -> Any:
        u = self._fraction(t)
        inside = (t >= self.start) & (t < self.end)
        slope = {
            "linear": 1.0,
            "smooth": 6 * u * (1 - u),
            "quintic": 30 * (u * (1 - u)) ** 2,
        }[self.shape]
        return inside * slope * (self.final - self.initial) / (self.end - self.start)

    def angle(self, t: Time) -> Any:
        u = self._fraction(t)
        area = {
            "linear": u * u / 2,
            "smooth": u**3 * (1 - u / 2),
            "quintic": u**4 * (2.5 + u * (u - 3)),
        }[self.shape]
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

    amplitude: Annotated[float, key("how far it swings from the mean", COMMAND)]
    frequency: Annotated[float, key("swings in a second", "Hz")]
    mean: Annotated[float, key("what it swings about", COMMAND)] = 0.0
    phase: Annotated[float, key("where in its swing it starts", "rad")] = 0.0

    def __post_init__(self) -> None:
        check_positive("a sine's frequency", self.frequency, "Hz")
        check_size("a sine's amplitude", self.amplitude)
        check_size("a sine's mean", self.mean)
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


class Samples(
    msgspec.Struct,
    frozen=True,
    dict=True,
    forbid_unknown_fields=True,
    kw_only=True,
    tag_field="kind",
    tag="samples",
):
    """A rate through `values` at `times`, with a continuous slope.

    Between two samples it is a cubic that never leaves their range (Fritsch and Carlson's), so it
    overshoots nowhere. It is not told before the first sample or after the last.
    """

    times: tuple[float, ...]  # s
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.times) != len(self.values) or len(self.times) < 2:
            raise InputError(
                f"samples need as many values as times, two or more: not {len(self.times)} times "
                f"and {len(self.values)} values"
            )
        for name, numbers in (("time", self.times), ("value", self.values)):
            for i, number in enumerate(numbers):
                check_size(f"{name} {i + 1} of the samples", number)
        for i, (before, after) in enumerate(zip(self.times, self.times[1:], strict=False)):
            if not after > before:
                raise InputError(
                    f"the times of samples must increase: time {i + 2} is {after:g} s, after "
                    f"{before:g} s"
                )
        # Arrays are taken too; as tuples of numbers two rates can be compared.
        for name in ("times", "values"):
            msgspec.structs.force_setattr(self, name, tuple(map(float, getattr(self, name))))

    @property
    def breakpoints(self) -> tuple[float, ...]:
        return self.times[1:-1]

    @cached_property
    def _cubics(self) -> tuple[Array, Array]:
        """(4, n - 1) coefficients from t³ to 1 of each piece, and (n - 1,) the area before it."""
        from scipy.interpolate import PchipInterpolator

        a, b, c, d = pieces = PchipInterpolator(self.times, self.values).c
        h = np.diff(self.times)
        areas = h * (d + h * (c / 2 + h * (b / 3 + h * a / 4)))
        return pieces, np.concatenate([[0.0], np.cumsum(areas)[:-1]])

    def _piece(self, t: Time) -> Any:
        """The piece of a time, and how far into it [s]."""
        inner = self.times[1:-1]
        i: Any = (
            bisect_right(inner, t) if np.ndim(t) == 0 else np.searchsorted(inner, t, side="right")
        )
        return i, t - np.asarray(self.times)[i]

    def rate(self, t: Time) -> Any:
        i, s = self._piece(t)
        a, b, c, d = self._cubics[0][:, i]
        return d + s * (c + s * (b + s * a))

    def acceleration(self, t: Time) -> Any:
        i, s = self._piece(t)
        a, b, c, _ = self._cubics[0][:, i]
        return c + s * (2 * b + s * 3 * a)

    def angle(self, t: Time) -> Any:
        return self._area(t) - self._area(0.0 * t)

    def _area(self, t: Time) -> Any:
        """The integral from the first sample."""
        i, s = self._piece(t)
        a, b, c, d = self._cubics[0][:, i]
        return self._cubics[1][i] + s * (d + s * (c / 2 + s * (b / 3 + s * a / 4)))

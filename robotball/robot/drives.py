"""Drives: commands of hinges as functions of time.

A drive has a value, a derivative and an integral. It is a number, a Ramp, a Sine, Samples, a Sum,
or a user's function (Custom), for which polynomials give the derivative and the integral. A drive
is smooth between its breakpoints and continuous at them; every integration stops at breakpoints.
Times are scalars or increasing columns, in s from the start of the motion. All units are SI units.

For a hinge without a motor, the drive is the hinge's rate [rad/s], which the hinge keeps exactly.
For a motor, the drive is a command, see `motors`. `function_drives` approximates users' functions.
`sampling_error` is the error that a time step causes by sampling drives.
"""

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from numbers import Real
from typing import Annotated, Any, ClassVar, Literal, Protocol, runtime_checkable

import msgspec
import numpy as np

from robotball.errors import END_ROUNDING, InputError, check_positive, check_size
from robotball.rotations import uneven

_Time = Any  # a float, or a column (n,)
COMMAND = "of the command"  # unit of a key that has the unit of its command
_LOOKS = 256  # steps that are tested over a run, and as many again on each side of breakpoints
Rule = tuple[Sequence[float], Sequence[float]]
"""The nodes and weights of a quadrature rule, as parts of a step."""
SIMPSON: Rule = ((0.0, 0.5, 1.0), (1 / 6, 4 / 6, 1 / 6))
_NO_STEP = 1e-9  # s: a drive that needs shorter steps is not a function of time


@runtime_checkable
class Drive(Protocol):
    """Give the rate of a hinge as a function of time.

    Any object with these members can be used as a rate in a scene, or as the command of a motor.
    For a user's object, robotball computes the acceleration and the angle from `rate`.

    Attributes
    ----------
    breakpoints : tuple of float, s
        The times at which the rate is not smooth.

    Examples
    --------
    >>> import robotball as rb
    >>> drive = rb.Sine(amplitude=1.0, frequency=0.5)
    >>> isinstance(drive, rb.Drive)
    True
    >>> print(f"{drive.rate(0.5):.3f} rad/s, {drive.angle(0.5):.3f} rad")
    1.000 rad/s, 0.318 rad
    """

    @property
    def breakpoints(self) -> tuple[float, ...]:
        """Times at which the rate is not smooth [s]."""
        ...

    def rate(self, t: _Time) -> Any:
        """Return the rate [rad/s]."""
        ...

    def acceleration(self, t: _Time) -> Any:
        """Return the derivative of the rate [rad/s²]; at a breakpoint, the derivative after it."""
        ...

    def angle(self, t: _Time) -> Any:
        """Return the integral of the rate from time 0 [rad]."""
        ...


@dataclass(frozen=True)
class Constant:
    """A rate that does not change [rad/s]."""

    value: float
    breakpoints: tuple[float, ...] = ()

    # 0·t gives the results the shape of the times.

    def rate(self, t: _Time) -> Any:
        return self.value + 0.0 * t

    def acceleration(self, t: _Time) -> Any:
        return 0.0 * t

    def angle(self, t: _Time) -> Any:
        return self.value * t


def key(meaning: str, unit: str = "") -> msgspec.Meta:
    """Annotate a key of a scene file with its meaning, a line of Markdown, and its unit.

    The reader of scene files, docs/scene.md and the JSON schema use them.
    """
    return msgspec.Meta(description=meaning, extra={"unit": unit})


class _Curve(msgspec.Struct, frozen=True, forbid_unknown_fields=True, tag_field="kind"):
    """A drive that a scene file can describe, with a table that has the key `kind`."""


# For each shape of a ramp: value, slope and integral as functions of the fraction u of its time.
_SHAPES: dict[str, tuple[Callable[[Any], Any], ...]] = {
    "linear": (lambda u: u, lambda u: 1.0, lambda u: u * u / 2),
    "smooth": (
        lambda u: u * u * (3 - 2 * u),
        lambda u: 6 * u * (1 - u),
        lambda u: u**3 * (1 - u / 2),
    ),
    "quintic": (
        lambda u: u**3 * (10 + u * (6 * u - 15)),
        lambda u: 30 * (u * (1 - u)) ** 2,
        lambda u: u**4 * (2.5 + u * (u - 3)),
    ),
}


class Ramp(_Curve, frozen=True, kw_only=True, tag="ramp"):
    """Change a rate from `initial` to `final` between two times.

    Let u go from 0 at `start` to 1 at `end`. At u, a linear ramp has made the fraction u of the
    change, a smooth ramp 3u² - 2u³, and a quintic ramp 10u³ - 15u⁴ + 6u⁵. Smooth and quintic ramps
    have a continuous acceleration, quintic ramps also a continuous jerk.

    Attributes
    ----------
    final : float, rad/s
        The rate from `end` on. For a hinge with a motor, `final` has the unit of the command.
    end : float, s
        The time at which the ramp ends.
    initial : float, rad/s
        The rate until `start`, in the unit of `final`.
    start : float, s
        The time at which the ramp starts.
    shape : {"linear", "smooth", "quintic"}
        The shape of the transition.

    Raises
    ------
    InputError
        If the ramp starts before 0 s, does not end after its start, or has a value that is not
        finite.

    Examples
    --------
    >>> import robotball as rb
    >>> ramp = rb.Ramp(final=3.0, start=1.0, end=2.0, shape="smooth")
    >>> [float(ramp.rate(t)) for t in (0.0, 1.5, 2.0)]
    [0.0, 1.5, 3.0]
    """

    final: Annotated[float, key("value from `end` on", COMMAND)]
    end: Annotated[float, key("end of the ramp", "s")]
    initial: Annotated[float, key("value until `start`", COMMAND)] = 0.0
    start: Annotated[float, key("start of the ramp", "s")] = 0.0
    shape: Annotated[
        Literal["linear", "smooth", "quintic"],
        key("`linear`, `smooth` (continuous slope) or `quintic` (continuous second derivative)"),
    ] = "linear"

    def __post_init__(self) -> None:
        check_size("a ramp's start", self.start, "s")
        check_size("a ramp's end", self.end, "s")
        if not 0 <= self.start < self.end:
            times = f"start = {self.start:g} s and end = {self.end:g} s"
            raise InputError(f"a ramp must have 0 <= start < end; it has {times}")
        check_positive("the time that a ramp takes", self.end - self.start, "s")
        check_size("a ramp's initial value", self.initial)
        check_size("a ramp's final value", self.final)

    @property
    def breakpoints(self) -> tuple[float, ...]:
        return (self.start, self.end)

    def _fraction(self, t: _Time) -> Any:
        u = (t - self.start) / (self.end - self.start)
        # np.clip of a single time would take as long as the derivative of a ball's state.
        return min(max(u, 0.0), 1.0) if isinstance(u, float) else np.clip(u, 0.0, 1.0)

    def rate(self, t: _Time) -> Any:
        value, _, _ = _SHAPES[self.shape]
        return self.initial + (self.final - self.initial) * value(self._fraction(t))

    def acceleration(self, t: _Time) -> Any:
        _, slope, _ = _SHAPES[self.shape]
        # At a breakpoint, return the slope after it, which is 0 at the end of the ramp.
        inside = (t >= self.start) & (t < self.end)
        rise = self.final - self.initial
        return inside * slope(self._fraction(t)) * rise / (self.end - self.start)

    def angle(self, t: _Time) -> Any:
        _, _, area = _SHAPES[self.shape]
        rise = (self.final - self.initial) * (self.end - self.start)
        after = np.maximum(t - self.end, 0.0)
        covered = self.initial * t + rise * area(self._fraction(t))
        return covered + (self.final - self.initial) * after


class Sine(_Curve, frozen=True, kw_only=True, tag="sine"):
    """Oscillate a rate about a mean: mean + amplitude·sin(2π frequency t + phase).

    Attributes
    ----------
    amplitude : float, rad/s
        The amplitude. For a hinge with a motor, `amplitude` has the unit of the command.
    frequency : float, Hz
        The frequency.
    mean : float, rad/s
        The mean rate, in the unit of `amplitude`.
    phase : float, rad
        The phase at time 0.

    Raises
    ------
    InputError
        If the frequency is not positive, or a number is not finite.

    Examples
    --------
    >>> import robotball as rb
    >>> sine = rb.Sine(mean=2.0, amplitude=1.0, frequency=0.25)
    >>> print(f"{sine.rate(1.0):.3f} rad/s")
    3.000 rad/s
    """

    amplitude: Annotated[float, key("amplitude", COMMAND)]
    frequency: Annotated[float, key("frequency", "Hz")]
    mean: Annotated[float, key("mean", COMMAND)] = 0.0
    phase: Annotated[float, key("phase at time 0", "rad")] = 0.0

    def __post_init__(self) -> None:
        check_positive("a sine's frequency", self.frequency, "Hz")
        check_size("a sine's amplitude", self.amplitude)
        check_size("a sine's mean", self.mean)
        check_size("a sine's phase", self.phase, "rad")

    breakpoints: ClassVar[tuple[float, ...]] = ()

    def _phase(self, t: _Time) -> Any:
        return 2 * np.pi * self.frequency * t + self.phase

    def rate(self, t: _Time) -> Any:
        return self.mean + self.amplitude * np.sin(self._phase(t))

    def acceleration(self, t: _Time) -> Any:
        return 2 * np.pi * self.frequency * self.amplitude * np.cos(self._phase(t))

    def angle(self, t: _Time) -> Any:
        swing = (np.cos(self.phase) - np.cos(self._phase(t))) / (2 * np.pi * self.frequency)
        return self.mean * t + self.amplitude * swing


class Samples(_Curve, frozen=True, dict=True, kw_only=True, tag="samples"):
    """Interpolate a rate between values at given times, with a continuous slope.

    Between two samples the rate is a monotone cubic of Fritsch and Carlson, which does not
    overshoot. The rate is not defined before the first sample or after the last sample, so the
    samples must cover the whole run.

    Attributes
    ----------
    times : tuple of float, s
        At least two times, in increasing order. Arrays are accepted.
    values : tuple of float, rad/s
        The rate at each time. For a hinge with a motor, `values` have the unit of the command.

    Raises
    ------
    InputError
        If the numbers of times and values differ, if there are fewer than two samples, if the
        times do not increase, or if a number is not finite.

    Examples
    --------
    >>> import robotball as rb
    >>> rate = rb.Samples(times=(0.0, 1.0, 2.0), values=(0.0, 2.0, 2.0))
    >>> [float(rate.rate(t)) for t in (0.0, 1.0, 1.5)]
    [0.0, 2.0, 2.0]
    """

    times: tuple[float, ...]  # s
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        if len(self.times) != len(self.values) or len(self.times) < 2:
            counts = f"{len(self.times)} and {len(self.values)}"
            raise InputError(f"samples need at least 2 times and as many values, not {counts}")
        for name, numbers in (("time", self.times), ("value", self.values)):
            for i, number in enumerate(numbers, start=1):
                check_size(f"{name} {i} of the samples", number)
        for i, (before, after) in enumerate(itertools.pairwise(self.times), start=2):
            if not after > before:
                line = f"time {i} is {after:g} s, and time {i - 1} is {before:g} s"
                raise InputError(f"the times of samples must increase: {line}")
        # Arrays are converted to tuples, because arrays cannot be compared.
        for name in ("times", "values"):
            msgspec.structs.force_setattr(self, name, tuple(map(float, getattr(self, name))))

    @property
    def breakpoints(self) -> tuple[float, ...]:
        return self.times[1:-1]

    @cached_property
    def _cubics(self) -> tuple[Any, Any, Any]:
        """Cubics of the rate, of its derivative, and of its integral from the first sample on."""
        from scipy.interpolate import PchipInterpolator

        rate = PchipInterpolator(self.times, self.values)
        return rate, rate.derivative(), rate.antiderivative()

    # SciPy returns a 0-dimensional array for a scalar; [()] extracts the number.

    def rate(self, t: _Time) -> Any:
        return self._cubics[0](t)[()]

    def acceleration(self, t: _Time) -> Any:
        return self._cubics[1](t)[()]

    def angle(self, t: _Time) -> Any:
        area = self._cubics[2]
        return (area(t) - area(0.0))[()]


@dataclass(frozen=True)
class Sum:
    """Add several rates.

    Attributes
    ----------
    parts : tuple
        The rates: numbers, drives, functions of time or sums.

    Raises
    ------
    InputError
        If `parts` is empty.

    Examples
    --------
    >>> import robotball as rb
    >>> rate = rb.Sum((2.0, rb.Ramp(final=1.0, end=0.5)))
    >>> scene = rb.load_scene("fig12").with_hinges(command={"frame": rate})
    >>> motion = rb.integrate(scene, 0.5)
    >>> print(f"{motion.hinge_rates[-1, 0]:.3f} rad/s")
    3.000 rad/s
    """

    parts: tuple["Rate", ...]

    def __post_init__(self) -> None:
        if not self.parts:
            raise InputError("a sum needs at least one rate")

    @property
    def terms(self) -> tuple["Rate", ...]:
        """The parts; a part that is a Sum is replaced with its terms."""
        terms = (part.terms if isinstance(part, Sum) else (part,) for part in self.parts)
        return tuple(itertools.chain.from_iterable(terms))


@dataclass(frozen=True)
class Custom:
    """Take a rate from a function of time.

    The function must be continuous, and smooth between the breakpoints. Its derivative and its
    integral come from polynomials that agree with the function to rounding. A pulse that is shorter
    than `finest` and has no breakpoints may lie between two samples; all engines then miss it.

    Attributes
    ----------
    function : callable
        Returns the rate [rad/s] at a time [s].
    breakpoints : tuple of float, s
        The times at which the rate is not smooth.
    finest : float or None, s
        The largest interval between the uneven times at which the function is sampled. If None,
        it is 1 ms, or 1/100 000 of the duration if a run is longer than 100 s.

    Raises
    ------
    InputError
        If `finest` is not positive.

    Examples
    --------
    >>> import math
    >>> import robotball as rb
    >>> rate = rb.Custom(lambda t: 2.0 + math.tanh(t))
    >>> scene = rb.load_scene("fig12").with_hinges(command={"frame": rate})
    >>> motion = rb.integrate(scene, 0.5)
    >>> print(f"{motion.hinge_rates[-1, 0]:.3f} rad/s")
    2.462 rad/s
    """

    function: Callable[[float], float]
    breakpoints: tuple[float, ...] = ()
    finest: float | None = None

    def __post_init__(self) -> None:
        if self.finest is not None:
            check_positive("the finest interval of a function", self.finest, "s")


Rate = float | Ramp | Sine | Samples | Sum | Custom | Drive | Callable[[float], float]


def as_drive(rate: Rate, end: float) -> Drive:
    """Return the drive of a rate in a run from 0 to `end` [s].

    rate: a number [rad/s], a Ramp, a Sine, Samples, a Sum, a function of time, a Custom, or a
    user's object with the members of a Drive. Raises InputError for any other object, for a rate
    that is not finite at the start, and for samples that do not cover the run.
    """
    drive: Drive
    # Numbers come first, because isinstance with a protocol takes 20 µs.
    if isinstance(rate, Real):
        drive = Constant(float(rate))
    elif isinstance(rate, Samples):
        _check_covers(rate, end)
        drive = rate
    elif isinstance(rate, Sum):
        drives = tuple(as_drive(part, end) for part in rate.terms)
        steady = [drive.value for drive in drives if isinstance(drive, Constant)]
        # A sum of numbers becomes a number, so the scene counts as steady and can use compiled
        # steps.
        drive = Constant(sum(steady)) if len(steady) == len(drives) else Total(drives)
    elif isinstance(rate, Constant | Ramp | Sine | Total):
        drive = rate
    elif isinstance(rate, Custom | Drive) or callable(rate):
        from robotball.robot.function_drives import FunctionDrive, HeldCommand

        if isinstance(rate, HeldCommand):
            drive = rate
        elif isinstance(rate, Custom):
            drive = FunctionDrive(end, *vars(rate).values())
        elif isinstance(rate, Drive):
            drive = FunctionDrive(end, rate.rate, tuple(rate.breakpoints))
        else:
            drive = FunctionDrive(end, rate)
    else:
        line = "a rate must be a number, a function of time, or a drive (see robotball.Drive)"
        raise InputError(f"{line}, not {rate!r}")
    check_size("a drive's rate at t = 0 s", float(drive.rate(0.0)), "rad/s")
    return drive


def _check_covers(samples: Samples, end: float) -> None:
    first, last = samples.times[0], samples.times[-1]
    if not (first <= 0 and last >= end * (1 - END_ROUNDING)):
        run = f"the run, from 0 to {end:g} s; add samples, or shorten the run"
        raise InputError(f"samples from t = {first:g} to {last:g} s do not cover {run}")


@dataclass(frozen=True)
class Total:
    """The drive of a Sum, with the drives of the Sum's terms over the run."""

    drives: tuple[Drive, ...]

    @property
    def breakpoints(self) -> tuple[float, ...]:
        return tuple(sorted({t for drive in self.drives for t in drive.breakpoints}))

    def rate(self, t: _Time) -> Any:
        return sum(drive.rate(t) for drive in self.drives)

    def acceleration(self, t: _Time) -> Any:
        return sum(drive.acceleration(t) for drive in self.drives)

    def angle(self, t: _Time) -> Any:
        return sum(drive.angle(t) for drive in self.drives)


def turns(drive: Drive) -> bool:
    """Return whether a hinge with this drive turns. At a constant rate of 0 it is fixed."""
    return drive != Constant(0.0)


def sampling_error(
    drives: Iterable[Drive], stops: Any, timestep: float, rule: Rule = SIMPSON
) -> float:
    """Return the largest error of a drive's mean over a step, sampled at a few instants.

    It is the error of a quadrature rule, divided by the drive's largest value. The default is
    Simpson's rule, which RK4 uses. The tested steps begin at uneven times, because a drive whose
    period divides the timestep has zero error at some phases. No step extends over one of the stops
    (n,) [s]: 0, the breakpoints and the end.
    """
    sides = stops[:: -(-len(stops) // _LOOKS)]
    spread = uneven(stops[-1], stops[-1] / _LOOKS)
    looks = np.sort(np.concatenate([spread, sides, np.nextafter(sides, 0.0)]))
    piece = np.searchsorted(stops[1:-1], looks, side="right")
    length = np.diff(stops)[piece]
    step = length / np.ceil(length / timestep)
    begin = np.clip(looks - step / 2, stops[piece], stops[piece] + length - step)
    worst = 0.0
    for drive in (drive for drive in drives if not isinstance(drive, Constant)):
        instants = [begin + part * step for part in rule[0]]
        values = np.array([drive.rate(t) for t in instants])
        angles = np.array([drive.angle(begin), drive.angle(begin + step)])
        error = np.abs(np.diff(angles, axis=0)[0] - step * (values.T @ rule[1]))
        error -= 8 * np.finfo(float).eps * np.abs(angles).sum(axis=0)  # rounding errors
        worst = max(worst, float((error / step).max() / (_size(drive, instants) or 1.0)))
    return worst


def _size(drive: Drive, instants: list[Any]) -> float:
    """Return the largest value of a drive, or the sum of the largest values of its parts.

    If the parts cancel, the value of the sum is a meaningless rounding error.
    """
    if isinstance(drive, Total):
        return sum(_size(part, instants) for part in drive.drives)
    return max(float(np.abs(drive.rate(t)).max()) for t in instants)


def seeing_step(
    error_of: Callable[[float], float], timestep: float, limit: float, order: int = 4
) -> float:
    """Return a timestep [s], at most `timestep`, with a sampling error within a limit."""
    while (error := error_of(timestep)) > limit and timestep > _NO_STEP:
        # The error decreases with the order of the rule as soon as a step resolves the drive.
        timestep *= min(0.9, max(0.1, (limit / error) ** (1 / order)))
    return timestep

"""Drives by users' functions of time, with derivatives and integrals by polynomials.

A function is followed by Chebyshev polynomials of degree 24, a panel each. Panels are halved until
the last coefficients are rounding and the polynomial passes through every look at the function, so
that smooth functions are known to rounding, and what still changes within the narrowest panel is a
jump. In order: the drive, its polynomials, commands that are held.
"""

from bisect import bisect_right
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import chain, pairwise
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev

from robotball.errors import END_ROUNDING, LARGEST, InputError, call_users, warn
from robotball.rotations import Array, uneven

_Function = Callable[[float], float]

_LONGEST_FUNCTION = 1e5  # s, of a followed function: half a minute's work for a cheap one
_FOLLOWED = 1e-12  # of the largest rate: a polynomial as near as that costs no accuracy
_GIVEN = 1e-6  # relative: the largest error of a given derivative or integral
_FINEST = 1e-3  # s, between two looks at a function whose author names no other
_LOOKS, _MOST_LOOKS = 100_000, 10_000_000  # over a run: without a `finest`, and with one
# s: a step may pass over what a panel shorter than _SHORT follows, so there are breakpoints, as
# near as RK4 needs them. A panel below _SHORTEST is at a kink, which is halved without end.
_SHORT, _SHORTEST, _PARTS = 0.02, 1e-6, 4


@dataclass(frozen=True)
class FunctionDrive:
    """The drive of a user's function over a run from 0 to `end` [s], and nowhere else.

    The fields are those of a Custom rate, whose breakpoints are `named`. A derivative or integral
    that is None is taken from polynomials.
    """

    end: float
    function: _Function
    named: tuple[float, ...]
    derivative: _Function | None
    integral: _Function | None
    finest: float | None

    @cached_property
    def breakpoints(self) -> tuple[float, ...]:
        """The breakpoints that are named, and the parts of the panels where the rate is quick."""
        quick = (p for p in pairwise(self.polynomials.edges) if _SHORTEST < p[1] - p[0] < _SHORT)
        parts = chain.from_iterable(np.linspace(*each, _PARTS + 1).tolist() for each in quick)
        return tuple(sorted({*self.named, *parts} - {self.end}))

    def rate(self, t: Any) -> Any:
        return _each(self._rate, t)

    def acceleration(self, t: Any) -> Any:
        return _each(self._acceleration, t)

    def angle(self, t: Any) -> Any:
        return _each(self._angle, t)

    @cached_property
    def polynomials(self) -> "_Polynomials":
        """Polynomials that follow the function over the whole run.

        Raises InputError where the function jumps, or where a derivative or integral given for it
        is not its own; warns where it is not smooth and no derivative is given.
        """
        finest = self.finest or max(_FINEST, self.end / _LOOKS)
        longest = min(_LONGEST_FUNCTION, _MOST_LOOKS * finest)
        if not self.end <= longest:
            raise InputError(
                f"a drive's function can be followed to t = {longest:g} s at most, not to "
                f"{self.end:g} s, every {finest:g} s; a number, a Ramp or a Sine has no such limit"
            )
        inside = sorted({float(b) for b in self.named if 0 < b < self.end})
        looks = uneven(self.end, finest)
        found = polynomials_of(self._rate, [0.0, *inside, self.end], looks)
        follows = found.off <= _FOLLOWED * (1 + found.size)
        # What is given is compared in the middle of each panel that the polynomial follows: near a
        # kink that no breakpoint names, the polynomial itself is off.
        middles = (found.edges[:-1] + found.edges[1:])[follows] / 2
        if self.derivative is not None:
            _check_own("derivative", self._acceleration, found.slope, middles, "rad/s²")
        elif not follows.all():
            warn(
                f"a drive's function is not smooth at t = {found.edges[found.off.argmax()]:.6g} s: "
                f"its derivative there follows it to {found.off.max():.1g} rad/s only; give "
                "Custom its breakpoints, or its derivative"
            )
        if self.integral is not None:
            _check_own("integral", self._angle, found.area, middles, "rad")
        return found

    def _rate(self, t: float) -> float:
        t = self._inside(t)
        value = _called("function", self.function, t)
        if not abs(value) <= LARGEST:
            raise InputError(
                f"a drive's function gives {value} at t = {t:g} s; it must be finite and at most "
                f"{LARGEST:g} rad/s"
            )
        return value

    def _acceleration(self, t: float) -> float:
        t, given = self._inside(t), self.derivative
        return self.polynomials.slope(t) if given is None else _called("derivative", given, t)

    def _angle(self, t: float) -> float:
        t, given = self._inside(t), self.integral
        if given is None:
            return self.polynomials.area(t)
        return _called("integral", given, t) - _called("integral", given, 0.0)

    def _inside(self, t: float) -> float:
        """Return the time without the rounding that may carry it beyond the end."""
        if not t <= self.end * (1 + END_ROUNDING):
            raise InputError(f"t = {t:g} s is beyond the end of the run, {self.end:g} s")
        return min(t, self.end)


def _called(name: str, function: _Function, t: float) -> float:
    value = call_users(f"a drive's {name} fails", function, t, at=t)
    return call_users(f"a drive's {name} gives no number", float, value, at=t)


def _each(function: _Function, t: Any) -> Any:
    # A user's function is asked for one time after another: it need not take arrays.
    if np.ndim(t) == 0:
        return function(float(t))
    return np.array([function(float(s)) for s in t])


def _check_own(name: str, given: _Function, own: _Function, at: Any, unit: str) -> None:
    """Raise InputError where a given derivative or integral is not the function's own."""
    for t in at.tolist():
        theirs, ours = given(t), own(t)
        if not abs(theirs - ours) <= _GIVEN * (1 + abs(ours)):
            raise InputError(
                f"the {name} given for a drive is {theirs:.6g} {unit} at t = {t:g} s, where that "
                f"of its function is {ours:.6g} {unit}"
            )


_PANEL = 0.5  # s, the longest
_NARROWEST = 1e-9  # s: a panel of that length is not halved again
_MOST_HALVES = 500  # of one panel: some ten kinks
_JUMP = 1e-4  # of 1 and the value: more within the narrowest panel is no slope but a jump
_DEGREE = 24
# The ends are among the nodes, so that neighbours meet and the slope's integral is the function.
_NODES = chebyshev.chebpts2(_DEGREE + 1)
_COEFFICIENTS = np.linalg.inv(chebyshev.chebvander(_NODES, _DEGREE))
_EPS = float(np.finfo(float).eps)
_ROUNDING = 8 * _EPS  # of the last coefficients of a polynomial that follows
_BETWEEN = 100.0  # times as much: the rounding of its values between the nodes


@dataclass(frozen=True)
class _Polynomials:
    """A function from edges[0] to edges[-1] by one polynomial between each two edges.

    edges   (n + 1,)  s
    slopes  (n, k)    coefficients of the derivative, Chebyshev's, on -1 to 1
    areas   (n, k+2)  of the integral from the panel's begin, to rounding
    before  (n,)      the integral from edges[0] to the panel's begin, less the rounding there
    off     (n,)      how far the polynomial may be off the function
    size              the function's largest value
    """

    edges: Array
    slopes: Array
    areas: Array
    before: Array
    off: Array
    size: float

    def slope(self, t: float) -> float:
        """Return the derivative at `t`; at an edge, from there on."""
        i, x = self._place(t)
        return float(chebyshev.chebval(x, self.slopes[i]))

    def area(self, t: float) -> float:
        """Return the integral from edges[0] to `t`."""
        i, x = self._place(t)
        return float(self.before[i] + chebyshev.chebval(x, self.areas[i]))

    def _place(self, t: float) -> tuple[int, float]:
        """Return the panel of a time, and where in it the time is, from -1 to 1."""
        i = int(np.searchsorted(self.edges[1:-1], t, side="right"))
        begin, end = self.edges[i : i + 2]
        return i, float((2 * t - begin - end) / (end - begin))


def polynomials_of(
    function: _Function, edges: list[float], looks: Array = _NODES[:0]
) -> _Polynomials:
    """Return polynomials that follow a function to rounding, or as near as halving brings them.

    edges: increasing times, of which the function is smooth between each two; looks: further times
    at which it is followed. It is asked there and between, never before the first or after the
    last. Raises InputError where it jumps.
    """
    panels: list[tuple[float, float, Array, float]] = []
    size = 0.0
    for piece in pairwise(edges):
        count = int(np.ceil((piece[1] - piece[0]) / _PANEL))
        for begin, end in pairwise(np.linspace(*piece, count + 1).tolist()):
            seen = looks[np.searchsorted(looks, begin) : np.searchsorted(looks, end)]
            for panel in _halved(function, begin, end, size, seen):
                panels.append(panel)
                size = max(size, float(np.abs(panel[2]).max()))
    found = np.array([panels[0][0], *(end for _, end, *_ in panels)])
    halves = np.diff(found)[:, None] / 2
    coefficients = np.array([_COEFFICIENTS @ values for _, _, values, _ in panels])
    off = np.array([off for *_, off in panels])
    # Coefficients of rounding alone would be magnified in the slope by the square of their degree.
    coefficients[np.abs(coefficients) < _EPS * size] = 0.0
    slopes = chebyshev.chebder(coefficients, axis=1) / halves
    areas = chebyshev.chebint(coefficients, lbnd=-1.0, axis=1) * halves
    # What rounding leaves at a panel's begin depends on the processor; the integral begins at 0.
    begins, ends = (np.asarray(chebyshev.chebval(x, areas.T)) for x in (-1.0, 1.0))
    before = np.cumsum([0.0, *(ends - begins)[:-1]]) - begins
    return _Polynomials(found, slopes, areas, before, off, size)


def _halved(
    function: _Function, begin: float, end: float, size: float, looks: Array
) -> Iterator[tuple[float, float, Array, float]]:
    """Yield (begin, end, values at the nodes, how far off) of the parts, halved as it helps."""
    seen = np.array([function(t) for t in looks.tolist()])
    # A stack with the earlier half on top, so that panels come in the order of time.
    left, halves = [(begin, end)], 0
    while left:
        a, b = left.pop()
        middle, half = (a + b) / 2, (b - a) / 2
        # Rounding may carry a node out of the panel, where the function need not be defined.
        nodes = np.clip(middle + half * _NODES, a, b)
        nodes[0], nodes[-1] = a, b
        values = np.array([function(t) for t in nodes.tolist()])
        coefficients = _COEFFICIENTS @ values
        part = slice(*np.searchsorted(looks, (a, b)))
        between = chebyshev.chebval((looks[part] - middle) / half, coefficients) - seen[part]
        tail, missed = float(_tail(coefficients)), float(np.abs(between).max(initial=0.0))
        follows = max(tail, missed / _BETWEEN) <= _rounding_of(coefficients, a, b, size)
        if follows or b - a <= _NARROWEST or halves == _MOST_HALVES:
            if not follows and b - a <= _NARROWEST:
                _check_continuous(a, b, values)
            yield a, b, values, tail if follows else max(tail, missed)
        else:
            halves += 1
            left += [(middle, b), (a, middle)]


def _tail(coefficients: Array) -> Array:
    """Return the largest of the last coefficients (..., degree + 1)."""
    # Three, as an odd or even function has every second coefficient zero.
    return np.abs(coefficients[..., -3:]).max(axis=-1)


def _rounding_of(coefficients: Array, begin: float, end: float, size: float) -> float:
    """Return what rounding leaves of a function of this size in its last coefficients.

    No function knows its argument better than to the last bit.
    """
    steepest = float(np.abs(coefficients[1:]).sum()) / ((end - begin) / 2)
    return _ROUNDING * (max(size, float(np.abs(coefficients).max())) + abs(end) * steepest)


def _check_continuous(begin: float, end: float, values: Array) -> None:
    """Raise InputError where the values in a panel of the narrowest length are too far apart."""
    jump = float(np.ptp(values))
    if jump > _JUMP * (1 + float(np.abs(values).min())):
        t = (begin + end) / 2
        raise InputError(f"a drive's rate jumps by {jump:g} rad/s at t = {t:.9g} s; ramp it")


class HeldCommand:
    """Commands that a run holds, each from a time on until the next; before them, a drive.

    It grows as a controller gives commands. Only a motor takes it, for a rate would jump.
    """

    # Drives, by whose module this one is imported.
    def __init__(self, before: Any) -> None:
        self.times: list[float] = []
        self.drives, self.turned = [before], [0.0]  # turned: rad, where each begins
        self.breakpoints = before.breakpoints

    def hold(self, t: float, drive: Any) -> None:
        """Hold another drive from t [s] on, which is not before the last of the times."""
        self.turned.append(self.angle(t))
        self.times.append(t)
        self.drives.append(drive)

    # Engines ask for one time after another, and often.

    def rate(self, t: Any) -> Any:
        return self.at(t).rate(t) if isinstance(t, float) else _each(self.rate, t)

    def acceleration(self, t: Any) -> Any:
        return self.at(t).acceleration(t) if isinstance(t, float) else _each(self.acceleration, t)

    def angle(self, t: Any) -> Any:
        if not isinstance(t, float):
            return _each(self.angle, t)
        i = bisect_right(self.times, t)
        begin, drive = self.times[i - 1] if i else 0.0, self.drives[i]
        return self.turned[i] + (drive.angle(t) - drive.angle(begin))

    def at(self, t: float) -> Any:
        """Return the drive at a time [s]."""
        return self.drives[bisect_right(self.times, t)]

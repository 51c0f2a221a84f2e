"""Drives from users' functions of time, with polynomials for derivatives and integrals.

A function is approximated by Chebyshev polynomials of degree 24, one for each panel, an interval of
time. Panels are halved until the last coefficients are rounding errors and the polynomial agrees
with every sample of the function. So smooth functions are accurate to rounding, and a large change
within the narrowest panel counts as a jump. `HeldCommand` is the drive of a controller's commands.
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

_LONGEST_FUNCTION = 1e5  # s; its approximation takes 30 s for a cheap function
_ACCURATE = 1e-12  # of the largest rate: a polynomial with this error costs no accuracy
_FINEST = 1e-3  # s, default interval between samples of a function
_LOOKS, _MOST_LOOKS = 100_000, 10_000_000  # samples over a run: without a `finest`, and with one
# s: a step may miss what happens in a panel shorter than _SHORT. Such a panel gets _PARTS - 1
# breakpoints inside, as close as RK4 needs. Panels below _SHORTEST are at a kink, where halving
# does not help.
_SHORT, _SHORTEST, _PARTS = 0.02, 1e-6, 4
_PANEL = 0.5  # s, longest panel
_NARROWEST = 1e-9  # s: panels of this length are not halved
_MOST_HALVES = 500  # halves of one panel, enough for some ten kinks
_JUMP = 1e-4  # times 1 + |value|: a larger change within the narrowest panel is a jump
_DEGREE = 24
# The nodes include the ends of the panel, so neighbouring polynomials meet, and the integral of the
# slope is the function.
_NODES = chebyshev.chebpts2(_DEGREE + 1)
_COEFFICIENTS = np.linalg.inv(chebyshev.chebvander(_NODES, _DEGREE))
_EPS = float(np.finfo(float).eps)
_ROUNDING = 8 * _EPS  # of the last coefficients of an accurate polynomial
_BETWEEN = 100.0  # rounding errors between the nodes, divided by those in the last coefficients


@dataclass(frozen=True)
class FunctionDrive:
    """The drive of a user's function over a run from 0 to `end` [s].

    The other fields are the fields of a Custom; `named` are its breakpoints.
    """

    end: float
    function: _Function
    named: tuple[float, ...] = ()
    finest: float | None = None

    @cached_property
    def breakpoints(self) -> tuple[float, ...]:
        """The user's breakpoints, and further ones in short panels, where the rate changes fast."""
        panels = pairwise(self.polynomials.edges)
        short = (panel for panel in panels if _SHORTEST < panel[1] - panel[0] < _SHORT)
        parts = chain.from_iterable(np.linspace(*panel, _PARTS + 1).tolist() for panel in short)
        return tuple(sorted({*self.named, *parts} - {self.end}))

    def rate(self, t: Any) -> Any:
        return _each(self._rate, t)

    def acceleration(self, t: Any) -> Any:
        return _each(lambda t: self.polynomials.slope(self._inside(t)), t)

    def angle(self, t: Any) -> Any:
        return _each(lambda t: self.polynomials.area(self._inside(t)), t)

    @cached_property
    def polynomials(self) -> "_Polynomials":
        """Polynomials that approximate the function over the whole run.

        Raises InputError if the function jumps. Warns if it is not smooth.
        """
        finest = self.finest or max(_FINEST, self.end / _LOOKS)
        longest = min(_LONGEST_FUNCTION, _MOST_LOOKS * finest)
        if not self.end <= longest:
            limit = f"can cover at most t = {longest:g} s, not {self.end:g} s"
            remedy = "a number, a Ramp or a Sine has no such limit"
            raise InputError(f"a drive's function, sampled every {finest:g} s, {limit}; {remedy}")
        inside = sorted({float(b) for b in self.named if 0 < b < self.end})
        looks = uneven(self.end, finest)
        polynomials = polynomials_of(self._rate, [0.0, *inside, self.end], looks)
        off, worst = float(polynomials.off.max()), polynomials.edges[polynomials.off.argmax()]
        if not off <= _ACCURATE * (1 + polynomials.size):
            fault = f"at t = {worst:.6g} s, where its samples leave an error of {off:.1g} rad/s"
            warn(f"a drive's function is not smooth {fault}; give its breakpoints to Custom")
        return polynomials

    def _rate(self, t: float) -> float:
        t = self._inside(t)
        value = call_users("a drive's function fails", self.function, t, at=t)
        value = call_users("a drive's function gives no number", float, value, at=t)
        if not abs(value) <= LARGEST:
            limit = f"a rate must be finite and at most {LARGEST:g} rad/s"
            raise InputError(f"a drive's function gives {value} at t = {t:g} s; {limit}")
        return value

    def _inside(self, t: float) -> float:
        """Return the time, limited to the end if it exceeds the end by a rounding error."""
        if not t <= self.end * (1 + END_ROUNDING):
            raise InputError(f"t = {t:g} s is beyond the end of the run, {self.end:g} s")
        return min(t, self.end)


def _each(function: _Function, t: Any) -> Any:
    # A user's function need not accept arrays.
    if np.ndim(t) == 0:
        return function(float(t))
    return np.array([function(float(s)) for s in t])


@dataclass(frozen=True)
class _Polynomials:
    """A function from edges[0] to edges[-1], with one polynomial per panel.

    Attributes
    ----------
    edges : (n + 1,), s
    slopes : (n, k)
        Chebyshev coefficients of the derivative, on -1 to 1.
    areas : (n, k + 2)
        Chebyshev coefficients of the integral from the panel's begin.
    before : (n,)
        Integral from edges[0] to the panel's begin, minus the rounding error of `areas` there.
    off : (n,)
        Bound of the polynomial's error.
    size : float
        Largest value of the function.
    """

    edges: Array
    slopes: Array
    areas: Array
    before: Array
    off: Array
    size: float

    def slope(self, t: float) -> float:
        """Return the derivative at `t`; at an edge, the derivative after it."""
        i, x = self._place(t)
        return float(chebyshev.chebval(x, self.slopes[i]))

    def area(self, t: float) -> float:
        """Return the integral from edges[0] to `t`."""
        i, x = self._place(t)
        return float(self.before[i] + chebyshev.chebval(x, self.areas[i]))

    def _place(self, t: float) -> tuple[int, float]:
        """Return the panel of a time, and the position of the time in the panel, from -1 to 1."""
        i = int(np.searchsorted(self.edges[1:-1], t, side="right"))
        begin, end = self.edges[i : i + 2]
        return i, float((2 * t - begin - end) / (end - begin))


def polynomials_of(
    function: _Function, edges: list[float], looks: Array = _NODES[:0]
) -> _Polynomials:
    """Return polynomials that approximate a function to rounding, or as well as halving permits.

    edges: increasing times. The function is smooth between the edges, and is not called outside
    them. looks: further times at which the function is sampled. Raises InputError if it jumps.
    """
    panels: list[tuple[float, float, Array, float]] = []
    size = 0.0
    for piece in pairwise(edges):
        count = int(np.ceil((piece[1] - piece[0]) / _PANEL))
        for begin, end in pairwise(np.linspace(*piece, count + 1).tolist()):
            inside = looks[np.searchsorted(looks, begin) : np.searchsorted(looks, end)]
            for panel in _halved(function, begin, end, size, inside):
                panels.append(panel)
                size = max(size, float(np.abs(panel[2]).max()))
    ends_of_panels = np.array([panels[0][0], *(end for _, end, *_ in panels)])
    halves = np.diff(ends_of_panels)[:, None] / 2
    coefficients = np.array([_COEFFICIENTS @ values for _, _, values, _ in panels])
    off = np.array([off for *_, off in panels])
    # Differentiation would multiply coefficients that are rounding errors by the square of their
    # degree.
    coefficients[np.abs(coefficients) < _EPS * size] = 0.0
    slopes = chebyshev.chebder(coefficients, axis=1) / halves
    areas = chebyshev.chebint(coefficients, lbnd=-1.0, axis=1) * halves
    # The rounding error at the begin of a panel depends on the processor. It is subtracted, so that
    # the integral begins at 0.
    begins, ends = (np.asarray(chebyshev.chebval(x, areas.T)) for x in (-1.0, 1.0))
    before = np.cumsum([0.0, *(ends - begins)[:-1]]) - begins
    return _Polynomials(ends_of_panels, slopes, areas, before, off, size)


def _halved(
    function: _Function, begin: float, end: float, size: float, looks: Array
) -> Iterator[tuple[float, float, Array, float]]:
    """Yield (begin, end, values at the nodes, error) of the panels, halved as long as it helps."""
    samples = np.array([function(t) for t in looks.tolist()])
    # A stack with the earlier half on top, so that panels come in order.
    left, halves = [(begin, end)], 0
    while left:
        a, b = left.pop()
        middle, half = (a + b) / 2, (b - a) / 2
        # Rounding may move a node out of the panel, where the function may be undefined.
        nodes = np.clip(middle + half * _NODES, a, b)
        nodes[0], nodes[-1] = a, b
        values = np.array([function(t) for t in nodes.tolist()])
        coefficients = _COEFFICIENTS @ values
        part = slice(*np.searchsorted(looks, (a, b)))
        between = chebyshev.chebval((looks[part] - middle) / half, coefficients) - samples[part]
        # Take three coefficients, because every second one is zero for an odd or even function.
        tail = float(np.abs(coefficients[-3:]).max())
        missed = float(np.abs(between).max(initial=0.0))
        accurate = max(tail, missed / _BETWEEN) <= _rounding_of(coefficients, a, b, size)
        if accurate or b - a <= _NARROWEST or halves == _MOST_HALVES:
            if not accurate and b - a <= _NARROWEST:
                _check_continuous(a, b, values)
            yield a, b, values, tail if accurate else max(tail, missed)
        else:
            halves += 1
            left += [(middle, b), (a, middle)]


def _rounding_of(coefficients: Array, begin: float, end: float, size: float) -> float:
    """Return the rounding error in the last coefficients of a function with values of this size.

    The error includes the effect of rounding the argument.
    """
    steepest = float(np.abs(coefficients[1:]).sum()) / ((end - begin) / 2)
    return _ROUNDING * (max(size, float(np.abs(coefficients).max())) + abs(end) * steepest)


def _check_continuous(begin: float, end: float, values: Array) -> None:
    """Raise InputError if the values in a panel of the narrowest length differ too much."""
    jump = float(np.ptp(values))
    if jump > _JUMP * (1 + float(np.abs(values).min())):
        t = (begin + end) / 2
        raise InputError(f"a drive's rate jumps by {jump:g} rad/s at t = {t:.9g} s; use a ramp")


class HeldCommand:
    """The commands of a controller in a run, each held until the next; a drive before the first.

    Commands are added during the run. Only motors can have such commands, because a prescribed rate
    must not jump.
    """

    # Any: drives.Drive, whose module imports this one.
    def __init__(self, before: Any) -> None:
        self.times: list[float] = []
        self.drives, self.turned = [before], [0.0]  # turned: rad, angle at which each begins
        self.breakpoints = before.breakpoints

    def hold(self, t: float, drive: Any) -> None:
        """Hold another drive from t [s] on. Calls must be in the order of their times."""
        self.turned.append(self.angle(t))
        self.times.append(t)
        self.drives.append(drive)

    # Engines call these functions often, with single times.

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

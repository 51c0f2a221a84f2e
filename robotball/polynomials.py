"""A function of time as polynomials, a panel each: its slope, its area, and where it jumps."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.polynomial import chebyshev

from robotball.errors import InputError
from robotball.rotations import Array

Function = Callable[[float], float]

PANEL = 0.5  # s, the longest
NARROWEST = 1e-9  # s: a panel of that length is not halved again
MOST_HALVES = 500  # of one panel: some ten kinks
JUMP = 1e-4  # of 1 and the value: more within the narrowest panel is no slope but a jump
DEGREE = 24
# The ends are among the nodes, so that neighbours meet and the slope's integral is the function.
NODES = chebyshev.chebpts2(DEGREE + 1)
COEFFICIENTS = np.linalg.inv(chebyshev.chebvander(NODES, DEGREE))
EPS = float(np.finfo(float).eps)
ROUNDING = 8 * EPS  # of the last coefficients of a polynomial that follows


@dataclass(frozen=True)
class Polynomials:
    """A function from edges[0] to edges[-1] by one polynomial between each two edges.

    edges   (n + 1,)  s
    slopes  n         coefficients of the derivative, Chebyshev's, on -1 to 1
    areas   n         of the integral from the panel's begin
    before  (n,)      the integral from edges[0] to the panel's begin
    off     (n,)      how far the polynomial may be off the function
    size              the function's largest value
    """

    edges: Array
    slopes: list[Array]
    areas: list[Array]
    before: Array
    off: Array
    size: float

    def slope(self, t: float) -> float:
        """The derivative at `t`; at an edge, from there on."""
        i, x = self._place(t)
        return float(chebyshev.chebval(x, self.slopes[i]))

    def area(self, t: float) -> float:
        """The integral from edges[0] to `t`."""
        i, x = self._place(t)
        return float(self.before[i] + chebyshev.chebval(x, self.areas[i]))

    def _place(self, t: float) -> tuple[int, float]:
        """The panel of a time, and where it is in it, from -1 to 1."""
        i = int(np.searchsorted(self.edges[1:-1], t, side="right"))
        begin, end = self.edges[i : i + 2]
        return i, float((2 * t - begin - end) / (end - begin))


def polynomials_of(function: Function, edges: list[float]) -> Polynomials:
    """Polynomials that follow a function to rounding, or as near as halving panels brings them.

    edges: increasing times, of which the function is smooth between each two. It is asked there
    and between, never before the first or after the last. Raises InputError where it jumps.
    """
    panels: list[tuple[float, float, Array]] = []
    size = 0.0
    for piece in pairwise(edges):
        count = int(np.ceil((piece[1] - piece[0]) / PANEL))
        for begin, end in pairwise(np.linspace(*piece, count + 1).tolist()):
            for panel in _halved(function, begin, end, size):
                panels.append(panel)
                size = max(size, float(np.abs(panel[2]).max()))
    slopes: list[Array] = []
    areas: list[Array] = []
    off: list[float] = []
    for begin, end, values in panels:
        coefficients, half = COEFFICIENTS @ values, (end - begin) / 2
        off.append(_tail(coefficients))
        # Those of rounding alone would be magnified in the slope by the square of their degree.
        coefficients[np.abs(coefficients) < EPS * size] = 0.0
        slopes.append(np.asarray(chebyshev.chebder(coefficients) / half, dtype=float))
        integral = chebyshev.chebint(coefficients, lbnd=-1.0)
        areas.append(np.asarray(integral * half, dtype=float))
    whole = [float(chebyshev.chebval(1.0, area)) for area in areas]
    return Polynomials(
        edges=np.array([panels[0][0], *(end for _, end, _ in panels)]),
        slopes=slopes,
        areas=areas,
        before=np.cumsum([0.0, *whole[:-1]]),
        off=np.array(off),
        size=size,
    )


def rounding_of(coefficients: Array, begin: float, end: float, size: float) -> float:
    """What rounding leaves of a function of this size in its last coefficients.

    No function knows its argument better than to the last bit.
    """
    steepest = float(np.abs(coefficients[1:]).sum()) / ((end - begin) / 2)
    return ROUNDING * (max(size, float(np.abs(coefficients).max())) + abs(end) * steepest)


def _tail(coefficients: Array) -> float:
    return float(np.abs(coefficients[-3:]).max())


def _halved(
    function: Function, begin: float, end: float, size: float
) -> Iterator[tuple[float, float, Array]]:
    """(begin, end, values at the nodes) of the parts, halved as long as that helps."""
    left, halves = [(begin, end)], 0
    while left:
        a, b = left.pop()
        middle, half = (a + b) / 2, (b - a) / 2
        nodes = np.clip(middle + half * NODES, a, b)
        nodes[0], nodes[-1] = a, b
        values = np.array([function(t) for t in nodes.tolist()])
        coefficients = COEFFICIENTS @ values
        follows = _tail(coefficients) <= rounding_of(coefficients, a, b, size)
        if follows or b - a <= NARROWEST or halves == MOST_HALVES:
            if not follows and b - a <= NARROWEST:
                _check_continuous(a, b, values)
            yield a, b, values
        else:
            halves += 1
            left += [(middle, b), (a, middle)]


def _check_continuous(begin: float, end: float, values: Array) -> None:
    jump = float(np.ptp(values))
    if jump > JUMP * (1 + float(np.abs(values).min())):
        t = (begin + end) / 2
        raise InputError(f"a drive's rate jumps by {jump:g} rad/s at t = {t:.9g} s; ramp it")

"""Branches of solutions as a parameter s varies, computed by pseudo-arclength continuation.

In general, the solutions u of n equations with one parameter form curves. The next point of a curve
is predicted along the tangent t and corrected by Newton's method orthogonally to t, so that folds
need no special treatment (Keller, Numerical solution of bifurcation and nonlinear eigenvalue
problems, 1977). A test function changes sign at each special point, which is then located on the
curve (Seydel, Practical Bifurcation and Stability Analysis, chapters 4 to 7):

*Fold*: the s component of t is zero. *Branch point*: an exponent, or the s component of t, is zero
and a second curve of solutions crosses; this curve is followed as well. *Hopf point*: a pair of
exponents is imaginary. The exponents of a cycle are the logarithms of its multipliers, and a Hopf
point of cycles is a *torus* bifurcation. *Period doubling*: a multiplier is -1. *Drift point*: like
a branch point, but the emerging motions are not solutions: they drift along a symmetry of the
branch's solutions.

s runs from 0 to 1; `motion_branches` maps it to a physical number of a ball.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import pairwise

import numpy as np
from scipy.optimize import brentq

from robotball.errors import InputError
from robotball.rotations import Array

FOLD, BRANCH, DOUBLING, HOPF = "fold", "branch point", "period doubling", "Hopf point"
DRIFT = "drift point"
CLOSES, UNFINISHED = "closes", "not followed to its end"
_KINDS = (FOLD, BRANCH, DOUBLING, HOPF)  # in the order of the test functions
_FIRST_STEP, _LEAST_STEP = 0.01, 1e-7  # step lengths in (u, s)
_BENT = 0.95  # smallest cosine between neighbouring tangents, and between directions to the start
_MOST_POINTS, _MOST_BRANCHES = 1000, 40
_ALIKE = 0.3  # allowed difference of exponents at the closure of a branch, besides their change
_ITERATIONS = 10  # of Newton's method
# A residual that stops falling is accepted below this value: in a cycle that is at rest for long,
# rounding moves the end.
_ROUGH = 1e-7
_DIVERGES = 10.0  # growth of the residual at which Newton's method has failed
_NEUTRAL = 1e-9  # relative to the largest exponent: a smaller real part is rounding
_LEVEL = 1e-7  # of a unit tangent: a smaller s component is rounding
_PARTED = 5.0  # largest distance, divided by e^(1/3), of branches separated by an error e
_TWO_PAIRS = 1e-4  # 1/s, or per period: a larger real part at the root belongs to another pair
_LOCATED = 1e-11  # accuracy of a special point along a step
_SAME = 1e-5  # distance below which two special points, or two solutions at one s, are the same
_APART = 1e-7  # in s, for finite differences
_LINEAR = 1e-4  # residual change below which a central difference is linear
_TINY = 1e-30j  # imaginary step, which has no rounding error


_Residual = Callable[[Array, float], Array]
Linearization = tuple[Array, Array, Callable[[], Array]]
"""Residuals (m,), their derivatives (m, n + 1) by (u, s), and a function for exponents (k,)."""


@dataclass(frozen=True)
class Point:
    """A point x = (u, s) (n + 1,) of a branch with its unit tangent (n + 1,) and exponents (k,).

    kind: the kind of a special point, or "" for another point. free: dimension of the solution set
    transverse to the branch, such as 1 if the ball may be rotated about its axis.
    """

    x: Array
    tangent: Array
    exponents: Array
    kind: str = ""
    free: int = 0

    @property
    def is_stable(self) -> bool:
        """True if no exponent has a positive real part."""
        return bool(_real_parts(self.exponents).max() <= 0)


@dataclass(frozen=True)
class Branch:
    """A curve of solutions; ends: why it stops before its first and after its last point."""

    points: tuple[Point, ...]
    ends: tuple[str, str]

    def special(self, *kinds: str) -> list[Point]:
        """Return the special points of the given kinds, by default of all kinds."""
        return [point for point in self.points if point.kind in (kinds or (*_KINDS, DRIFT))]

    def passes(self, s: float) -> int:
        """Return how often the branch crosses s. None of its points may have this s."""
        above = np.array([point.x[-1] > s for point in self.points])
        return int(np.count_nonzero(above[1:] != above[:-1]))


class Watch:
    """Observer of a search for branches. This base class ignores all events."""

    def seeks(self, s: float, place: int, places: int) -> None:
        """The search for solutions at s begins; it is number `place` of `places`."""

    def grows(self, branch: Branch) -> None:
        """A branch has a new point."""

    def lost(self, s: float, reason: str) -> None:
        """A start at s was given up."""


SILENT = Watch()


@dataclass(frozen=True)
class Problem:
    """Equations in u (n,) and s, at least n of them, whose solutions form the branches.

    Attributes
    ----------
    look : (u, s) -> Linearization
    gauge : (u, s) -> direction (n,) along which the same solution continues, or None
    end : u -> why the branch stops at u, or ""
    identity : index in (u, s) from which on components identify a solution
    watch : receives new points and failed starts
    rank : singular values below this fraction of the largest count as zero
    closed : residual at which another Newton step would gain nothing
    longest : largest step along a branch
    """

    look: Callable[[Array, float], Linearization]
    gauge: Callable[[Array, float], Array] | None = None
    end: Callable[[Array], str] = lambda u: ""
    identity: int = 0
    watch: Watch = SILENT
    rank: float = 1e-9
    closed: float = 1e-13
    longest: float = 0.03

    def rows(self, x: Array) -> Array:
        """Return the unit gauge direction at x = (u, s) as (1, n + 1), or an array (0, n + 1)."""
        if self.gauge is None:
            return np.zeros((0, len(x)))
        direction = np.append(self.gauge(x[:-1], x[-1]), 0.0)
        return direction[None] / np.linalg.norm(direction)


def steady(residual: _Residual, exponents: _Residual, watch: Watch = SILENT) -> Problem:
    """Return the problem of finding zeros of an analytic function; exponents (k,): of a zero."""

    def look(u: Array, s: float) -> Linearization:
        return residual(u, s), derivatives(residual, u, s), lambda: exponents(u, s)

    return Problem(look, watch=watch)


def derivatives(residual: _Residual, u: Array, s: float) -> Array:
    """Return the derivatives (m, n + 1) of an analytic function with respect to u (n,) and s."""
    by_u = residual(u[:, None] + _TINY * np.eye(len(u)), s).imag / _TINY.imag
    return np.column_stack([by_u, by_parameter(residual, u, s)])


def by_parameter(residual: _Residual, u: Array, s: float) -> Array:
    """Return the derivative (m,) with respect to s, from central differences in a linear range."""
    step = _APART
    while np.abs(change := residual(u, s + step) - residual(u, s - step)).max() > _LINEAR:
        step *= _LINEAR
    return change / (2 * step)


def explore(problem: Problem, starts: Iterable[Array], branches: list[Branch]) -> Iterator[Branch]:
    """Yield the branches near the starts x = (u, s) (n + 1,), and the branches that cross them.

    Each branch is appended to `branches`. A start on a known branch is skipped. Starts from which
    Newton's method does not converge are reported to the watch.
    """
    crossed = [point for branch in branches for point in branch.special(BRANCH, DOUBLING)]
    most = len(branches) + _MOST_BRANCHES

    @cache
    def points_near(number: int, s: float) -> list[Point]:
        points = [*branches[number].points]
        for last, new in pairwise(branches[number].points):
            if (last.x[-1] - s) * (new.x[-1] - s) < 0:
                part = (s - last.x[-1]) / (new.x[-1] - last.x[-1])
                points += reached(problem, last.x + part * (new.x - last.x))
        return points

    def is_known(point: Point) -> bool:
        numbers = range(len(branches))
        return any(_same(problem, point, x) for i in numbers for x in points_near(i, point.x[-1]))

    for x in starts:
        if is_known(Point(x, x, np.zeros(0))):
            continue
        corrected_start = reached(problem, x, lost=problem.watch.lost)
        queue = [point for point in corrected_start if not is_known(point)]
        while queue and len(branches) < most:
            branches.append(trace(problem, queue.pop()))
            yield branches[-1]
            for point in branches[-1].special(BRANCH, DOUBLING):
                if not any(_same(problem, point, other) for other in crossed):
                    others = _switched(problem, point)
                    crossed += [point, *others]
                    queue += others


def _same(problem: Problem, one: Point, other: Point) -> bool:
    """Return whether two points are the same up to free directions, such as a heading."""
    apart = np.abs(one.x - other.x)[problem.identity :]
    if not (one.free and other.free):
        return bool(apart.max() < _SAME)
    a, b = (np.sort_complex(point.exponents) for point in (one, other))
    # Points of a surface of solutions: only the period, s and the exponents identify it.
    return bool(apart[-2:].max() < _SAME and np.abs(a - b).max() < _SAME)


def trace(problem: Problem, start: Point) -> Branch:
    """Return the branch through a start, followed in both directions along its tangent."""
    after, last = half(problem, start)
    if last == CLOSES:
        return Branch(tuple(after), (last, last))
    before, first = half(problem, replace(start, tangent=-start.tangent), behind=after)
    return Branch((*before[:0:-1], *after), (first, last))


def half(
    problem: Problem, start: Point, most: int = _MOST_POINTS, behind: Sequence[Point] = ()
) -> tuple[list[Point], str]:
    """Follow a branch from a start along its tangent. Return the points and why it stops.

    behind: the points in the opposite direction, beginning at the start; they are only passed to
    the watch.
    """
    points, step = [start], _FIRST_STEP
    bend = np.zeros(len(start.x))  # derivative of the tangent along the branch
    while len(points) < most:
        last = points[-1]
        if (last.x[-1], np.sign(last.tangent[-1])) in ((0, -1), (1, 1)):
            return points, "the range ends"
        try:
            near = last.x + step * last.tangent + step**2 / 2 * bend
            new = corrected(problem, near, last.tangent)
            if (bound := float(np.clip(new.x[-1], 0, 1))) != new.x[-1]:
                part = (bound - last.x[-1]) / (new.x[-1] - last.x[-1])
                x = np.append((last.x + part * (new.x - last.x))[:-1], bound)
                new = corrected(problem, x)
                new.x[-1] = bound  # exact, because the end of the range is recognized by equality
                new = replace(new, tangent=new.tangent * np.sign(new.tangent @ last.tangent))
            # At a branch point the tangent of the other branch is only approximate.
            bent = new.tangent @ last.tangent < _BENT and (len(points) > 1 or not start.kind)
            special = [] if bent else _between(problem, last, new)
        except ValueError:
            bent = True
        if bent:
            step /= 2
            if step < _LEAST_STEP:
                return points, "Newton's method fails beyond"
            continue
        # A cycle that shrinks to a point re-emerges shifted by half a period.
        if not last.kind and (problem.rows(last.x) * problem.rows(new.x)).sum() < 0:
            return points, "shrinks to a point"
        bend = (new.tangent - last.tangent) / np.linalg.norm(new.x - last.x)
        points += [*special, new]
        problem.watch.grows(Branch((*points[::-1], *behind[1:]), (UNFINISHED, UNFINISHED)))
        if end := problem.end(new.x[:-1]):
            return points, end
        one, other, *away = ((p.x - start.x)[problem.identity :] for p in (last, new, *special))
        between = one @ other < -_BENT * np.linalg.norm(one) * np.linalg.norm(other)
        here, there, now = (np.sort_complex(point.exponents) for point in (start, last, new))
        if between and np.abs(now - here).max() < _ALIKE + np.abs(now - there).max():
            # Special points beyond the start are already among the first points.
            first = len(points) - 1 - len(special)
            before = [point for point, off in zip(special, away, strict=True) if off @ other < 0]
            return [*points[:first], *before, new], CLOSES
        step = min(1.5 * step, problem.longest)
    return points, f"{most} points"


def corrected(problem: Problem, x: Array, across: Array | None = None) -> Point:
    """Return the point of a branch near x (n + 1,), in the plane through x normal to `across`.

    across: (n + 1,), by default the s axis. Raises InputError if Newton's method does not converge.
    """
    start, last = x, np.inf
    rows = np.vstack([problem.rows(x), np.eye(len(x))[-1] if across is None else across])
    for _ in range(_ITERATIONS):
        residual, jacobian, exponents = problem.look(x[:-1], x[-1])
        gap = np.concatenate([residual, rows @ (x - start)])
        sides = np.stack([gap, np.eye(len(gap))[-1]], axis=1)
        solved = np.linalg.lstsq(np.vstack([jacobian, rows]), sides, rcond=problem.rank)
        change, tangent = solved[0].T
        x, size = x - change, np.abs(gap).max()
        if size < problem.closed or last <= size < _ROUGH:
            tangent /= np.linalg.norm(tangent)
            return Point(x, tangent, exponents(), free=len(x) - int(solved[2]))
        if size > _DIVERGES * last:
            break
        last = size
    raise InputError(f"no branch found near the start: Newton's method stopped {size:.1e} away")


def reached(
    problem: Problem,
    x: Array,
    across: Array | None = None,
    lost: Callable[[float, str], None] = SILENT.lost,
) -> list[Point]:
    """Return the point from `corrected` in a list; on failure call `lost`, return an empty list."""
    try:
        return [corrected(problem, x, across)]
    except InputError as error:
        lost(float(x[-1]), str(error))
        return []


def _real_parts(exponents: Array) -> Array:
    real = exponents.real
    return np.where(np.abs(real) < _NEUTRAL * np.abs(exponents).max(), 0.0, real)


def _tests(point: Point, free: int) -> Array:
    """Return the test functions (4,) in the order of `_KINDS`; NaN if there is no complex pair."""
    exponents, real = point.exponents, _real_parts(point.exponents)
    doubled = np.abs(np.abs(exponents.imag) - np.pi) < _NEUTRAL
    # A stroboscopic map has several pairs: take the pair that loses its stability first.
    pair = real[(exponents.imag > 0) & ~doubled]
    along = point.tangent[-1]
    # The product of all exponents that are not always zero, computed as a symmetric function. If a
    # pair of exponents is near the zero exponents, single exponents are accurate only to the cube
    # root of an error.
    others = (real + 1j * exponents.imag)[~doubled]
    product = np.poly(-others)[: len(others) + 1 - free][-1].real if len(others) else 1.0
    across = along if abs(along) > _LEVEL else 0.0
    flips = real[doubled].prod()
    return np.array([across, product, flips, pair.max() if len(pair) else np.nan])


def _between(problem: Problem, last: Point, new: Point) -> list[Point]:
    """Return the special points between two neighbouring points, in order."""
    if last.kind:  # the test functions are zero or undefined
        return []

    whole = float((new.x - last.x) @ last.tangent)
    free = min(last.free, new.free)

    def at(length: float) -> Point:
        near = last.x + length / whole * (new.x - last.x)
        return corrected(problem, near, last.tangent)

    located: list[tuple[float, Point]] = []
    for test, change in enumerate(np.sign(_tests(last, free) * _tests(new, free))):
        if change != -1 or (test == 1 and located):  # at a fold an exponent is zero, too
            continue
        length = brentq(lambda h, i=test: float(_tests(at(h), free)[i]), 0.0, whole, xtol=_LOCATED)
        # The sign may have changed because a different pair became the largest.
        if test == 3 and abs(_tests(at(length), free)[3]) > _TWO_PAIRS:
            continue
        # The tangent at a branch point itself is undetermined.
        part = length / whole
        tangent = (1 - part) * last.tangent + part * new.tangent
        point = replace(at(length), kind=_KINDS[test], tangent=tangent / np.linalg.norm(tangent))
        if test < 2 and _across(problem, point) is not None:
            point = replace(point, kind=BRANCH)
        elif test == 1 and free:
            point = replace(point, kind=DRIFT)
        elif test == 1:  # no other branch crosses
            continue
        located.append((length, point))
    return [point for _, point in sorted(located, key=lambda item: item[0])]


def _across(problem: Problem, point: Point) -> Array | None:
    """Return the direction (n + 1,) of another branch through a point, normal to this branch.

    Returns None if there is no other branch, or if neighbouring points have the same extra
    direction, because then the solutions fill a surface. An error e of the equations separates
    crossing branches by e^(1/3), for example in p x - x³ + e = 0, and leaves a singular value of
    that size. A fold with so small a singular value is recognized because its solutions exist only
    on one side.
    """

    def directions(x: Array, least: float) -> Array:
        rows = (problem.look(x[:-1], x[-1])[1], problem.rows(x), point.tangent)
        _, sizes, vectors = np.linalg.svd(np.vstack(rows))
        return np.asarray(vectors[sizes < least * sizes[0]])

    singular = directions(point.x, _PARTED * problem.closed ** (1 / 3))
    if not len(singular):
        return None
    inwards = np.copysign(_FIRST_STEP, (0.5 - point.x[-1]) * point.tangent[-1])
    beside = reached(problem, point.x + inwards * point.tangent, point.tangent)
    free = [directions(neighbour.x, problem.rank) for neighbour in beside]
    neutral = np.concatenate([singular[:0], *free])
    if len(singular) <= len(neutral):
        return None
    across = np.asarray(np.linalg.svd(neutral @ singular.T)[2][-1] @ singular)
    steps = (sign * _FIRST_STEP * across for sign in (1, -1))
    return across if all(reached(problem, point.x + step, across) for step in steps) else None


def _switched(problem: Problem, point: Point) -> list[Point]:
    """Return a branch point with the other branch's direction as tangent; empty without one."""
    if point.kind == DOUBLING:
        twice = point.x + np.log(2.0) * np.eye(len(point.x))[-2]
        point = replace(point, x=twice, kind=BRANCH)
    across = _across(problem, point)
    return [] if across is None else [replace(point, tangent=across)]

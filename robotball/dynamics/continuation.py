"""Branches of solutions in one parameter, by pseudo-arclength continuation, and what is on them.

A solution u of n equations with one parameter is in general a point of a curve, which turns back
at a fold but has a length and a direction there too. From a point with the tangent t the next one
is predicted along t and corrected by Newton's method across it (Keller, Numerical solution of
bifurcation and nonlinear eigenvalue problems, 1977). Test functions change their sign at special
points, which are located on the curve (Seydel, Practical Bifurcation and Stability Analysis,
chapters 4 to 7):

*Fold*: the parameter's part of t. *Branch point*: another curve of solutions crosses, so that the
equations have two tangents; an exponent, or that part of t, is zero. The other curve is followed
from there, too. *Hopf point*: a pair of imaginary exponents; of a cycle, where the exponents are
the logarithms of its multipliers, a *torus*. *Period doubling*: a multiplier -1. *Drift point*: as
a branch point, but what leaves there is no solution, as it drifts along a freedom that solutions of
the branch have.

The parameter s goes from 0 to 1 here; `motion_branches` says what it stands for in a ball.
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
_KINDS = (FOLD, BRANCH, DOUBLING, HOPF)  # by the test functions, in their order
_FIRST_STEP, _LEAST_STEP = 0.01, 1e-7  # lengths of a step in (u, s)
_BENT = 0.95  # least cosine between neighbours: of tangents, and of ways to a start between them
_MOST_POINTS, _MOST_BRANCHES = 1000, 40
_ALIKE = 0.3  # exponents of neighbours, beside their change, where a branch is back at its start
_ITERATIONS = 10
# Of the residuals, if they fall no more: where a cycle rests for long, rounding moves its end so.
_ROUGH = 1e-7
_DIVERGES = 10.0  # times the residuals before: Newton's method is lost
_NEUTRAL = 1e-9  # of an exponent's size: a real part below it is rounding
_LEVEL = 1e-7  # of a tangent: a part along s below it is rounding
_PARTED = 5.0  # e^(1/3) between branches that cross but for an error e, as far as they are seen to
_TWO_PAIRS = 1e-4  # 1/s, or of a period: a real part of another pair, where one's is zero
_LOCATED = 1e-11  # of a step's length
_SAME = 1e-5  # how near two special points, or two solutions at one s, are one
_APART = 1e-7  # in s, for differences
_LINEAR = 1e-4  # of the residuals: a central difference below it is linear
_TINY = 1e-30j  # of an imaginary step, which has no rounding


_Residual = Callable[[Array, float], Array]
Look = tuple[Array, Array, Callable[[], Array]]
"""Residuals (m,), their derivatives (m, n + 1) by u and s, and what returns exponents (k,)."""


@dataclass(frozen=True)
class Point:
    """A point x = (u, s) (n + 1,) of a branch, with the tangent (n + 1,) and exponents (k,) there.

    kind: of a special point; else ""; free: in how many ways solutions go on beside the branch, as
    where a ball may be turned about its own axis.
    """

    x: Array
    tangent: Array
    exponents: Array
    kind: str = ""
    free: int = 0

    @property
    def is_stable(self) -> bool:
        """Whether no exponent has a positive real part."""
        return bool(_real_parts(self.exponents).max() <= 0)


@dataclass(frozen=True)
class Branch:
    """A curve of solutions; ends: why it is followed no further, before and after the points."""

    points: tuple[Point, ...]
    ends: tuple[str, str]

    def special(self, *kinds: str) -> list[Point]:
        """Return its special points of some kinds, or of all."""
        return [point for point in self.points if point.kind in (kinds or (*_KINDS, DRIFT))]

    def passes(self, s: float) -> int:
        """Return how often it passes an s that is none of its points'."""
        above = np.array([point.x[-1] > s for point in self.points])
        return int(np.count_nonzero(above[1:] != above[:-1]))


class Watch:
    """Is told what a search for branches does. This one is silent."""

    def seeks(self, s: float, place: int, places: int) -> None:
        """Solutions are sought at s next, at one of so many places."""

    def grows(self, branch: Branch) -> None:
        """A branch has a new point."""

    def lost(self, s: float, reason: str) -> None:
        """What was begun at s is given up."""


SILENT = Watch()


@dataclass(frozen=True)
class Problem:
    """Equations of u (n,) and s, whose zeros make the branches; they may be more than n.

    look: what is seen of them at u and s; gauge: a direction (n,) in which the same solution goes
    on; end: why a branch is followed no further than u, or ""; identity: the part of (u, s) by
    which a solution is recognised; watch: is told of points and of lost starts; rank: of the
    largest singular value of the derivatives, what is less is zero; closed: residuals from which a
    step of Newton's method leaves none; longest: of a step along a branch.
    """

    look: Callable[[Array, float], Look]
    gauge: Callable[[Array, float], Array] | None = None
    end: Callable[[Array], str] = lambda u: ""
    identity: int = 0
    watch: Watch = SILENT
    rank: float = 1e-9
    closed: float = 1e-13
    longest: float = 0.03

    def rows(self, x: Array) -> Array:
        """Return the gauge at x = (u, s) as (1, n + 1), or (0, n + 1)."""
        if self.gauge is None:
            return np.zeros((0, len(x)))
        direction = np.append(self.gauge(x[:-1], x[-1]), 0.0)
        return direction[None] / np.linalg.norm(direction)


def steady(residual: _Residual, exponents: _Residual, watch: Watch = SILENT) -> Problem:
    """Return the problem of an analytic function's zeros, with the exponents (k,) at each."""

    def look(u: Array, s: float) -> Look:
        return residual(u, s), derivatives(residual, u, s), lambda: exponents(u, s)

    return Problem(look, watch=watch)


def derivatives(residual: _Residual, u: Array, s: float) -> Array:
    """Return the derivatives (m, n + 1) of an analytic function (m, ...) by u (n, ...) and s."""
    by_u = residual(u[:, None] + _TINY * np.eye(len(u)), s).imag / _TINY.imag
    return np.column_stack([by_u, by_parameter(residual, u, s)])


def by_parameter(residual: _Residual, u: Array, s: float) -> Array:
    """Return the derivative (m,) of a function by s, from differences small enough to be linear."""
    step = _APART
    while np.abs(change := residual(u, s + step) - residual(u, s - step)).max() > _LINEAR:
        step *= _LINEAR
    return change / (2 * step)


def explore(problem: Problem, starts: Iterable[Array], branches: list[Branch]) -> Iterator[Branch]:
    """Yield the branches through starts (n + 1,) near (u, s), and those that cross them.

    They are added to `branches`. A start on one of these is not followed again. The watch is told
    of one from which Newton's method does not converge.
    """
    crossed = [point for each in branches for point in each.special(BRANCH, DOUBLING)]
    most = len(branches) + _MOST_BRANCHES

    @cache
    def passed(number: int, s: float) -> list[Point]:
        """Return a branch's points, and those that it has at s."""
        found = [*branches[number].points]
        for last, new in pairwise(branches[number].points):
            if (last.x[-1] - s) * (new.x[-1] - s) < 0:
                part = (s - last.x[-1]) / (new.x[-1] - last.x[-1])
                found += reached(problem, last.x + part * (new.x - last.x))
        return found

    def is_known(point: Point) -> bool:
        numbers = range(len(branches))
        return any(_same(problem, point, x) for i in numbers for x in passed(i, point.x[-1]))

    for x in starts:
        if is_known(Point(x, x, np.zeros(0))):
            continue
        begun = reached(problem, x, lost=problem.watch.lost)
        queue = [point for point in begun if not is_known(point)]
        while queue and len(branches) < most:
            branches.append(trace(problem, queue.pop()))
            yield branches[-1]
            for point in branches[-1].special(BRANCH, DOUBLING):
                if not any(_same(problem, point, other) for other in crossed):
                    others = _switched(problem, point)
                    crossed += [point, *others]
                    queue += others


def _same(problem: Problem, one: Point, other: Point) -> bool:
    """Return whether two points are one, or one but for what is free there, as a heading."""
    apart = np.abs(one.x - other.x)[problem.identity :]
    if not (one.free and other.free):
        return bool(apart.max() < _SAME)
    a, b = (np.sort_complex(point.exponents) for point in (one, other))
    # Both may be anywhere on a surface, on which a period and exponents are the same.
    return bool(apart[-2:].max() < _SAME and np.abs(a - b).max() < _SAME)


def trace(problem: Problem, start: Point) -> Branch:
    """Return the branch through a start, both ways from it along its tangent."""
    after, last = half(problem, start)
    if last == CLOSES:
        return Branch(tuple(after), (last, last))
    before, first = half(problem, replace(start, tangent=-start.tangent), behind=after)
    return Branch((*before[:0:-1], *after), (first, last))


def half(
    problem: Problem, start: Point, most: int = _MOST_POINTS, behind: Sequence[Point] = ()
) -> tuple[list[Point], str]:
    """Return the points from a start on along its tangent, and why there are no more.

    behind: those the other way, from the start on, which are told of with these.
    """
    points, step = [start], _FIRST_STEP
    bend = np.zeros(len(start.x))  # the change of the tangent along the branch
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
                new.x[-1] = bound  # to the last bit, by which it is known to be the end
                new = replace(new, tangent=new.tangent * np.sign(new.tangent @ last.tangent))
            # Where two branches cross, the other one is not quite across.
            bent = new.tangent @ last.tangent < _BENT and (len(points) > 1 or not start.kind)
            special = [] if bent else _between(problem, last, new)
        except ValueError:
            bent = True
        if bent:
            step /= 2
            if step < _LEAST_STEP:
                return points, "Newton's method converges no further"
            continue
        # A cycle that has shrunk to a point comes out of it half a period later.
        if not last.kind and (problem.rows(last.x) * problem.rows(new.x)).sum() < 0:
            return points, "shrinks to a point"
        bend = (new.tangent - last.tangent) / np.linalg.norm(new.x - last.x)
        points += [*special, new]
        problem.watch.grows(Branch((*points[::-1], *behind[1:]), (UNFINISHED, UNFINISHED)))
        if end := problem.end(new.x[:-1]):
            return points, end
        one, other, *away = (
            (point.x - start.x)[problem.identity :] for point in (last, new, *special)
        )
        between = one @ other < -_BENT * np.linalg.norm(one) * np.linalg.norm(other)
        here, there, now = (np.sort_complex(each.exponents) for each in (start, last, new))
        if between and np.abs(now - here).max() < _ALIKE + np.abs(now - there).max():
            # What is special beyond the start is among the first points already.
            first = len(points) - 1 - len(special)
            before = [point for point, off in zip(special, away, strict=True) if off @ other < 0]
            return [*points[:first], *before, new], CLOSES
        step = min(1.5 * step, problem.longest)
    return points, f"{most} points"


def corrected(problem: Problem, x: Array, across: Array | None = None) -> Point:
    """Return the point of a branch near x (n + 1,), in the plane through x across a direction.

    That is along s if none is given. Raises InputError where Newton's method does not converge.
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
    raise InputError(f"no branch found near a start: Newton's method leaves {size:.1e}")


def reached(
    problem: Problem,
    x: Array,
    across: Array | None = None,
    lost: Callable[[float, str], None] = SILENT.lost,
) -> list[Point]:
    """Return the point that `corrected` finds, or nothing, which `lost` is told."""
    try:
        return [corrected(problem, x, across)]
    except InputError as error:
        lost(float(x[-1]), str(error))
        return []


def _real_parts(exponents: Array) -> Array:
    """Return real parts (k,), without rounding."""
    real = exponents.real
    return np.where(np.abs(real) < _NEUTRAL * np.abs(exponents).max(), 0.0, real)


def _tests(point: Point, free: int) -> Array:
    """Return the test functions (4,), by `_KINDS`; NaN where there is no pair.

    free: in how many ways solutions go on beside the branch.
    """
    exponents, real = point.exponents, _real_parts(point.exponents)
    doubled = np.abs(np.abs(exponents.imag) - np.pi) < _NEUTRAL
    # Of several pairs, as of a stroboscopic map, the first to lose its stability.
    pair = real[(exponents.imag > 0) & ~doubled]
    along = point.tangent[-1]
    # The product of all but those that are zero everywhere, as a symmetric function: where a pair
    # meets these, each is the cube root of an error.
    others = (real + 1j * exponents.imag)[~doubled]
    product = np.poly(-others)[: len(others) + 1 - free][-1].real if len(others) else 1.0
    across = along if abs(along) > _LEVEL else 0.0
    flips = real[doubled].prod()
    return np.array([across, product, flips, pair.max() if len(pair) else np.nan])


def _between(problem: Problem, last: Point, new: Point) -> list[Point]:
    """Return the special points between two neighbours, in their order."""
    if last.kind:  # where the test functions are zero, or are not known
        return []

    whole = float((new.x - last.x) @ last.tangent)
    free = min(last.free, new.free)

    def at(length: float) -> Point:
        near = last.x + length / whole * (new.x - last.x)
        return corrected(problem, near, last.tangent)

    found: list[tuple[float, Point]] = []
    for test, change in enumerate(np.sign(_tests(last, free) * _tests(new, free))):
        if change != -1 or (test == 1 and found):  # an exponent is zero at a fold, too
            continue
        length = brentq(lambda h, i=test: float(_tests(at(h), free)[i]), 0.0, whole, xtol=_LOCATED)
        # Of pairs, another one may have taken its place.
        if test == 3 and abs(_tests(at(length), free)[3]) > _TWO_PAIRS:
            continue
        # At a branch point its own tangent is not determined.
        part = length / whole
        tangent = (1 - part) * last.tangent + part * new.tangent
        point = replace(at(length), kind=_KINDS[test], tangent=tangent / np.linalg.norm(tangent))
        if test < 2 and _across(problem, point) is not None:
            point = replace(point, kind=BRANCH)
        elif test == 1 and free:
            point = replace(point, kind=DRIFT)
        elif test == 1:  # nothing leaves there
            continue
        found.append((length, point))
    return [point for _, point in sorted(found, key=lambda each: each[0])]


def _across(problem: Problem, point: Point) -> Array | None:
    """Return the other direction (n + 1,) in which solutions go on from a point, across its own.

    One in which they go on from the points beside it, too, is none: it fills a surface. An error e
    of the equations parts two branches that cross, as it does p x - x³ + e, by e^(1/3), and leaves
    a singular value of that size. Where a fold has one as small, there are solutions on one side
    of its s alone.
    """

    def directions(x: Array, least: float) -> Array:
        rows = (problem.look(x[:-1], x[-1])[1], problem.rows(x), point.tangent)
        _, sizes, found = np.linalg.svd(np.vstack(rows))
        return np.asarray(found[sizes < least * sizes[0]])

    found = directions(point.x, _PARTED * problem.closed ** (1 / 3))
    if not len(found):
        return None
    inwards = np.copysign(_FIRST_STEP, (0.5 - point.x[-1]) * point.tangent[-1])
    beside = reached(problem, point.x + inwards * point.tangent, point.tangent)
    neutral = np.concatenate([found[:0], *(directions(each.x, problem.rank) for each in beside)])
    if len(found) <= len(neutral):
        return None
    across = np.asarray(np.linalg.svd(neutral @ found.T)[2][-1] @ found)
    steps = (sign * _FIRST_STEP * across for sign in (1, -1))
    return across if all(reached(problem, point.x + step, across) for step in steps) else None


def _switched(problem: Problem, point: Point) -> list[Point]:
    """Return a branch point with the tangent of the other branch, as far as it is across its own.

    Of a period doubling: of the cycle run through twice. None where there is no other branch.
    """
    if point.kind == DOUBLING:
        twice = point.x + np.log(2.0) * np.eye(len(point.x))[-2]
        point = replace(point, x=twice, kind=BRANCH)
    across = _across(problem, point)
    return [] if across is None else [replace(point, tangent=across)]

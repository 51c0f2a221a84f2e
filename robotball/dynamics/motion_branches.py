"""Branches of a ball's motions in one number of it: fixed points, straight lines, cycles.

Solutions are sought among γ from rest, M = 0, and else among γ and μ = M/√f, in principal axes.
Their flow keeps γ² = 1, μ² = 1 and (μ, γ) = c/√f. It stands still at the fixed points of (4.1) and
on the straight lines of section 5.1. Of a cycle the unknowns are a start and ln T, with the period
T, which may grow without bound. It is closed in the direction of time in which phase volume
shrinks: the other loses all digits.

Where a branch of cycles ends so, ds/d(ln T) ~ T^-1/p for a period that grows as |s - s*|^-p. By
Seydel, chapter 7, p is 1/2 where a saddle and a node come together on the cycle; at a saddle the
period grows as ln |s - s*| only, and p tends to 0.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from robotball.dynamics import continuation as co
from robotball.dynamics.cycles import Cycle, by_turn, level_vectors, monodromy_of, multipliers_of
from robotball.dynamics.equilibria import attitude_at, fixed_points
from robotball.dynamics.families import NUMBERS, numbers_of, varied
from robotball.dynamics.normal_forms import Flow, flow_near, linear_part, lyapunov_value
from robotball.dynamics.portraits import reversed_in_time
from robotball.dynamics.straight_motions import straight_verticals
from robotball.errors import InputError
from robotball.robot import formulas as eq
from robotball.robot.formulas import Parameters, as_vector
from robotball.robot.scene import along_momentum
from robotball.rotations import Array, tangents
from robotball.theory.ensembles.orbits import angular_velocity, orbits

ENDLESS = "its period passes"
_TINY = 1e-300  # beside a multiplier that is zero by rounding
_PHASES = 400  # of a cycle, to start from
_SPAN = 0.3  # in ln T: between the points by which the growth of a period is measured
_LOGARITHM = 0.3  # a power below it is falling to 0
# Values within the range at which fixed points are sought, in 40 ms each, and straight lines, in
# 0.2 ms: closed branches of lines have been seen as short as a hundredth of a range.
_POINTS, _LINES = 20, 2000
_GOLDEN = (np.sqrt(5.0) - 1) / 2
_Found = TypeVar("_Found")


class Range:
    """A number `name` that goes from low to high as s goes from 0 to 1."""

    name: str
    low: float
    high: float

    @property
    def label(self) -> tuple[str, str]:
        """The number as it is written, and its unit."""
        raise NotImplementedError

    @property
    def own(self) -> float:
        """The number as it is where nothing is changed."""
        raise NotImplementedError

    def value(self, s: float) -> float:
        """Return the number at s."""
        return self.low + s * (self.high - self.low)

    def at(self, s: float) -> tuple[Any, ...]:
        """Return what moves at s, with the unit of M [kg m²/s]."""
        raise NotImplementedError

    def places(self, inside: int) -> list[float]:
        """Return where solutions are sought: both ends, the ball's own number, `inside` between."""
        own = float((self.own - self.low) / (self.high - self.low))
        # The golden section keeps off the middle and other round numbers, where a ball may have a
        # symmetry and its solutions coincide.
        between = (np.arange(inside) + _GOLDEN) / inside
        return [0.0, 1.0, *[own] * (0 < own < 1), *between]


@dataclass(frozen=True)
class Family(Range):
    """A ball and its world momentum (3,); s from 0 to 1 is `name` of NUMBERS from low to high."""

    parameters: Parameters
    momentum: Array
    name: str
    low: float
    high: float

    @property
    def label(self) -> tuple[str, str]:
        """The number as it is written, and its unit."""
        return NUMBERS[self.name]

    @property
    def own(self) -> float:
        """The ball's own number."""
        return numbers_of(self.parameters, self.momentum)[self.name]

    def at(self, s: float) -> tuple[Parameters, float, float]:
        """Return the ball, √f [kg m²/s] and c/√f at s."""
        parameters, M = varied(self.parameters, self.momentum, {self.name: self.value(s)})
        size = float(np.linalg.norm(M))
        return parameters, size, float(M[2] / size) if size else 0.0

    def rate(self, u: Array, s: float) -> Array:
        """Return the rates (3k, ...) of γ and μ [1/s] at u (n, ...)."""
        parameters, size, _ = self.at(s)
        v = vectors_of(u)
        M = size * v[1] if len(v) > 1 else np.zeros(3)
        omega = parameters.angular_velocity(tuple(M), tuple(v[0]))
        return np.concatenate([eq.cross(each, omega) for each in v])

    def constants(self, u: Array, s: float) -> Array:
        """Return what is zero on the level: γ² - 1 and, where M ≠ 0, μ² - 1 and (μ, γ) - c/√f."""
        gamma, *mu = v = vectors_of(u)
        return np.stack(
            [*(v * v).sum(axis=1) - 1, *((m * gamma).sum(axis=0) - self.at(s)[2] for m in mu)]
        )

    def flow(self, u: Array, s: float) -> tuple[Flow, int]:
        """Return the flow near u, and how many coordinates it has."""
        parameters, size, _ = self.at(s)
        gamma, *mu = vectors_of(u)
        return flow_near(parameters, gamma, *(size * m for m in mu)), 2 + len(mu)


def vectors_of(u: Array) -> Array:
    """Return γ, or γ and μ, (k, 3, ...) of a solution u (n, ...)."""
    return u[: len(u) // 3 * 3].reshape(-1, 3, *u.shape[1:])


def sought(
    family: Range,
    inside: int,
    found: Callable[..., Iterable[_Found]],
    watch: co.Watch = co.SILENT,
) -> Iterator[tuple[list[_Found], float]]:
    """Yield all that is found at each of the family's places, until it raises, with its s.

    Raises InputError for a number that the ball cannot have, and where every place raises it, as
    where solutions fill curves. At some places two may be about to coincide: the watch is told.
    """
    refused = []
    for place, s in enumerate(places := family.places(inside), 1):
        watch.seeks(s, place, len(places))
        ball, some = family.at(s), list[_Found]()
        try:
            some.extend(found(*ball))
        except InputError as error:
            refused += [error] * (not some)
            watch.lost(s, str(error))
        yield some, s
    if len(refused) == len(places):
        raise refused[0]


def resting(family: Family, watch: co.Watch = co.SILENT) -> Iterator[co.Branch]:
    """Yield the branches of fixed points from rest, or of straight lines where M ≠ 0.

    They are all that there are at the family's places, and what crosses them.
    """

    def residual(u: Array, s: float) -> Array:
        return np.concatenate([family.rate(u, s), family.constants(u, s)])

    def exponents(u: Array, s: float) -> Array:
        return np.linalg.eigvals(linear_part(*family.flow(u, s))).astype(complex)

    def found(parameters: Parameters, size: float, c: float) -> list[Array]:
        if not size:
            return [point.gamma for point in fixed_points(parameters)]
        still = straight_verticals(parameters, size * size, c * size)
        momenta = [parameters.momentum((0.0, 0.0, 0.0), as_vector(gamma)) for gamma in still]
        return [np.append(g, np.array(M) / size) for g, M in zip(still, momenta, strict=True)]

    problem = co.steady(residual, exponents, watch)
    branches: list[co.Branch] = []
    inside = _LINES if family.momentum.any() else _POINTS
    for some, s in sought(family, inside, found, watch):
        starts = [np.append(u, s) for u in some]
        # Most have been passed, which is known without a correction.
        if len(starts) != sum(each.passes(s) for each in branches):
            yield from co.explore(problem, starts, branches)


def cycling(
    family: Family,
    starts: Iterable[tuple[Cycle, float]],
    longest: float,
    born: Iterable[co.Point] = (),
    watch: co.Watch = co.SILENT,
) -> Iterator[co.Branch]:
    """Yield the branches of given cycles, each with its s, and of those born at Hopf points.

    longest: the period beyond which none is followed [s]. A cycle is on one of the branches alone.
    """
    branches: list[co.Branch] = []

    def through(x: Array, multipliers: Array) -> Iterator[co.Branch]:
        problem = _closing(family, _repels(multipliers), longest, watch)
        yield from co.explore(problem, [x], branches)

    for cycle, s in starts:
        ball, M = family.at(s)[0], cycle.momentum
        if _repels(cycle.multipliers):
            ball, M = reversed_in_time(ball), -M
        # Where the motion is slowest, an error of the start changes the period least.
        times = np.linspace(0.0, cycle.period, _PHASES)
        along = orbits(ball, cycle.attitude[None], M[None], times).attitudes[0]
        levels = [level_vectors(each, cycle.momentum).ravel() for each in along]
        u = min(levels, key=lambda u: float(np.linalg.norm(family.rate(u, s))))
        yield from through(np.array([*u, np.log(cycle.period), s]), cycle.multipliers)
    for hopf in born:
        for first in born_cycles(family, hopf, longest)[1].points[1:2]:
            yield from through(first.x, np.exp(first.exponents))


def _repels(multipliers: Array) -> bool:
    """Whether phase volume grows along a cycle."""
    return float(np.abs(multipliers).prod()) > 1


def born_cycles(
    family: Family, hopf: co.Point, longest: float, most: int = 3
) -> tuple[float, co.Branch]:
    """Return the first Lyapunov value at a Hopf point [1/s], and `most` of the cycles born there.

    The first point of their branch is the Hopf point; longest: as for `cycling`.
    """
    u, s = hopf.x[:-1], hopf.x[-1]
    flow, size = family.flow(u, s)
    values, vectors = np.linalg.eig(linear_part(flow, size))
    i = int(np.argmax(values.imag))
    out = vectors[:, i].real @ (tangents(u) if size == 2 else by_turn(vectors_of(u)).T)
    x = np.array([*u, np.log(2 * np.pi / values[i].imag), s])
    tangent = np.array([*out, 0.0, 0.0]) / np.linalg.norm(out)
    start = co.Point(x, tangent, np.full(1, np.inf), co.HOPF)  # the multipliers do not matter
    points, end = co.half(_closing(family, float(values.real.sum()) > 0, longest), start, most)
    return lyapunov_value(flow, size), co.Branch(tuple(points), (co.HOPF, end))


def _logarithms(monodromy: Array, volume: float, momentum: Array) -> Array:
    """Return the logarithms (k,) of the multipliers; at M = 0 the volume's alone."""
    if not momentum.any():
        return np.array([volume], dtype=complex)
    return np.asarray(np.log(multipliers_of(monodromy, volume, momentum) + _TINY))


def _closing(
    family: Family, backwards: bool, longest: float, watch: co.Watch = co.SILENT
) -> co.Problem:
    """Return the problem of motions that end where they start, backwards in time or not."""

    def begin(u: Array, s: float) -> tuple[Parameters, Array, Array]:
        """Return the ball, the attitude (4,) and the world momentum (3,) on the level, near u."""
        ball, size, c = family.at(s)
        gamma, *mu = vectors_of(u)
        gamma = gamma / np.linalg.norm(gamma)
        attitude, M = attitude_at(gamma), np.zeros(3)
        for m in mu:
            start = along_momentum(gamma, size * (m - (m @ gamma - c) * gamma))
            attitude, M = start.attitude, start.momentum
        return (reversed_in_time(ball), attitude, -M) if backwards else (ball, attitude, M)

    def reached(u: Array, s: float) -> Array:
        """Return the vectors (3k,) after a period, less those before."""
        ball, attitude, M = begin(u, s)
        times = np.array([0.0, np.exp(u[-1])])
        first, last = orbits(ball, attitude[None], M[None], times).attitudes[0]
        return (level_vectors(last, M) - level_vectors(first, M)).ravel()

    def look(u: Array, s: float) -> co.Look:
        ball, attitude, M = begin(u, s)
        period = float(np.exp(u[-1]))
        end, monodromy, volume = monodromy_of(ball, attitude, M, period)
        before, after = level_vectors(attitude, M), level_vectors(end, M)
        closing = by_turn(after) @ monodromy - by_turn(before)
        columns = (
            closing @ np.linalg.pinv(by_turn(vectors_of(u))),
            period * by_turn(after) @ angular_velocity(ball, end, M),
            co.by_parameter(reached, u, s),
        )
        return (
            np.concatenate([(after - before).ravel(), family.constants(u, s)]),
            np.vstack([np.column_stack(columns), co.derivatives(family.constants, u, s)]),
            lambda: (-1 if backwards else 1) * _logarithms(monodromy, volume, M),
        )

    def end(u: Array) -> str:
        return f"{ENDLESS} {longest:g} s" if np.exp(u[-1]) > longest else ""

    return co.Problem(look, lambda u, s: np.append(family.rate(u, s), 0.0), end, -2, watch)


def growth(points: Sequence[co.Point]) -> tuple[float, float]:
    """Return s* and p of a period that grows as |s - s*|^-p along the last of the points.

    p is 0 where it grows as ln |s - s*|.
    """
    last = points[-1]
    before = [each for each in points if each.x[-2] < last.x[-2] - _SPAN]
    ends = (before[-1] if before else points[0], last)
    T = np.exp([each.x[-2] for each in ends])
    slopes = np.array([each.tangent[-1] / each.tangent[-2] for each in ends])
    p = float(np.log(T[1] / T[0]) / np.log(slopes[0] / slopes[1]))
    if p > _LOGARITHM:
        return float(last.x[-1] + p * slopes[1]), p
    rates = slopes / T  # which fall exponentially
    return float(last.x[-1] + rates[1] * (T[1] - T[0]) / np.log(rates[0] / rates[1])), 0.0

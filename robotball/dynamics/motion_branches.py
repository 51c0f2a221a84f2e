"""Branches of fixed points, straight lines and cycles as one number of the ball varies.

The unknowns are γ for motions from rest (M = 0), otherwise γ and μ = M/√f, in principal axes. For
cycles ln T is unknown too, because the period T may grow without bound. A cycle is integrated in
the direction of time in which phase volume shrinks, because the other direction loses all digits.

If the period grows as T ~ |s - s*|^-p at the end of a branch, then ds/d(ln T) ~ T^(-1/p). By
Seydel, chapter 7, p = 1/2 if a saddle and a node merge on the cycle. If the cycle approaches a
saddle, the period grows only as ln |s - s*|, and p tends to 0.

(3.2) and (3.3) are linear in (K, Ω, M): scaling all three by s gives the same motion, s times as
fast.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from robotball.dynamics import continuation as co
from robotball.dynamics.cycles import (
    Cycle,
    by_turn,
    level_vectors,
    monodromy_of,
    multipliers_of,
    reversed_in_time,
)
from robotball.dynamics.equilibria import (
    Flow,
    attitude_at,
    fixed_points,
    flow_near,
    linear_part,
    lyapunov_value,
)
from robotball.dynamics.straight_motions import straight_verticals
from robotball.errors import InputError, unknown
from robotball.robot import formulas as eq
from robotball.robot.formulas import Parameters, Rolling, as_vector
from robotball.robot.scene import along_momentum
from robotball.rotations import Array, tangents
from robotball.theory.ensembles.orbits import angular_velocity, orbits

ENDLESS = "its period passes"
_TINY = 1e-300  # added to multipliers, which may be zero by rounding
_PHASES = 400  # points of a cycle, to choose a start from
_SPAN = 0.3  # distance in ln T of the two points that measure the growth of a period
_LOGARITHM = 0.3  # an exponent p below this means logarithmic growth
# Numbers of interior values of s at which fixed points (40 ms each) and straight lines (0.2 ms
# each) are searched for. Closed branches of lines can be as short as a hundredth of the range.
_POINTS, _LINES = 20, 2000
_GOLDEN = (np.sqrt(5.0) - 1) / 2
_Solution = TypeVar("_Solution")
# Name: (symbol, unit). K1 to Omega3 are components along principal axes. K and Omega are lengths of
# vectors: a varied vector keeps its direction, or reverses it if the length is negative.
NUMBERS = {
    **{f"K{i}": (f"K{sub}", "kg m²/s") for i, sub in zip("123", "₁₂₃", strict=True)},
    **{f"Omega{i}": (f"Ω{sub}", "rad/s") for i, sub in zip("123", "₁₂₃", strict=True)},
    "K": ("|K|", "kg m²/s"),
    "Omega": ("|Ω|", "rad/s"),
    "f": ("f = M²", "(kg m²/s)²"),
    "c": ("c = (M, γ)", "kg m²/s"),
    # Angles in the plane of two principal axes; the length of the projection is kept.
    **{
        f"{vector}{plane}": (f"angle of ({symbol}{i}, {symbol}{j})", "degrees")
        for vector, symbol in (("K", "K"), ("Omega", "Ω"))
        for plane, i, j in (("12", "₁", "₂"), ("23", "₂", "₃"), ("31", "₃", "₁"))
    },
}
_PLANES = {"12": [0, 1], "23": [1, 2], "31": [2, 0]}


def numbers_of(parameters: Parameters, momentum: Array) -> dict[str, float]:
    """Return all `NUMBERS` of a ball with momentum (3,) kg m²/s, world."""
    K, Omega = parameters.K, parameters.Omega
    lengths = (np.linalg.norm(K), np.linalg.norm(Omega), momentum @ momentum, momentum[2])
    angles = (np.degrees(np.arctan2(v[j], v[i])) for v in (K, Omega) for i, j in _PLANES.values())
    return dict(zip(NUMBERS, map(float, (*K, *Omega, *lengths, *angles)), strict=True))


def varied(
    parameters: Parameters, momentum: Array, changes: Mapping[str, float]
) -> tuple[Parameters, Array]:
    """Return the ball and its world momentum (3,) with the named numbers changed.

    The horizontal direction of M is kept. Raises InputError for an unknown name, for the length of
    a zero vector, for a nonzero c in the rubber model, and if f <= c².
    """
    vectors = {"K": np.array(parameters.K), "Omega": np.array(parameters.Omega)}
    level = {"f": float(momentum @ momentum), "c": float(momentum[2])}
    for name, value in changes.items():
        if name not in NUMBERS:
            raise unknown("number", name, NUMBERS)
        if name in level:
            level[name] = value
        elif name[-2:] in _PLANES:
            v, plane, turn = vectors[name[:-2]], _PLANES[name[-2:]], np.radians(value)
            v[plane] = np.hypot(*v[plane]) * np.array([np.cos(turn), np.sin(turn)])
        elif name not in vectors:
            vectors[name[:-1]][int(name[-1]) - 1] = value
        elif length := float(np.linalg.norm(vectors[name])):
            vectors[name] *= value / length
        else:
            raise InputError(f"{name} = 0 has no direction: vary {name}1, {name}2 or {name}3")
    K, Omega = map(as_vector, vectors.values())
    if level.keys() & changes.keys():  # otherwise M may be zero
        momentum = momentum_across(parameters.rolling, momentum, **level)
    return replace(parameters, K=K, Omega=Omega), momentum


def momentum_across(rolling: Rolling, momentum: Array, f: float, c: float) -> Array:
    """Return the world M (3,) with f = M², c = (M, γ) and the heading of `momentum`."""
    if rolling == "rubber" and c != 0:
        raise InputError(f"c must be 0 in the rubber model (equation (3.1)), not {c:g}: vary f")
    across = float(np.hypot(*momentum[:2]))
    if not (f > c * c and across > 0):
        raise InputError(
            f"no initial state has c = (M, γ) = {c:g} and f = M² = {f:g}: c² must be below f, and "
            "the scene's M must be neither vertical nor zero"
        )
    return np.array([*(momentum[:2] * (np.sqrt(f - c * c) / across)), c])


class Range:
    """A number `name` that varies linearly from low to high as s goes from 0 to 1."""

    name: str
    low: float
    high: float

    @property
    def label(self) -> tuple[str, str]:
        """Symbol and unit of the number."""
        raise NotImplementedError

    @property
    def nominal(self) -> float:
        """The unmodified ball's value of the number."""
        raise NotImplementedError

    def value(self, s: float) -> float:
        """Return the value at s."""
        return self.low + s * (self.high - self.low)

    def at(self, s: float) -> tuple[Any, ...]:
        """Return the ball and its level at s, with the unit of M in kg m²/s."""
        raise NotImplementedError

    def places(self, inside: int) -> list[float]:
        """Return the s to search at: both ends, the unmodified ball's s, and `inside` others."""
        nominal = float((self.nominal - self.low) / (self.high - self.low))
        # The golden ratio avoids round numbers, at which a ball may be symmetric and solutions
        # coincide.
        between = (np.arange(inside) + _GOLDEN) / inside
        return [0.0, 1.0, *[nominal] * (0 < nominal < 1), *between]


@dataclass(frozen=True)
class Family(Range):
    """A ball and its world momentum (3,) with the number `name` of NUMBERS from low to high."""

    parameters: Parameters
    momentum: Array
    name: str
    low: float
    high: float

    @property
    def label(self) -> tuple[str, str]:
        """Symbol and unit of the number."""
        return NUMBERS[self.name]

    @property
    def nominal(self) -> float:
        """The unmodified ball's value of the number."""
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
        return np.concatenate([eq.cross(vector, omega) for vector in v])

    def constants(self, u: Array, s: float) -> Array:
        """Return γ² - 1 and, if M ≠ 0, μ² - 1 and (μ, γ) - c/√f, all zero on the level."""
        gamma, *mu = v = vectors_of(u)
        along = ((m * gamma).sum(axis=0) - self.at(s)[2] for m in mu)
        return np.stack([*(v * v).sum(axis=1) - 1, *along])

    def flow(self, u: Array, s: float) -> tuple[Flow, int]:
        """Return the flow near u and its number of coordinates."""
        parameters, size, _ = self.at(s)
        gamma, *mu = vectors_of(u)
        return flow_near(parameters, gamma, *(size * m for m in mu)), 2 + len(mu)


def vectors_of(u: Array) -> Array:
    """Return γ, or γ and μ, as (k, 3, ...) of an unknown u (n, ...)."""
    return u[: len(u) // 3 * 3].reshape(-1, 3, *u.shape[1:])


def sought(
    family: Range,
    inside: int,
    solve: Callable[..., Iterable[_Solution]],
    watch: co.Watch = co.SILENT,
) -> Iterator[tuple[list[_Solution], float]]:
    """Yield each solution at each s of the family, and s; an InputError ends the search at its s.

    The watch receives such errors, for example if two solutions nearly coincide. Raises InputError
    if the ball cannot have the number, and if every s fails without a solution, for example because
    solutions fill curves.
    """
    errors = []
    for place, s in enumerate(places := family.places(inside), 1):
        watch.seeks(s, place, len(places))
        ball, solutions = family.at(s), list[_Solution]()
        try:
            solutions.extend(solve(*ball))
        except InputError as error:
            errors += [error] * (not solutions)
            watch.lost(s, str(error))
        yield solutions, s
    if len(errors) == len(places):
        raise errors[0]


def resting(family: Family, watch: co.Watch = co.SILENT) -> Iterator[co.Branch]:
    """Yield the branches of fixed points from rest or, if M ≠ 0, of straight lines.

    The branches pass through all solutions at the searched values of s, or cross such a branch.
    """

    def residual(u: Array, s: float) -> Array:
        return np.concatenate([family.rate(u, s), family.constants(u, s)])

    def exponents(u: Array, s: float) -> Array:
        return np.linalg.eigvals(linear_part(*family.flow(u, s))).astype(complex)

    def solve(parameters: Parameters, size: float, c: float) -> list[Array]:
        if not size:
            return [point.gamma for point in fixed_points(parameters)]
        verticals = straight_verticals(parameters, size * size, c * size)
        momenta = [parameters.momentum((0.0, 0.0, 0.0), as_vector(gamma)) for gamma in verticals]
        return [np.append(g, np.array(M) / size) for g, M in zip(verticals, momenta, strict=True)]

    problem = co.steady(residual, exponents, watch)
    branches: list[co.Branch] = []
    inside = _LINES if family.momentum.any() else _POINTS
    for solutions, s in sought(family, inside, solve, watch):
        starts = [np.append(u, s) for u in solutions]
        # If the counts are equal, all solutions are on known branches, and none must be corrected.
        if len(starts) != sum(branch.passes(s) for branch in branches):
            yield from co.explore(problem, starts, branches)


def cycling(
    family: Family,
    starts: Iterable[tuple[Cycle, float]],
    longest: float,
    born: Iterable[co.Point] = (),
    watch: co.Watch = co.SILENT,
) -> Iterator[co.Branch]:
    """Yield the branches of the given cycles, each with its s, and of cycles born at Hopf points.

    longest: the longest period that is followed [s]. Each cycle is on one yielded branch only.
    """
    branches: list[co.Branch] = []

    def through(x: Array, multipliers: Array) -> Iterator[co.Branch]:
        problem = _closing(family, _repels(multipliers), longest, watch)
        yield from co.explore(problem, [x], branches)

    for cycle, s in starts:
        ball, M = family.at(s)[0], cycle.momentum
        if _repels(cycle.multipliers):
            ball, M = reversed_in_time(ball), -M
        # Start at the slowest point of the cycle, where an error affects the period least.
        times = np.linspace(0.0, cycle.period, _PHASES)
        along = orbits(ball, cycle.attitude[None], M[None], times).attitudes[0]
        levels = [level_vectors(attitude, cycle.momentum).ravel() for attitude in along]
        u = min(levels, key=lambda u: float(np.linalg.norm(family.rate(u, s))))
        yield from through(np.array([*u, np.log(cycle.period), s]), cycle.multipliers)
    for hopf in born:
        for first in born_cycles(family, hopf, longest)[1].points[1:2]:
            yield from through(first.x, np.exp(first.exponents))


def _repels(multipliers: Array) -> bool:
    return float(np.abs(multipliers).prod()) > 1


def born_cycles(
    family: Family, hopf: co.Point, longest: float, most: int = 3
) -> tuple[float, co.Branch]:
    """Return the first Lyapunov value at a Hopf point [1/s] and the first cycles born there.

    The branch has at most `most` points, and the first one is the Hopf point. longest: as in
    `cycling`.
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
    """Return the logarithms (k,) of the multipliers; if M = 0, only the volume's."""
    if not momentum.any():
        return np.array([volume], dtype=complex)
    return np.asarray(np.log(multipliers_of(monodromy, volume, momentum) + _TINY))


def _closing(
    family: Family, backwards: bool, longest: float, watch: co.Watch = co.SILENT
) -> co.Problem:
    """Return the problem of closing motions, integrated backwards in time or not."""

    def begin(u: Array, s: float) -> tuple[Parameters, Array, Array]:
        """Return the ball, the attitude (4,) and world momentum (3,) nearest to u on the level."""
        ball, size, c = family.at(s)
        gamma, *mu = vectors_of(u)
        gamma = gamma / np.linalg.norm(gamma)
        attitude, M = attitude_at(gamma), np.zeros(3)
        for m in mu:
            start = along_momentum(gamma, size * (m - (m @ gamma - c) * gamma))
            attitude, M = start.attitude, start.momentum
        return (reversed_in_time(ball), attitude, -M) if backwards else (ball, attitude, M)

    def reached(u: Array, s: float) -> Array:
        """Return the change (3k,) of the level vectors over a period."""
        ball, attitude, M = begin(u, s)
        times = np.array([0.0, np.exp(u[-1])])
        first, last = orbits(ball, attitude[None], M[None], times).attitudes[0]
        return (level_vectors(last, M) - level_vectors(first, M)).ravel()

    def look(u: Array, s: float) -> co.Linearization:
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
    """Return s* and p of the growth T ~ |s - s*|^-p at the last point; p = 0 if logarithmic."""
    last = points[-1]
    before = [point for point in points if point.x[-2] < last.x[-2] - _SPAN]
    ends = (before[-1] if before else points[0], last)
    T = np.exp([point.x[-2] for point in ends])
    slopes = np.array([point.tangent[-1] / point.tangent[-2] for point in ends])
    p = float(np.log(T[1] / T[0]) / np.log(slopes[0] / slopes[1]))
    if p > _LOGARITHM:
        return float(last.x[-1] + p * slopes[1]), p
    rates = slopes / T  # the slopes decay exponentially
    return float(last.x[-1] + rates[1] * (T[1] - T[0]) / np.log(rates[0] / rates[1])), 0.0

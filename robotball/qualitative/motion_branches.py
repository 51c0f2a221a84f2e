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

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from robotball.engines.ensembles.orbits import angular_velocity
from robotball.equations import Parameters
from robotball.qualitative.continuation import (
    Branch,
    Look,
    Point,
    Problem,
    by_parameter,
    derivatives,
    explore,
    steady,
    trace,
)
from robotball.qualitative.cycles import Cycle, level_vectors, monodromy_of, multipliers_of
from robotball.qualitative.equilibria import attitude_at, fixed_points
from robotball.qualitative.families import varied
from robotball.qualitative.normal_forms import Flow, flow_near, linear_part, lyapunov_value
from robotball.qualitative.portraits import reversed_in_time
from robotball.qualitative.straight_motions import straight_motions
from robotball.rotations import Array, tangents
from robotball.scene import along_momentum

ANGLES = [f"{vector}{axes}" for vector in ("K", "Omega") for axes in ("12", "23", "31")]
_TINY = 1e-300  # beside a multiplier that is zero by rounding
_SPAN = 0.3  # in ln T: between the points by which the growth of a period is measured


@dataclass(frozen=True)
class Family:
    """A ball and its world momentum (3,), with the number `name` going from low to high.

    name: of `families.NUMBERS`, or of ANGLES: the angle [degrees] of the part of K or Ω in the
    plane of two principal axes, from the first.
    """

    parameters: Parameters
    momentum: Array
    name: str
    low: float
    high: float

    def value(self, s: float) -> float:
        """Return the number at s, 0 at low and 1 at high."""
        return self.low + s * (self.high - self.low)

    def at(self, s: float) -> tuple[Parameters, float, float]:
        """Return the ball, √f [kg m²/s] and c/√f at s."""
        changes = {self.name: self.value(s)}
        if self.name in ANGLES:
            name, i, j = self.name[:-2], *self.name[-2:]
            v, turn = getattr(self.parameters, name), np.radians(self.value(s))
            size = np.hypot(v[int(i) - 1], v[int(j) - 1])
            changes = {f"{name}{i}": size * np.cos(turn), f"{name}{j}": size * np.sin(turn)}
        parameters, momentum = varied(self.parameters, self.momentum, changes)
        size = float(np.linalg.norm(momentum))
        return parameters, size, float(momentum[2] / size) if size else 0.0

    def rate(self, u: Array, s: float) -> Array:
        """Return the rates (3k,) of γ and μ [1/s]."""
        parameters, size, _ = self.at(s)
        v = vectors_of(u)
        M = size * v[1] if len(v) > 1 else np.zeros(3)
        return np.cross(v, parameters.angular_velocity(tuple(M), tuple(v[0]))).ravel()

    def constants(self, u: Array, s: float) -> Array:
        """Return what is zero on the level: γ² - 1 and, where M ≠ 0, μ² - 1 and (μ, γ) - c/√f."""
        gamma, *mu = v = vectors_of(u)
        return np.concatenate([(v * v).sum(axis=1) - 1, [m @ gamma - self.at(s)[2] for m in mu]])

    def flow(self, u: Array, s: float) -> tuple[Flow, int]:
        """Return the flow near u, and how many coordinates it has."""
        parameters, size, _ = self.at(s)
        gamma, *mu = vectors_of(u)
        return flow_near(parameters, gamma, *(size * m for m in mu)), 2 + len(mu)


def vectors_of(u: Array) -> Array:
    """Return γ, or γ and μ, (k, 3) of a solution."""
    return u[: len(u) // 3 * 3].reshape(-1, 3)


def resting(family: Family) -> list[Branch]:
    """Return the branches of fixed points from rest, or of straight lines where M ≠ 0.

    They are all that there are at both ends of the range, and what crosses them.
    """

    def residual(u: Array, s: float) -> Array:
        return np.concatenate([family.rate(u, s), family.constants(u, s)])

    def exponents(u: Array, s: float) -> Array:
        return np.linalg.eigvals(linear_part(*family.flow(u, s))).astype(complex)

    starts = []
    for s in (0.0, 1.0):
        parameters, size, c = family.at(s)
        if size:
            lines = straight_motions(parameters, size * size, c * size)
            found = [np.concatenate([line.gamma, line.momentum / size]) for line in lines]
        else:
            found = [point.gamma for point in fixed_points(parameters)]
        starts += [np.append(u, s) for u in found]
    return explore(steady(residual, exponents), starts)


def cycling(family: Family, starts: Sequence[tuple[Cycle, float]], longest: float) -> list[Branch]:
    """Return the branches of given cycles, each with its s, up to a period of `longest` [s]."""
    branches: list[Branch] = []
    for cycle, s in starts:
        u = np.append(level_vectors(cycle.attitude, cycle.momentum), np.log(cycle.period))
        problem = _closing(family, float(np.abs(cycle.multipliers).prod()) > 1, longest)
        branches += explore(problem, [np.append(u, s)], branches)
    return branches


def born_cycles(family: Family, hopf: Point, longest: float) -> tuple[float, Branch]:
    """Return the first Lyapunov value at a Hopf point [1/s], and the cycles that are born there."""
    u, s = hopf.x[:-1], hopf.x[-1]
    flow, size = family.flow(u, s)
    values, vectors = np.linalg.eig(linear_part(flow, size))
    i = int(np.argmax(values.imag))
    basis = tangents(u) if size == 2 else _turning(vectors_of(u)).T
    out = vectors[:, i].real @ basis
    x = np.array([*u, np.log(2 * np.pi / values[i].imag), s])
    start = replace(hopf, x=x, tangent=np.array([*out, 0.0, 0.0]) / np.linalg.norm(out))
    problem = _closing(family, float(values.real.sum()) > 0, longest)
    return lyapunov_value(flow, size), trace(problem, start)


def _turning(vectors: Array) -> Array:
    """Return the linear map (3k, 3) from a small turn of the frame to vectors (k, 3) seen in it."""
    return np.concatenate([np.cross(v, np.eye(3)).T for v in vectors])


def _closing(family: Family, backwards: bool, longest: float) -> Problem:
    """Return the problem of motions that end where they start, followed backwards in time or not."""

    def start(u: Array, s: float) -> tuple[Parameters, Array, Array]:
        """Return the ball, the attitude (4,) and the world momentum (3,) on the level, near u."""
        parameters, size, c = family.at(s)
        gamma, *mu = vectors_of(u)
        gamma = gamma / np.linalg.norm(gamma)
        attitude, momentum = attitude_at(gamma), np.zeros(3)
        for m in mu:
            across = m - (m @ gamma) * gamma
            across *= np.sqrt(1 - c * c) / np.linalg.norm(across)
            begin = along_momentum(gamma, size * (across + c * gamma))
            attitude, momentum = begin.attitude, begin.momentum
        if backwards:
            parameters, momentum = reversed_in_time(parameters), -momentum
        return parameters, attitude, momentum

    def gap(u: Array, s: float) -> Array:
        parameters, attitude, momentum = start(u, s)
        end = monodromy_of(parameters, attitude, momentum, float(np.exp(u[-1])))[0]
        return (level_vectors(end, momentum) - level_vectors(attitude, momentum)).ravel()

    def look(u: Array, s: float) -> Look:
        parameters, attitude, momentum = start(u, s)
        period = float(np.exp(u[-1]))
        end, monodromy, volume = monodromy_of(parameters, attitude, momentum, period)
        before, after = level_vectors(attitude, momentum), level_vectors(end, momentum)
        by_turn = _turning(after) @ monodromy - _turning(before)
        by_log_period = period * _turning(after) @ angular_velocity(parameters, end, momentum)
        columns = (
            by_turn @ np.linalg.pinv(_turning(vectors_of(u))),
            by_log_period[:, None],
            by_parameter(gap, u, s)[:, None],
        )
        exponents = np.array([volume], dtype=complex)
        if momentum.any():
            exponents = np.log(multipliers_of(monodromy, volume, momentum) + _TINY)
        return (
            np.concatenate([(after - before).ravel(), family.constants(u, s)]),
            np.vstack([np.hstack(columns), derivatives(family.constants, u, s)]),
            -exponents if backwards else exponents,
        )

    def ended(u: Array) -> str:
        return f"its period passes {longest:g} s" if np.exp(u[-1]) > longest else ""

    def gauge(u: Array, s: float) -> Array:
        return np.append(family.rate(u, s), 0.0)

    return Problem(look, gauge, ended, identity=-2)


def growth(points: Sequence[Point]) -> tuple[float, float]:
    """Return s* and p of a period that grows as |s - s*|^-p along the last of the points."""
    last = points[-1]
    first = next(each for each in reversed(points) if each.x[-2] < last.x[-2] - _SPAN)
    slopes = [each.tangent[-1] / each.tangent[-2] for each in (first, last)]
    p = (last.x[-2] - first.x[-2]) / np.log(slopes[0] / slopes[1])
    return float(last.x[-1] + p * slopes[1]), float(p)

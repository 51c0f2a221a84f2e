"""Limit cycles of the motion from rest, section 4: found by returns to an arc, then closed.

A closed orbit C of (4.1) parts the sphere in two. The flow is the same at γ and -γ, so -C is one,
too, and by Brouwer's theorem a side of C that held its own opposite would hold a γ = -γ. So either
C = -C, and any point is parted by it from its opposite, or C and -C bound two sides without common
points, each with a fixed point of index 1 whose opposite is in the other. Either way C crosses the
half of a great circle from some fixed point of index 1 to its opposite: the cycles are where an
orbit that starts on such an arc comes back to where it started.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from robotball import equations as eq
from robotball.engines.reduced.compiled.flatten import LANES
from robotball.engines.reduced.compiled.kernels import orbit, orbits
from robotball.errors import InputError
from robotball.parameters import Parameters, as_vector
from robotball.qualitative.cycles import Cycle, close
from robotball.qualitative.equilibria import (
    FixedPoint,
    attitude_at,
    fixed_points,
    flow,
    rate_scale,
    tangents,
)
from robotball.rotations import Array, from_matrix, rotation_matrix
from robotball.threads import in_chunks

NO_MOMENTUM = np.zeros(3)
SAMPLES = 4000  # of a closed curve
STRIDE = 0.1  # rad, at most, between two samples of an orbit that is to come back
TOLERANCE = 1e-9  # of a step of it
NOISE = 1e-6  # rad: what the returns may be off by, between samples STRIDE apart
FIRST_LOOK = 6  # part of the time after which those near a sink are left out
KEPT = 0.03  # of a sink: what is that near stays
HALVINGS = 24  # of a stride
CLOSER = 16  # starts between two neighbours
AT_REST = 1e-6  # of the flow's rates: a cycle that slow is a fixed point
# Of a multiplier from 1: an orbit round a centre closes, too.
HYPERBOLIC = 1e-5


def limit_cycles(parameters: Parameters, longest: float = 200.0, starts: int = 64) -> list[Cycle]:
    """The limit cycles of (4.1), stable and unstable, with periods up to `longest` [s].

    One of each pair C, -C. From `starts` points of each arc orbits are followed until they come
    back: of two cycles that cross it between neighbouring points neither is found. Raises
    InputError for a classical ball, and where fixed points are not isolated.
    """
    if parameters.rolling != "rubber":
        raise InputError("(4.1) is the rubber model's: M = 0 has no classical counterpart")
    cycles: list[Cycle] = []
    curves: list[Array] = []
    points = fixed_points(parameters)
    centres = of_index_one(points)
    # A cycle is closed in the direction of time in which it attracts: the other loses all digits.
    for ball, sense in ((parameters, 1), (reversed_in_time(parameters), -1)):
        sinks = sinks_of(points, sense)
        # Two arcs each: where one has a cycle close to the end of what comes back, another has not.
        for arc in (Arc(gamma, side) for gamma in centres for side in tangents(gamma)):
            for gamma, period in returning(ball, arc, longest, starts, sinks):
                if any(lies_on(sign * gamma, curve) for curve in curves for sign in (1, -1)):
                    continue
                cycle = closed(ball, gamma, period)
                if cycle is None or cycle.period > longest:
                    continue
                if any(lies_on(sign * cycle.gamma, curve) for curve in curves for sign in (1, -1)):
                    continue
                cycles.append(replace(cycle, multipliers=cycle.multipliers**sense))
                curves.append(curve_of(ball, cycle.gamma, cycle.period))
    return cycles


def of_index_one(points: list[FixedPoint]) -> list[Array]:
    """γ (3,) of the fixed points of index 1, one of each pair ±γ."""
    found: list[Array] = []
    for point in points:
        if point.kind not in ("saddle", "degenerate") and not any(
            np.abs(point.gamma + known).max() < 1e-6 for known in found
        ):
            found.append(point.gamma)
    return found


@dataclass(frozen=True)
class Arc:
    """Half a great circle: cos s `centre` + sin s `across`, 0 < s < π, of two unit vectors (3,)."""

    centre: Array
    across: Array

    def at(self, angles: Array) -> Array:
        """Its points (n, 3) at angles s (n,)."""
        return np.outer(np.cos(angles), self.centre) + np.outer(np.sin(angles), self.across)

    def attitudes(self, angles: Array) -> Array:
        """Some attitudes (n, 4) with these verticals."""
        gamma = self.at(angles)
        normal = np.broadcast_to(np.cross(self.centre, self.across), gamma.shape)
        return from_matrix(np.stack([normal, np.cross(gamma, normal), gamma], axis=1))


def sinks_of(points: list[FixedPoint], sense: int) -> Array:
    """γ (m, 3) of the nodes and foci that attract, for the flow back in time if sense is -1."""
    found = [
        point.gamma
        for point in points
        if point.kind in ("stable node", "stable focus", "unstable node", "unstable focus")
        and sense * point.eigenvalues.real.sum() < 0
    ]
    return np.array(found).reshape(-1, 3)


def returning(
    parameters: Parameters,
    arc: Arc,
    longest: float,
    starts: int,
    sinks: Array,
    part: tuple[float, float] = (0.0, np.pi),
) -> Iterator[tuple[Array, float]]:
    """Where attracting cycles cross a part of an arc: γ (3,) near each, and about its period [s].

    There the return falls behind the start. As orbits do not cross each other, returns keep their
    order as long as they go on continuously: a fall by more than the starts are apart is a jump.
    At a jump, or where the last of the starts comes back, it is looked closer, once.
    """
    apart = (part[1] - part[0]) / starts
    angles = np.linspace(*part, 2 * starts + 1)[1::2]
    ahead, times = first_returns(parameters, arc, angles, longest, sinks)
    gap = ahead - angles
    gap[np.abs(gap) < NOISE] = 0.0
    fall = gap[:-1] - gap[1:]
    for i in range(starts - 1):
        if np.abs(fall[i]) <= apart + NOISE:  # and not NaN
            if gap[i] >= 0 >= gap[i + 1] and fall[i] > 0:
                at = np.array([angles[i] + gap[i] / fall[i] * apart])
                yield arc.at(at)[0], float(times[i])
        elif part == (0.0, np.pi) and min(abs(gap[i]), abs(gap[i + 1])) < 2 * apart:
            between = float(angles[i]), float(angles[i + 1])
            yield from returning(parameters, arc, longest, CLOSER, sinks, between)


def first_returns(
    parameters: Parameters, arc: Arc, angles: Array, longest: float, sinks: Array
) -> tuple[Array, Array]:
    """At which angles (n,) orbits from angles (n,) on an arc come back to it, crossing it the same
    way, and when [s]; NaN where they do not within `longest`.

    sinks (m, 3): fixed points that keep what comes near; most of those that never return end there.
    """
    back, when, ends = returns_within(parameters, arc, angles, longest / FIRST_LOOK)
    kept = (ends @ sinks.T > 1 - KEPT**2 / 2).any(axis=1)
    late = np.flatnonzero(np.isnan(back) & ~kept)
    if len(late):
        back[late], when[late], _ = returns_within(parameters, arc, angles[late], longest)
    return back, when


def returns_within(
    parameters: Parameters, arc: Arc, angles: Array, longest: float
) -> tuple[Array, Array, Array]:
    """The same, whatever becomes of those that do not return; and the last γ (n, 3)."""
    back, when, ends = (np.empty((len(angles), *each)) for each in ((), (), (3,)))

    def find(some: slice) -> None:
        back[some], when[some], ends[some] = _returns_of(parameters, arc, angles[some], longest)

    in_chunks(find, len(angles), LANES)
    return back, when, ends


def _returns_of(
    parameters: Parameters, arc: Arc, angles: Array, longest: float
) -> tuple[Array, Array, Array]:
    """The same for some of them, between samples by cubics through values and rates."""
    n, places, normal = len(angles), arc.at(angles), np.cross(arc.centre, arc.across)
    times = np.linspace(0.0, longest, 2 + int(longest * rate_scale(parameters) / STRIDE))
    found = orbits(parameters, arc.attitudes(angles), np.zeros((n, 3)), times, TOLERANCE)
    w, x, y, z = np.moveaxis(found.attitudes, -1, 0)
    gamma = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=-1)
    height, side = gamma @ normal, gamma @ arc.across
    height[:, 0] = 0.0  # but for rounding, which is no crossing
    way = np.sign(np.stack(flow(parameters, tuple(places.T)), axis=1) @ normal)
    passed = (height[:, :-1] * way[:, None] < 0) & (height[:, 1:] * way[:, None] >= 0)
    passed &= side[:, 1:] > 0
    at = passed.argmax(axis=1)
    lane = np.arange(n)
    first, last, step = gamma[lane, at], gamma[lane, at + 1], times[1] - times[0]
    rates = [step * np.stack(flow(parameters, tuple(end.T)), axis=1) for end in (first, last)]

    def between(part: Array) -> Array:
        u = part[:, None]
        return np.asarray(
            first * (1 + 2 * u) * (1 - u) ** 2
            + rates[0] * u * (1 - u) ** 2
            + last * (3 - 2 * u) * u * u
            - rates[1] * (1 - u) * u * u
        )

    low, high = np.zeros(n), np.ones(n)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        before = between(middle) @ normal * way < 0
        low, high = np.where(before, middle, low), np.where(before, high, middle)
    point = between((low + high) / 2)
    back = passed.any(axis=1) & (found.status == 0)
    angle = np.arctan2(point @ arc.across, point @ arc.centre)
    when = times[at] + low * step
    return np.where(back, angle, np.nan), np.where(back, when, np.nan), gamma[:, -1]


def closed(parameters: Parameters, gamma: Array, period: float) -> Cycle | None:
    """The cycle that passes near γ (3,) with about this period [s], if there is one."""
    try:
        cycle = close(parameters, attitude_at(gamma), NO_MOMENTUM, period)
    except InputError:
        return None
    # A fixed point, too, is where it was after any time.
    rate = np.linalg.norm(flow(parameters, as_vector(cycle.gamma)))
    moves = rate > AT_REST * rate_scale(parameters)
    return cycle if moves and abs(cycle.multipliers[0] - 1) > HYPERBOLIC else None


def reversed_in_time(parameters: Parameters) -> Parameters:
    """The ball that goes through the motions backwards: ω is linear in M, K and Ω together."""
    return replace(
        parameters, Omega=eq.scale(-1.0, parameters.Omega), K=eq.scale(-1.0, parameters.K)
    )


def curve_of(parameters: Parameters, gamma: Array, period: float) -> Array:
    """γ (SAMPLES, 3) over a period from γ (3,)."""
    times = np.linspace(0.0, period, SAMPLES)
    return rotation_matrix(orbit(parameters, attitude_at(gamma), NO_MOMENTUM, times)[0])[:, 2]


def lies_on(gamma: Array, curve: Array) -> bool:
    """Whether γ (3,) is as near to a closed curve (n, 3) as its samples are to each other."""
    spacing = np.linalg.norm(np.diff(curve, axis=0), axis=1).max()
    return bool(np.linalg.norm(curve - gamma, axis=1).min() < spacing)


def spread_points(count: int) -> Array:
    """Points (count, 3) spread evenly over the unit sphere, along Fibonacci's spiral."""
    i = np.arange(count) + 0.5
    z, turn = 1 - 2 * i / count, np.pi * (3 - np.sqrt(5)) * i
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)

"""The phase portrait of motion from rest (4.1): limit cycles and separatrices.

With M = 0 chaos is impossible: on the sphere every motion ends at a fixed point or on a cycle. The
fixed points are those of `equilibria`.

*Limit cycles* are found by returns to an arc, then closed by Newton's method. A closed orbit C of
(4.1) parts the sphere in two. The flow is the same at γ and -γ, so -C is one, too, and by Brouwer's
theorem a side of C that held its own opposite would hold a γ = -γ. So either C = -C, and any point
is parted by it from its opposite, or C and -C bound two sides without common points, each with a
fixed point of index 1 whose opposite is in the other. Either way C crosses the half of a great
circle from some fixed point of index 1 to its opposite: the cycles are where an orbit that starts
on such an arc comes back to where it started.

*Separatrices* are the stable and unstable manifolds of the saddles.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from robotball.dynamics.cycles import Cycle, close
from robotball.dynamics.equilibria import (
    FixedPoint,
    attitude_at,
    fixed_points,
    flow,
    jacobian,
    rate_scale,
)
from robotball.dynamics.sections import crossings
from robotball.errors import InputError
from robotball.robot import formulas as eq
from robotball.robot.ball import Value
from robotball.robot.formulas import Parameters, as_vector
from robotball.robot.scene import sample_times
from robotball.rotations import Array, from_matrix, on_circle, rotation_matrix, tangents
from robotball.theory.ensembles.orbits import Starts, components, orbit, orbits
from robotball.theory.ensembles.steppers import ARC

_NO_MOMENTUM = np.zeros(3)
_SAMPLES = 4000  # of a closed curve: neighbours are some 2e-3 apart
_RETURN_TOLERANCE = 1e-9  # of a step of an orbit that is to come back
_NOISE = 1e-6  # rad: what the returns may be off by, after many such steps
_CLOSER = 16  # starts between two neighbours, where the return jumps
_AT_REST = 1e-6  # of the flow's rates: a cycle that slow is a fixed point
_SAME = 1e-6  # of unit vectors: two cycles so near are one
# Of a multiplier from 1: an orbit round a centre closes, too.
_HYPERBOLIC = 1e-5
# Of the first point from the saddle: the manifold leaves its tangent by the square of it.
_OFFSET = 1e-4
_REACHED = 0.02  # of a fixed point: a manifold that ends that near to it ends there
_INTERVAL = 0.05  # s, at most, between two samples


def limit_cycles(parameters: Parameters, longest: float = 200.0, starts: int = 64) -> list[Cycle]:
    """Find the limit cycles of (4.1), stable and unstable, with periods to `longest` [s].

    One of each pair C, -C. From `starts` points of each arc orbits are followed until they come
    back: of two cycles that cross it between neighbouring points neither is found. Raises
    InputError for a classical ball, and where fixed points are not isolated.
    """
    cycles: list[Cycle] = []
    curves: list[Array] = []
    points = fixed_points(parameters)
    centres = _of_index_one(points)

    def known(gamma: Array) -> bool:
        return any(_lies_on(sign * gamma, curve) for curve in curves for sign in (1, -1))

    # A cycle is closed in the direction of time in which it attracts: the other loses all digits.
    for ball, sense in ((parameters, 1), (reversed_in_time(parameters), -1)):
        # Two arcs each: where one has a cycle close to the end of what comes back, another has not.
        for arc in (np.stack([gamma, side]) for gamma in centres for side in tangents(gamma)):
            for gamma, period in _returning(ball, arc, longest, starts):
                # Asked before, to save closing it, and after, when a point of it is exact.
                if known(gamma) or (cycle := closed(ball, gamma, period)) is None:
                    continue
                if cycle.period > longest or known(cycle.gamma):
                    continue
                # Backwards in time a multiplier is its inverse.
                cycles.append(replace(cycle, multipliers=cycle.multipliers**sense))
                curves.append(curve_of(ball, cycle.gamma, cycle.period))
    return cycles


def _of_index_one(points: list[FixedPoint]) -> list[Array]:
    """Return γ (3,) of the fixed points of index 1, one of each pair ±γ."""
    found: list[Array] = []
    for point in points:
        if point.kind not in ("saddle", "degenerate") and not any(
            np.abs(point.gamma + known).max() < 1e-6 for known in found
        ):
            found.append(point.gamma)
    return found


def _returning(
    parameters: Parameters,
    arc: Array,
    longest: float,
    starts: int,
    part: tuple[float, float] = (0.0, np.pi),
) -> Iterator[tuple[Array, float]]:
    """Yield γ (3,) near where attracting cycles cross a part of an arc, and periods [s].

    arc (2, 3): the half of the great circle through two unit vectors from the first by the second
    to the first's opposite, 0 < ψ < π of `on_circle`; part: of it, by ψ.

    There the return falls behind the start. As orbits do not cross each other, returns keep their
    order as long as they go on continuously: a fall by more than the starts are apart is a jump.
    At a jump, or where the last of the starts comes back, it is looked closer, once.
    """
    apart = (part[1] - part[0]) / starts
    # The middles of equal pieces: the ends of an arc are fixed points, from which nothing returns.
    angles = np.linspace(*part, 2 * starts + 1)[1::2]
    ahead, times = _first_returns(parameters, arc, angles, longest)
    gap = ahead - angles
    gap[np.abs(gap) < _NOISE] = 0.0
    fall = gap[:-1] - gap[1:]
    for i in range(starts - 1):
        if np.abs(fall[i]) <= apart + _NOISE:  # and not NaN
            if gap[i] >= 0 >= gap[i + 1] and fall[i] > 0:
                yield on_circle(arc, angles[i] + gap[i] / fall[i] * apart), float(times[i])
        elif part == (0.0, np.pi) and min(abs(gap[i]), abs(gap[i + 1])) < 2 * apart:
            between = float(angles[i]), float(angles[i + 1])
            yield from _returning(parameters, arc, longest, _CLOSER, between)


def _first_returns(
    parameters: Parameters, arc: Array, angles: Array, longest: float
) -> tuple[Array, Array]:
    """Return the angles (n,) at which orbits from angles (n,) of an arc come back, and when [s].

    They cross the arc the same way as they started; NaN where they do not within `longest`.
    """
    (centre, across), gamma = arc, on_circle(arc, angles)
    normal = np.cross(centre, across)
    # Any turn about the vertical would do: with M = 0 it changes nothing.
    first = np.broadcast_to(normal, gamma.shape)
    attitudes = from_matrix(np.stack([first, np.cross(gamma, first), gamma], axis=1))
    way = np.sign(normal @ np.stack(flow(parameters, tuple(gamma.T))))
    starts = Starts(parameters, attitudes, np.zeros_like(gamma))
    numbers = np.concatenate([np.outer(way, normal), np.tile(across, (len(way), 1))], axis=1)
    times, states, *_ = crossings(starts, ARC, numbers, 1, 1, _RETURN_TOLERANCE, longest)
    back = np.stack(eq.space_axes(components(states[:, 0]))[2], axis=-1)
    return np.arctan2(back @ across, back @ centre), times[:, 0]


def closed(parameters: Parameters, gamma: Array, period: float) -> Cycle | None:
    """Return the cycle near γ (3,) with about this period [s] or half of it, or None.

    Half: an orbit may pass the end of an arc once, and come back to the arc the second time.
    """
    cycle = _closed(parameters, gamma, period)
    if cycle is None:
        return None
    # Newton's method from half the period finds the same cycle only where that is the period.
    half = _closed(parameters, cycle.gamma, cycle.period / 2)
    same = half is not None and np.linalg.norm(half.gamma - cycle.gamma) < _SAME
    return half if same else cycle


def _closed(parameters: Parameters, gamma: Array, period: float) -> Cycle | None:
    try:
        cycle = close(parameters, attitude_at(gamma), _NO_MOMENTUM, period)
    except InputError:
        return None
    # A fixed point, too, is where it was after any time.
    rate = np.linalg.norm(flow(parameters, as_vector(cycle.gamma)))
    moves = rate > _AT_REST * rate_scale(parameters)
    return cycle if moves and abs(cycle.multipliers[0] - 1) > _HYPERBOLIC else None


def reversed_in_time(parameters: Parameters) -> Parameters:
    """Return the ball that moves backwards in time: ω is linear in M, K and Ω together."""
    return replace(
        parameters, Omega=eq.scale(-1.0, parameters.Omega), K=eq.scale(-1.0, parameters.K)
    )


def curve_of(parameters: Parameters, gamma: Array, period: float) -> Array:
    """Return γ (_SAMPLES, 3) over a period from γ (3,)."""
    times = np.linspace(0.0, period, _SAMPLES)
    return rotation_matrix(orbit(parameters, attitude_at(gamma), _NO_MOMENTUM, times)[:, :4])[:, 2]


def involute(gamma: Array) -> Array:
    """Return the unrolled sphere's coordinates φ, γ₃ (..., 2) of points γ (..., 3) [rad, -].

    φ = π/4 + arctan(γ₁/γ₂), from 0 to 2π, as in the paper's Figs 6 to 8. The map preserves areas.
    In a line γ (n, 3) φ is NaN where it jumps by 2π, so that no segment is drawn across.
    """
    phi = (np.pi / 4 + np.arctan2(gamma[..., 0], gamma[..., 1])) % (2 * np.pi)
    if phi.ndim:
        phi[1:][np.abs(np.diff(phi)) > np.pi] = np.nan
    return np.stack([phi, gamma[..., 2]], axis=-1)


def _lies_on(gamma: Array, curve: Array) -> bool:
    """Return whether γ (3,) is as near to a closed curve (n, 3) as its samples are apart."""
    spacing = np.linalg.norm(np.diff(curve, axis=0), axis=1).max()
    return bool(np.linalg.norm(curve - gamma, axis=1).min() < spacing)


@dataclass(frozen=True)
class _Separatrix(Value):
    """Half of a saddle's manifold: γ (n, 3) from the saddle on, back in time where it is stable.

    end: the fixed point that it reaches; None where it reaches none in the time allowed.
    """

    saddle: FixedPoint
    stable: bool
    path: Array
    end: FixedPoint | None


def separatrices(
    parameters: Parameters, points: Sequence[FixedPoint], duration: float
) -> list[_Separatrix]:
    """Follow both halves of both manifolds of every saddle for a duration [s]."""
    times = sample_times(duration, _INTERVAL)
    found = []
    # A stable manifold is the unstable one of the ball that moves backwards in time.
    for stable, ball in ((False, parameters), (True, reversed_in_time(parameters))):
        halves = [(point, sign) for point in points if point.kind == "saddle" for sign in (1, -1)]
        if not halves:
            return []
        starts = np.array([_near(ball, point.gamma, sign) for point, sign in halves])
        runs = orbits(ball, attitude_at(starts), np.zeros_like(starts), times)
        for (saddle, _), each in zip(halves, runs.attitudes, strict=True):
            path = rotation_matrix(each)[:, 2]
            found.append(_Separatrix(saddle, stable, path, reached(path[-1], points)))
    return found


def _near(parameters: Parameters, gamma: Array, sign: int) -> Array:
    """Return a point (3,) beside the saddle γ (3,), where the flow leaves it."""
    values, vectors = np.linalg.eig(jacobian(parameters, gamma))
    out = vectors[:, np.argmax(values.real)].real @ tangents(gamma)
    beside = gamma + sign * _OFFSET * out
    return beside / np.linalg.norm(beside)


def reached(gamma: Array, points: Sequence[FixedPoint]) -> FixedPoint | None:
    """Return the fixed point that γ (3,) is at, if any."""
    nearest = min(points, key=lambda point: float(np.linalg.norm(point.gamma - gamma)))
    return nearest if np.linalg.norm(nearest.gamma - gamma) < _REACHED else None

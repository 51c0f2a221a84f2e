"""Periodic motions of γ and M, and the phase portrait of motion from rest.

*Closing a motion.* The unknowns of Newton's method are a small rotation of the initial attitude and
the period. The derivative is the monodromy matrix, integrated together with the motion (variational
equations); its eigenvalues are the multipliers. See Seydel, Practical Bifurcation and Stability
Analysis, chapter 7.

*From rest* (4.1), M = 0, the flow is on a sphere, so chaos is impossible: every motion ends at a
fixed point (see `equilibria`) or on a limit cycle. For some fixed point of index 1, a cycle C of
(4.1) crosses the half great circle from this point to the opposite point. The reason: the flow is
the same at γ and -γ, so -C is a cycle, too. If C = -C, the cycle separates every point from the
opposite point. Otherwise C and -C bound two disjoint regions. By Brouwer's theorem each region
contains a fixed point of index 1, and the opposite point is in the other region. So cycles are
found from returns to such arcs.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from robotball.dynamics.equilibria import (
    FixedPoint,
    attitude_at,
    fixed_points,
    flow,
    jacobian,
    rate_scale,
)
from robotball.dynamics.sections import crossings, section_starts, sections_of
from robotball.errors import InputError
from robotball.robot import formulas as eq
from robotball.robot.ball import Value
from robotball.robot.formulas import Parameters, as_vector
from robotball.robot.scene import sample_times
from robotball.rotations import (
    Array,
    from_matrix,
    on_circle,
    rotation_matrix,
    tangents,
    turn_between,
    turned,
)
from robotball.theory.ensembles.orbits import (
    STEP_TOLERANCE,
    Starts,
    angular_velocity,
    orbit,
    orbits,
)
from robotball.theory.ensembles.steppers import ARC, DEVIATION

_ITERATIONS = 30  # Newton's method needs far fewer near a cycle
_BLIND = 1e-9  # relative error of the map's derivative
_SIZE = 3e-6  # rad, and of |M|: near the optimum 1e-6 … 1e-5 of truncation and rounding errors
_CLOSED = 1e-11  # gap in γ and M/|M|; a step tolerance of 1e-14 keeps it over a period
_NO_MOMENTUM = np.zeros(3)
_SAMPLES = 4000  # of a closed curve; neighbours are about 2e-3 apart
_RETURN_TOLERANCE = 1e-9  # relative error of a step while searching for returns
_NOISE = 1e-6  # rad, error of a return angle after many such steps
_CLOSER = 16  # starts between two neighbours where the return map jumps
_AT_REST = 1e-6  # of the flow's rates: a slower cycle is a fixed point
_SAME = 1e-6  # distance of unit vectors below which two cycles are the same
_HYPERBOLIC = 1e-5  # distance of a multiplier from 1: orbits around a centre are closed, too
# Distance of a separatrix's first point from the saddle; its square is the distance from the
# manifold.
_OFFSET = 1e-4
_REACHED = 0.02  # distance from a fixed point within which a separatrix ends there
_INTERVAL = 0.05  # s, largest sample interval

Flow = Callable[[Array, Array], tuple[Array, Array]]
"""Maps attitudes (m, 4) of the frame and M (m, 3) in world axes to their values after a time."""


@dataclass(frozen=True)
class Cycle(Value):
    """A motion whose γ and M are periodic.

    Attributes
    ----------
    attitude : (4,), frame to world, at one moment of the cycle
    momentum : (3,), kg m²/s, world, at the same moment
    period : s
    multipliers : complex, largest first, without the multipliers that are always 1. There are
        two if M ≠ 0 and one if M = 0. With periodic drives there are four for a rubber ball and
        five for a classical ball.
    """

    attitude: Array
    momentum: Array
    period: float
    multipliers: Array

    @property
    def gamma(self) -> Array:
        """γ (3,) at the moment of `attitude`."""
        return rotation_matrix(self.attitude)[2]


def close(parameters: Parameters, attitude: Array, momentum: Array, period: float) -> Cycle:
    """Return the cycle near an attitude (4,), a world momentum (3,) and a period [s].

    Newton's method acts on a small rotation of the attitude and on the period. The smallest
    correction is taken, because the phase along the cycle is arbitrary. Raises InputError if
    Newton's method does not converge.
    """
    for _ in range(_ITERATIONS):
        end, monodromy, volume = monodromy_of(parameters, attitude, momentum, period)
        start, reached = level_vectors(attitude, momentum), level_vectors(end, momentum)
        gap = start - reached
        if np.abs(gap).max() < _CLOSED:
            multipliers = multipliers_of(monodromy, volume, momentum)
            return Cycle(attitude, momentum, period, multipliers)
        along = np.cross(reached, angular_velocity(parameters, end, momentum)).ravel()
        turning = by_turn(reached) @ monodromy - by_turn(start)
        # Rotations along the motion, and about the vertical if M = 0, change nothing, so the matrix
        # is singular up to errors of the derivatives. Take the minimum-norm solution.
        equations = np.column_stack([turning, along]), gap.ravel()
        correction = np.linalg.lstsq(*equations, rcond=_BLIND)[0]
        # Rotations by over 0.3 rad are beyond the linear range.
        correction *= 0.3 / max(0.3, float(np.abs(correction[:-1]).max()))
        attitude = turned(attitude, np.asarray(correction[:-1]))
        period += float(correction[-1])
        if not period > 0:
            break
    raise InputError("no periodic motion found near the start: Newton's method does not converge")


def tangent(
    flow: Flow, attitudes: Array, momenta: Array, along: Array, scale: float | None = None
) -> tuple[tuple[Array, Array], Array]:
    """Return the ends of a map and its derivative (n, 6, k) along deviations (n, 6, k).

    attitudes (n, 4), momenta (n, 3): initial states. A deviation is a small rotation in frame axes
    [rad] and a change of M in world axes, divided by `scale` [kg m²/s], by default |M|.
    """
    n, k = len(attitudes), along.shape[2]
    # The undisturbed motion is included, because its ends are the reference for the rotations.
    sides = np.concatenate([np.zeros((n, 6, 1)), _SIZE * along, -_SIZE * along], axis=2)
    moved = sides.transpose(0, 2, 1).reshape(-1, 6)
    sizes = np.linalg.norm(momenta, axis=1, keepdims=True)
    if scale is not None:
        sizes = np.full((n, 1), scale)
    units = np.repeat(sizes, 1 + 2 * k, axis=0)
    ends, M = flow(
        turned(np.repeat(attitudes, 1 + 2 * k, axis=0), moved[:, :3]),
        np.repeat(momenta, 1 + 2 * k, axis=0) + units * moved[:, 3:],
    )
    first = ends[:: 1 + 2 * k]
    # A motion from rest keeps M = 0 and has no scale.
    changes = M / np.where(units > 0, units, 1.0)
    apart = np.concatenate([turn_between(np.repeat(first, 1 + 2 * k, axis=0), ends), changes], 1)
    apart = apart.reshape(n, 1 + 2 * k, 6).transpose(0, 2, 1)
    return (first, M[:: 1 + 2 * k]), (apart[:, :, 1 : 1 + k] - apart[:, :, 1 + k :]) / (2 * _SIZE)


def by_turn(vectors: Array) -> Array:
    """Return the derivative (3k, 3) of space-fixed vectors (k, 3) by a small frame rotation."""
    return np.cross(vectors[:, None], np.eye(3)).transpose(0, 2, 1).reshape(-1, 3)


def monodromy_of(
    parameters: Parameters, attitude: Array, momentum: Array, period: float
) -> tuple[Array, Array, float]:
    """Return the attitude (4,) after a period, the monodromy (3, 3) and ln of its determinant.

    The monodromy maps a small rotation of the start to the rotation of the end, in frame axes. The
    determinant is exact for periodic motions only.
    """
    # The rotations about the three axes are integrated in parallel lanes of the compiled step.
    starts = Starts(parameters, np.tile(attitude, (3, 1)), np.tile(momentum, (3, 1)))
    rest = np.concatenate([np.eye(3), np.zeros((3, 2))], axis=1)
    states, status = starts.march(DEVIATION, rest, np.array([period]), STEP_TOLERANCE)
    if status.any():
        raise InputError("the motion could not be integrated over the period")
    end = starts.to_world(states[:, :, :4])[0, 0]
    # Deviations are normalised to unit length; the logarithm of their growth is stored separately.
    monodromy = (states[:, 0, 4:7] * np.exp(states[:, 0, 7:8])).T
    return end, monodromy, float(states[0, 0, 8])


def level_vectors(attitude: Array, momentum: Array) -> Array:
    """Return γ and M/|M| (2, 3) in frame axes, or only γ (1, 3) if M = 0."""
    axes = rotation_matrix(attitude)
    size = np.linalg.norm(momentum)
    return np.stack([axes[2], momentum @ axes / size]) if size > 0 else axes[2:]


def multipliers_of(monodromy: Array, volume: float, momentum: Array) -> Array:
    """Return the multipliers without those that are always 1, largest first.

    The multiplier along the motion is 1. If M = 0, the multiplier of a rotation about the vertical
    is 1, too, and only the determinant is left.
    """
    if not np.any(momentum):
        return np.array([np.exp(volume)], dtype=complex)
    values = np.linalg.eigvals(monodromy).astype(complex)
    values = values[np.argsort(np.abs(values - 1))][1:]  # without the one along the motion
    return values[np.argsort(-np.abs(values))]


def fixed_point(parameters: Parameters, L: float, l: float, f: float) -> Cycle:
    """Return the orbit near (L, l) on g = 0 that closes at its first return.

    Raises InputError if Newton's method does not converge.
    """
    # At the given point the orbit may cross in either direction, so start from its next crossing.
    attitudes, momenta = section_starts(L, l, f)
    first = sections_of(parameters, attitudes, momenta, 1)
    if first.status.any():
        raise InputError("the orbit never returns to the section: choose another point (L, l)")
    # A return is a crossing in the same direction.
    direction = int(first.directions[0, 0])
    same_way = sections_of(parameters, attitudes, momenta, 2, direction=direction)
    period = float(same_way.times[0, 1] - same_way.times[0, 0])
    return close(parameters, same_way.attitudes[0, 0], momenta[0], period)


def limit_cycles(parameters: Parameters, longest: float = 200.0, starts: int = 64) -> list[Cycle]:
    """Find the limit cycles of (4.1), stable and unstable, with periods up to `longest` [s].

    Returns one of each pair C, -C. Orbits are followed from `starts` points of each arc until they
    return; two cycles between neighbouring points may both be missed. Raises InputError for a
    classical ball and if fixed points are not isolated.
    """
    cycles: list[Cycle] = []
    curves: list[Array] = []
    points = fixed_points(parameters)
    centres = _of_index_one(points)

    def known(gamma: Array) -> bool:
        return any(_lies_on(sign * gamma, curve) for curve in curves for sign in (1, -1))

    # Newton's method uses the direction of time in which the cycle attracts; the other direction
    # loses all digits.
    for ball, sense in ((parameters, 1), (reversed_in_time(parameters), -1)):
        # Two arcs per point: a cycle that passes near the end of one arc is far from the end of the
        # other.
        for arc in (np.stack([gamma, side]) for gamma in centres for side in tangents(gamma)):
            for gamma, period in _returning(ball, arc, longest, starts):
                # Checked before closing the cycle, to save time, and again with the exact point.
                if known(gamma) or (cycle := _closed(ball, gamma, period)) is None:
                    continue
                if cycle.period > longest or known(cycle.gamma):
                    continue
                # Reversing time inverts the multipliers.
                cycles.append(replace(cycle, multipliers=cycle.multipliers**sense))
                curves.append(curve_of(ball, cycle.gamma, cycle.period))
    return cycles


def _of_index_one(points: list[FixedPoint]) -> list[Array]:
    """Return γ (3,) of the fixed points of index 1, one of each pair ±γ."""
    representatives: list[Array] = []
    for point in points:
        if point.kind not in ("saddle", "degenerate") and not any(
            np.abs(point.gamma + gamma).max() < 1e-6 for gamma in representatives
        ):
            representatives.append(point.gamma)
    return representatives


def _returning(
    parameters: Parameters,
    arc: Array,
    longest: float,
    starts: int,
    part: tuple[float, float] = (0.0, np.pi),
) -> Iterator[tuple[Array, float]]:
    """Yield γ (3,) near crossings of attracting cycles with an arc, and approximate periods [s].

    arc (2, 3): unit vectors of `on_circle`; the arc is 0 < ψ < π, from the first vector through the
    second to the opposite of the first. part: the interval of ψ to search.

    At a cycle the return angle, relative to the start's, changes from ahead to behind. Orbits do
    not cross, so returns keep their order wherever the return map is continuous; a decrease by more
    than the spacing is a jump. Jumps, and the ends of the set of returning starts, are searched
    once more with finer spacing.
    """
    apart = (part[1] - part[0]) / starts
    # Midpoints of equal intervals: the ends of an arc are fixed points, which never return.
    angles = np.linspace(*part, 2 * starts + 1)[1::2]
    ahead, times = _first_returns(parameters, arc, angles, longest)
    gap = ahead - angles
    gap[np.abs(gap) < _NOISE] = 0.0
    fall = gap[:-1] - gap[1:]
    for i in range(starts - 1):
        if np.abs(fall[i]) <= apart + _NOISE:  # false for NaN
            if gap[i] >= 0 >= gap[i + 1] and fall[i] > 0:
                yield on_circle(arc, angles[i] + gap[i] / fall[i] * apart), float(times[i])
        elif part == (0.0, np.pi) and min(abs(gap[i]), abs(gap[i + 1])) < 2 * apart:
            between = float(angles[i]), float(angles[i + 1])
            yield from _returning(parameters, arc, longest, _CLOSER, between)


def _first_returns(
    parameters: Parameters, arc: Array, angles: Array, longest: float
) -> tuple[Array, Array]:
    """Return the angles (n,) and times (n,) [s] of first return to an arc; NaN if none."""
    (centre, across), gamma = arc, on_circle(arc, angles)
    normal = np.cross(centre, across)
    # Any heading: with M = 0 a rotation about the vertical changes nothing.
    first = np.broadcast_to(normal, gamma.shape)
    attitudes = from_matrix(np.stack([first, np.cross(gamma, first), gamma], axis=1))
    way = np.sign(normal @ np.stack(flow(parameters, tuple(gamma.T))))
    starts = Starts(parameters, attitudes, np.zeros_like(gamma))
    numbers = np.concatenate([np.outer(way, normal), np.tile(across, (len(way), 1))], axis=1)
    times, states, *_ = crossings(starts, ARC, numbers, 1, 1, _RETURN_TOLERANCE, longest)
    back = rotation_matrix(states[:, 0])[:, 2]
    return np.arctan2(back @ across, back @ centre), times[:, 0]


def _closed(parameters: Parameters, gamma: Array, period: float) -> Cycle | None:
    """Return the cycle near γ (3,) with about this period [s] or half of it, or None."""
    cycle = _closed_near(parameters, gamma, period)
    if cycle is None:
        return None
    # From half the period, Newton's method finds the same cycle only if that is its period.
    half = _closed_near(parameters, cycle.gamma, cycle.period / 2)
    same = half is not None and np.linalg.norm(half.gamma - cycle.gamma) < _SAME
    return half if same else cycle


def _closed_near(parameters: Parameters, gamma: Array, period: float) -> Cycle | None:
    try:
        cycle = close(parameters, attitude_at(gamma), _NO_MOMENTUM, period)
    except InputError:
        return None
    # A fixed point also closes, after any time.
    rate = np.linalg.norm(flow(parameters, as_vector(cycle.gamma)))
    moves = rate > _AT_REST * rate_scale(parameters)
    return cycle if moves and abs(cycle.multipliers[0] - 1) > _HYPERBOLIC else None


def reversed_in_time(parameters: Parameters) -> Parameters:
    """Return the ball whose motions run backwards in time: ω is linear in (M, K, Ω)."""
    Omega, K = eq.scale(-1.0, parameters.Omega), eq.scale(-1.0, parameters.K)
    return replace(parameters, Omega=Omega, K=K)


def curve_of(parameters: Parameters, gamma: Array, period: float) -> Array:
    """Return γ (_SAMPLES, 3) over one period, starting from γ (3,)."""
    times = np.linspace(0.0, period, _SAMPLES)
    return rotation_matrix(orbit(parameters, attitude_at(gamma), _NO_MOMENTUM, times)[:, :4])[:, 2]


def involute(gamma: Array) -> Array:
    """Return the area-preserving map coordinates φ, γ₃ (..., 2) of points γ (..., 3) [rad, -].

    φ = π/4 + arctan(γ₁/γ₂), from 0 to 2π, as in the paper's Figs 6 to 8. For a line γ (n, 3), φ is
    NaN where it jumps by 2π, so that no segment is drawn across the map.
    """
    phi = (np.pi / 4 + np.arctan2(gamma[..., 0], gamma[..., 1])) % (2 * np.pi)
    if phi.ndim:
        phi[1:][np.abs(np.diff(phi)) > np.pi] = np.nan
    return np.stack([phi, gamma[..., 2]], axis=-1)


def _lies_on(gamma: Array, curve: Array) -> bool:
    """Return whether γ (3,) is within one sample spacing of a closed curve (n, 3)."""
    spacing = np.linalg.norm(np.diff(curve, axis=0), axis=1).max()
    return bool(np.linalg.norm(curve - gamma, axis=1).min() < spacing)


@dataclass(frozen=True)
class _Separatrix(Value):
    """Half of a saddle's manifold; path: γ (n, 3) from the saddle on; end: where it ends."""

    saddle: FixedPoint
    stable: bool
    path: Array
    end: FixedPoint | None


def separatrices(
    parameters: Parameters, points: Sequence[FixedPoint], duration: float
) -> list[_Separatrix]:
    """Follow both halves of both manifolds of every saddle for a duration [s]."""
    times = sample_times(duration, _INTERVAL)
    lines = []
    # The stable manifold is the unstable one of the time-reversed ball.
    for stable, ball in ((False, parameters), (True, reversed_in_time(parameters))):
        halves = [(point, sign) for point in points if point.kind == "saddle" for sign in (1, -1)]
        if not halves:
            return []
        starts = np.array([_near(ball, point.gamma, sign) for point, sign in halves])
        runs = orbits(ball, attitude_at(starts), np.zeros_like(starts), times)
        for (saddle, _), attitudes in zip(halves, runs.attitudes, strict=True):
            path = rotation_matrix(attitudes)[:, 2]
            lines.append(_Separatrix(saddle, stable, path, _reached(path[-1], points)))
    return lines


def _near(parameters: Parameters, gamma: Array, sign: int) -> Array:
    """Return a point (3,) near the saddle γ (3,), along the unstable direction."""
    values, vectors = np.linalg.eig(jacobian(parameters, gamma))
    out = vectors[:, np.argmax(values.real)].real @ tangents(gamma)
    beside = gamma + sign * _OFFSET * out
    return beside / np.linalg.norm(beside)


def _reached(gamma: Array, points: Sequence[FixedPoint]) -> FixedPoint | None:
    """Return the fixed point within _REACHED of γ (3,), or None."""
    nearest = min(points, key=lambda point: float(np.linalg.norm(point.gamma - gamma)))
    return nearest if np.linalg.norm(nearest.gamma - gamma) < _REACHED else None

"""Periodic motions of γ and M, found by Newton's method, with period and Floquet multipliers.

The unknowns are a small rotation of the initial attitude and the period. The derivative is the
monodromy matrix, integrated together with the motion (variational equations); its eigenvalues are
the multipliers. See Seydel, Practical Bifurcation and Stability Analysis, chapter 7. `close_map`
also accepts other maps of attitudes with a known derivative, such as a contact engine's. With
periodic drives or a periodic plane, the map is the stroboscopic one: the drive phase becomes a
coordinate of an autonomous motion, and phase = const its section.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce

import numpy as np

from robotball.errors import InputError
from robotball.robot.ball import Value
from robotball.robot.formulas import Parameters
from robotball.rotations import Array, rotation_matrix, turn_between, turned
from robotball.theory.ensembles.orbits import STEP_TOLERANCE, Starts, angular_velocity
from robotball.theory.ensembles.steppers import DEVIATION

_ITERATIONS = 30  # Newton's method needs far fewer near a cycle
_BLIND = 100.0  # relative error of the map's derivative, over the accepted gap `closed`
_SIZE = 3e-6  # rad, and of |M|: near the optimum 1e-6 … 1e-5 of truncation and rounding errors
_CLOSED = 1e-11  # gap in γ and M/|M|; a step tolerance of 1e-14 keeps it over a period

Flow = Callable[[Array, Array], tuple[Array, Array]]
"""Maps attitudes (m, 4), frame to world, and M (m, 3), world, to their values after a time."""

Followed = tuple[Array, Array, Array, Array]
"""Ends of n segments: attitudes (n, 4), monodromies (n, 3, 3), the logarithms of their determinants
(n,), as from `monodromy_of`, and angular velocities (n, 3) in frame axes [rad/s]."""


@dataclass(frozen=True)
class Cycle(Value):
    """A motion whose γ and M are periodic.

    Attributes
    ----------
    attitude : (4,), frame to world, at one moment of the cycle
    momentum : (3,), kg m²/s, world, at the same moment
    period : s
    multipliers : complex, largest first, without those that are always 1. Two if M ≠ 0, one if
        M = 0. With periodic drives, four of a rubber ball and five of a classical one.
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
    """Return the cycle near attitudes (4,) or (n, 4), M (3,) world and a period [s].

    Several attitudes are equally spaced in time; see `close_map`. Raises
    InputError if Newton's method does not converge.
    """

    def follow(attitudes: Array, duration: float) -> Followed:
        segments = [monodromy_of(parameters, q, momentum, duration) for q in attitudes]
        ends, monodromies, volumes = (np.array(column) for column in zip(*segments, strict=True))
        omega = np.array([angular_velocity(parameters, end, momentum) for end in ends])
        return ends, monodromies, volumes, omega

    return close_map(follow, np.atleast_2d(attitude), momentum, period)


def close_map(
    follow: Callable[[Array, float], Followed],
    attitudes: Array,
    momentum: Array,
    period: float,
    closed: float = _CLOSED,
) -> Cycle:
    """Return the cycle near n attitudes (n, 4), equally spaced in time over a period [s].

    follow: maps attitudes (n, 4) and a duration [s] to the ends of the segments; momentum (3,):
    constant; closed: the largest accepted gap in γ and M/|M|.

    Multiple shooting: Newton's method acts on a small rotation of every attitude and on the period,
    so an unstable motion can grow only over one segment. The smallest correction is taken, because
    the phase along the cycle is arbitrary. Raises InputError if Newton's method does not converge.
    """
    n = len(attitudes)
    for _ in range(_ITERATIONS):
        ends, monodromies, volumes, omegas = follow(attitudes, period / n)
        starts = np.array([level_vectors(q, momentum) for q in attitudes])
        reached = np.array([level_vectors(q, momentum) for q in ends])
        gap = np.roll(starts, -1, axis=0) - reached
        if np.abs(gap).max() < closed:
            whole = reduce(np.matmul, monodromies[::-1])
            multipliers = multipliers_of(whole, float(volumes.sum()), momentum)
            return Cycle(attitudes[0], momentum, period, multipliers)
        # Rotating a start moves its segment's end by the monodromy, and the previous target.
        jacobian = np.zeros((n, gap[0].size, 3 * n + 1))
        for i in range(n):
            here, after = (slice(3 * j, 3 * j + 3) for j in (i, (i + 1) % n))
            jacobian[i, :, here] += by_turn(reached[i]) @ monodromies[i]
            jacobian[i, :, after] -= by_turn(starts[(i + 1) % n])
            jacobian[i, :, -1] = np.cross(reached[i], omegas[i]).ravel() / n
        # Rotations along the motion, and about the vertical if M = 0, change nothing. The matrix
        # is singular up to errors of the derivatives: take the minimum-norm solution.
        equations = jacobian.reshape(-1, 3 * n + 1), gap.ravel()
        correction = np.linalg.lstsq(*equations, rcond=_BLIND * closed)[0]
        # Rotations by over 0.3 rad are beyond the linear range.
        correction *= 0.3 / max(0.3, float(np.abs(correction[:-1]).max()))
        attitudes = turned(attitudes, correction[:-1].reshape(n, 3))
        period += float(correction[-1])
        if not period > 0:
            break
    raise InputError("no periodic motion found near the start: Newton's method does not converge")


def tangent(
    flow: Flow, attitudes: Array, momenta: Array, along: Array, scale: float | None = None
) -> tuple[tuple[Array, Array], Array]:
    """Return the ends of a map and its derivative (n, 6, k) along deviations (n, 6, k).

    attitudes (n, 4), momenta (n, 3): initial states. A deviation is a small rotation in frame axes
    [rad] and a change of M in world axes over `scale` [kg m²/s], by default over |M|.
    """
    n, k = len(attitudes), along.shape[2]
    # The undisturbed motion is included: it gives the ends, to which rotations are relative.
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
    # The rotations about the three axes are integrated in parallel lanes of the compiled steps.
    # The three turns about the axes are followed side by side, a lane each of the compiled steps.
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


def nearest(points: Array, others: Array) -> Array:
    """Return the distance (n,) from each of points (n, k) to the nearest of others (m, k)."""
    return np.array([np.linalg.norm(others - point, axis=1).min() for point in points])

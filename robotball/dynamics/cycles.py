"""Periodic motions of γ and M: closed by Newton's method, with period and multipliers.

Newton's method acts on a small turn of the start and on the period. Its derivative is the monodromy
matrix, integrated with the motion by the variational equations; its eigenvalues are the Floquet
multipliers. See Seydel, Practical Bifurcation and Stability Analysis, chapter 7, for the method.
Any other map of attitudes whose derivative is known, as a contact engine's, is closed alike. Where
drives or the plane are periodic, a motion is closed on the stroboscopic map over their period: an
autonomous motion with their phase as a coordinate, whose section is phase = const.
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

_ITERATIONS = 30  # far more than Newton's method takes near a cycle: beyond, there is none
_BLIND = 100.0  # times the gap that passes for none: relative errors of a map's derivative
_SIZE = 3e-6  # rad, and of |M|: the least error, of rounding with it, is between 1e-6 and 1e-5
_CLOSED = 1e-11  # of γ and M/|M|; what a tolerance of 1e-14 keeps over a period


Flow = Callable[[Array, Array], tuple[Array, Array]]
"""Attitudes (m, 4), principal axes, and M (m, 3), world → both after a stretch."""


@dataclass(frozen=True)
class Cycle(Value):
    """A motion whose γ and M repeat.

    attitude (4,), frame to world, and momentum (3,) kg m²/s, world, at some moment of it; period
    s; multipliers, complex, largest first: two of them where M ≠ 0, one where M = 0, and where
    drives are periodic those of γ and M, four of a rubber ball and five of a classical one.
    """

    attitude: Array
    momentum: Array
    period: float
    multipliers: Array

    @property
    def gamma(self) -> Array:
        """γ (3,) at that moment."""
        return rotation_matrix(self.attitude)[2]


def close(parameters: Parameters, attitude: Array, momentum: Array, period: float) -> Cycle:
    """Return the periodic motion near a start (4,), (3,), with a period near a given one [s].

    Attitudes (n, 4), too, each a part of the period after the last, as `close_map` takes them.
    Raises InputError where Newton's method does not converge.
    """

    def follow(attitudes: Array, duration: float) -> Followed:
        found = [monodromy_of(parameters, q, momentum, duration) for q in attitudes]
        ends, monodromies, volumes = (np.array(each) for each in zip(*found, strict=True))
        omega = np.array([angular_velocity(parameters, end, momentum) for end in ends])
        return ends, monodromies, volumes, omega

    return close_map(follow, np.atleast_2d(attitude), momentum, period)


Followed = tuple[Array, Array, Array, Array]
"""The ends of n stretches: attitudes (n, 4), monodromies (n, 3, 3) with ln of their determinants
(n,), as of `monodromy_of`, and angular velocities (n, 3) in frame axes [rad/s]."""


def close_map(
    follow: Callable[[Array, float], Followed],
    attitudes: Array,
    momentum: Array,
    period: float,
    closed: float = _CLOSED,
) -> Cycle:
    """Return the periodic motion near attitudes (n, 4), each a part of a period [s] after the last.

    follow: from attitudes (n, 4) over a duration [s]; momentum (3,): of all of them; closed: the
    largest gap in γ and M/|M|.

    Newton's method on a small turn of every attitude and on the period (multiple shooting: what
    leaves an unstable motion within a period has only a part of it to grow in). Of all corrections
    the smallest is taken, for every moment of the motion is as good a start as another. Raises
    InputError where that does not converge.
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
        # A turn of a start moves the end by the monodromy, and what it must meet by the next turn.
        jacobian = np.zeros((n, gap[0].size, 3 * n + 1))
        for i in range(n):
            own, after = (slice(3 * j, 3 * j + 3) for j in (i, (i + 1) % n))
            jacobian[i, :, own] += by_turn(reached[i]) @ monodromies[i]
            jacobian[i, :, after] -= by_turn(starts[(i + 1) % n])
            jacobian[i, :, -1] = np.cross(reached[i], omegas[i]).ravel() / n
        # Turning along the motion itself changes nothing, nor, where M = 0, about the vertical:
        # singular but for the derivatives' errors, hence the least solution.
        equations = jacobian.reshape(-1, 3 * n + 1), gap.ravel()
        correction = np.linalg.lstsq(*equations, rcond=_BLIND * closed)[0]
        # A turn by more than 0.3 rad is beyond what is linear about it.
        correction *= 0.3 / max(0.3, float(np.abs(correction[:-1]).max()))
        attitudes = turned(attitudes, correction[:-1].reshape(n, 3))
        period += float(correction[-1])
        if not period > 0:
            break
    raise InputError("no periodic motion found near the start: Newton's method does not converge")


def tangent(
    flow: Flow, attitudes: Array, momenta: Array, along: Array, scale: float | None = None
) -> tuple[tuple[Array, Array], Array]:
    """Return a map's ends, and its derivative (n, 6, k) along deviations (n, 6, k).

    attitudes (n, 4), momenta (n, 3): of the starts. A deviation is a small turn, in the axes that
    attitudes are of [rad], and a change of M, world, over a scale [kg m²/s], |M| if None.
    """
    n, k = len(attitudes), along.shape[2]
    # The middle motion as well: it is where the map goes on from, and what turns are measured
    # against.
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
    # From rest M stays zero and has no scale.
    changes = M / np.where(units > 0, units, 1.0)
    apart = np.concatenate([turn_between(np.repeat(first, 1 + 2 * k, axis=0), ends), changes], 1)
    apart = apart.reshape(n, 1 + 2 * k, 6).transpose(0, 2, 1)
    return (first, M[:: 1 + 2 * k]), (apart[:, :, 1 : 1 + k] - apart[:, :, 1 + k :]) / (2 * _SIZE)


def by_turn(vectors: Array) -> Array:
    """Return the derivative (3k, 3) of space's vectors (k, 3) in frame axes by a small turn."""
    return np.cross(vectors[:, None], np.eye(3)).transpose(0, 2, 1).reshape(-1, 3)


def monodromy_of(
    parameters: Parameters, attitude: Array, momentum: Array, period: float
) -> tuple[Array, Array, float]:
    """Return the attitude (4,) after a period, the monodromy (3, 3) and ln of its determinant.

    The monodromy is the end's small turn by the start's.

    The determinant is up to a factor that is 1 where the motion is periodic.
    """
    # The three turns about the axes are followed side by side, a lane each of the compiled steps.
    starts = Starts(parameters, np.tile(attitude, (3, 1)), np.tile(momentum, (3, 1)))
    rest = np.concatenate([np.eye(3), np.zeros((3, 2))], axis=1)
    states, status = starts.march(DEVIATION, rest, np.array([period]), STEP_TOLERANCE)
    if status.any():
        raise InputError("the motion could not be followed over the period")
    end = starts.to_world(states[:, :, :4])[0, 0]
    # A deviation is kept at length one, with the logarithm of its growth beside it.
    monodromy = (states[:, 0, 4:7] * np.exp(states[:, 0, 7:8])).T
    return end, monodromy, float(states[0, 0, 8])


def level_vectors(attitude: Array, momentum: Array) -> Array:
    """Return γ and M/|M| (2, 3) in frame axes, or γ alone (1, 3) where M = 0."""
    axes = rotation_matrix(attitude)
    size = np.linalg.norm(momentum)
    return np.stack([axes[2], momentum @ axes / size]) if size > 0 else axes[2:]


def multipliers_of(monodromy: Array, volume: float, momentum: Array) -> Array:
    """Return the multipliers without those that are 1, largest first.

    The motion's own is 1, and at M = 0 that of a turn about the vertical, so that there the
    determinant is all there is to know.
    """
    if not np.any(momentum):
        return np.array([np.exp(volume)], dtype=complex)
    values = np.linalg.eigvals(monodromy).astype(complex)
    values = values[np.argsort(np.abs(values - 1))][1:]  # without the motion's own
    return values[np.argsort(-np.abs(values))]


def nearest(points: Array, others: Array) -> Array:
    """Return how far points (n, k) are from the nearest of others (m, k): (n,)."""
    return np.array([np.linalg.norm(others - point, axis=1).min() for point in points])

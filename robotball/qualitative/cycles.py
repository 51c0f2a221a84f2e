"""Periodic motions of γ and M: closed by Newton's method, with period and multipliers.

Newton's method acts on a small turn of the start and on the period. Its derivative is the monodromy
matrix, integrated with the motion by the variational equations; its eigenvalues are the Floquet
multipliers. See Seydel, Practical Bifurcation and Stability Analysis, chapter 7, for the method.
"""

from dataclasses import dataclass

import numpy as np

from robotball.engines.ensembles.orbits import STEP_TOLERANCE, Starts, angular_velocity
from robotball.engines.ensembles.steppers import DEVIATION
from robotball.equations import Parameters
from robotball.errors import InputError
from robotball.rotations import Array, multiply, rotation_matrix

_ITERATIONS = 30  # far more than Newton's method takes near a cycle: beyond, there is none
_CLOSED = 1e-11  # of γ and M/|M|; what a tolerance of 1e-14 keeps over a period


@dataclass(frozen=True)
class Cycle:
    """A motion whose γ and M repeat.

    attitude (4,), frame to world, and momentum (3,) kg m²/s, world, at some moment of it; period
    s; multipliers, complex, largest first: two of them where M ≠ 0, one where M = 0.
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

    Newton's method on a small turn of the start and on the period; of all corrections the
    smallest is taken, for every moment of the motion is as good a start as another. Raises
    InputError where that does not converge.
    """
    for _ in range(_ITERATIONS):
        end, monodromy, volume = monodromy_of(parameters, attitude, momentum, period)
        vectors = level_vectors(attitude, momentum), level_vectors(end, momentum)
        omega = angular_velocity(parameters, end, momentum)
        gap = (vectors[1] - vectors[0]).ravel()
        if np.abs(gap).max() < _CLOSED:
            return Cycle(attitude, momentum, period, multipliers_of(monodromy, volume, momentum))
        # A turn of the start moves the end by the monodromy, and what must be closed by both.
        by_turn = np.cross(vectors[1][:, None], monodromy.T) - np.cross(
            vectors[0][:, None], np.eye(3)
        )
        by_period = np.cross(vectors[1], omega)
        columns = np.concatenate([by_turn, by_period[:, None]], axis=1)
        # Turning along the motion itself changes nothing: singular, hence the least solution.
        jacobian = columns.transpose(0, 2, 1).reshape(-1, 4)
        correction = np.linalg.lstsq(jacobian, -gap, rcond=1e-9)[0]
        # A turn by more than 0.3 rad is beyond what is linear about it.
        correction *= min(1.0, 0.3 / float(np.abs(correction[:3]).max()))
        turn = np.array([1.0, *(correction[:3] / 2)])
        attitude = multiply(attitude, turn / np.linalg.norm(turn))
        period += float(correction[3])
        if not period > 0:
            break
    raise InputError("no periodic motion found near the start: Newton's method does not converge")


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

"""The stable and unstable manifolds of the saddles of (4.1): they part the basins on the sphere."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from robotball.engines.reduced.compiled.kernels import orbits
from robotball.parameters import Parameters
from robotball.qualitative.equilibria import FixedPoint, attitude_at, jacobian, tangents
from robotball.qualitative.limit_cycles import reversed_in_time
from robotball.rotations import Array, rotation_matrix
from robotball.times import sample_times

OFFSET = 1e-4  # of the first point from the saddle
REACHED = 0.02  # of a fixed point: a manifold that ends that near to it ends there
INTERVAL = 0.05  # s, at most, between two samples


@dataclass(frozen=True)
class Separatrix:
    """Half of a saddle's manifold: γ (n, 3) from the saddle on, back in time where it is stable.

    end: the fixed point that it reaches; None where it reaches none in the time allowed.
    """

    saddle: FixedPoint
    stable: bool
    path: Array
    end: FixedPoint | None


def separatrices(
    parameters: Parameters, points: Sequence[FixedPoint], duration: float
) -> list[Separatrix]:
    """All four of every saddle among the fixed points, each followed for a duration [s]."""
    times = sample_times(duration, INTERVAL)
    found = []
    for stable, ball in ((False, parameters), (True, reversed_in_time(parameters))):
        saddles = [point for point in points if point.kind == "saddle" for _ in range(2)]
        if not saddles:
            return []
        starts = [
            near(ball, point.gamma, sign)
            for point, sign in zip(saddles, (1, -1) * (len(saddles) // 2), strict=True)
        ]
        attitudes = attitude_at(np.array(starts))
        runs = orbits(ball, attitudes, np.zeros((len(starts), 3)), times)
        for saddle, each in zip(saddles, runs.attitudes, strict=True):
            path = rotation_matrix(each)[:, 2]
            found.append(Separatrix(saddle, stable, path, reached(path[-1], points)))
    return found


def near(parameters: Parameters, gamma: Array, sign: int) -> Array:
    """A point (3,) beside the saddle γ (3,), in the direction in which the flow leaves it."""
    values, vectors = np.linalg.eig(jacobian(parameters, gamma))
    out = vectors[:, np.argmax(values.real)].real @ tangents(gamma)
    beside = gamma + sign * OFFSET * out
    return beside / np.linalg.norm(beside)


def reached(gamma: Array, points: Sequence[FixedPoint]) -> FixedPoint | None:
    """The fixed point that γ (3,) is at, if any."""
    nearest = min(points, key=lambda point: float(np.linalg.norm(point.gamma - gamma)))
    return nearest if np.linalg.norm(nearest.gamma - gamma) < REACHED else None

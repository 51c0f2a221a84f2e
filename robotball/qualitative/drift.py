"""Where the ball goes in the long run: the mean velocity of the contact point."""

from dataclasses import dataclass

import numpy as np

from robotball.engines.reduced.compiled.kernels import LONG_RUN_TOLERANCE, Starts, orbits
from robotball.errors import InputError
from robotball.parameters import Parameters
from robotball.rotations import Array


@dataclass(frozen=True)
class Drift:
    """Mean motions of the contact points of n starts, along and across their momenta.

    velocities (n, 2) m/s: along OX = -M/√f of section 3.3, which each start has for itself, and
    OY, to its left. duration s, of the means.
    """

    velocities: Array
    duration: float

    @property
    def mean(self) -> Array:
        """The mean velocity (2,) over the starts, m/s."""
        return self.velocities.mean(axis=0)

    @property
    def error(self) -> Array:
        """The standard error (2,) of `mean`, from the scatter of the starts, m/s."""
        return self.velocities.std(axis=0, ddof=1) / np.sqrt(len(self.velocities))


def drift(
    parameters: Parameters,
    attitudes: Array,
    momenta: Array,
    duration: float,
    transient: float = 1000.0,
    tolerance: float = LONG_RUN_TOLERANCE,
) -> Drift:
    """The mean motion of the contact point over `duration` after a `transient` [s].

    attitudes (n, 4), momenta (n, 3): as for kernels.orbits. Raises InputError on unusable starts
    or durations, and where a motion could not be followed.
    """
    times = np.array([0.0, transient, transient + duration])
    runs = orbits(parameters, attitudes, momenta, times, tolerance)
    if runs.status.any():
        raise InputError(f"{np.count_nonzero(runs.status)} motions could not be followed")
    velocities = (runs.contact_points[:, 2] - runs.contact_points[:, 1]) / duration
    turns = Starts(parameters, attitudes, momenta).turns
    cos, sin = np.cos(turns), np.sin(turns)
    VX, VY = velocities.T
    return Drift(np.stack([cos * VX + sin * VY, cos * VY - sin * VX], axis=1), duration)

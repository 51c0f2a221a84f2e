"""Mean velocity of the contact point in long motions."""

from dataclasses import dataclass

import numpy as np

from robotball.robot.formulas import Parameters
from robotball.rotations import Array
from robotball.theory.ensembles.orbits import LONG_RUN_TOLERANCE, Starts
from robotball.theory.ensembles.steppers import PATH


@dataclass(frozen=True)
class Drift:
    """Mean velocities of n contact points along and across their momenta.

    velocities (n, 2) [m/s]: along OX = -M/√f of section 3.3, different for each start, and along
    OY to its left. duration [s]: over which the means are taken.
    """

    velocities: Array
    duration: float

    @property
    def mean(self) -> Array:
        """Mean velocity (2,) over the starts [m/s]."""
        return np.asarray(self.velocities.mean(axis=0))

    @property
    def error(self) -> Array:
        """Standard error (2,) of `mean` from the scatter of the starts [m/s]."""
        return np.asarray(self.velocities.std(axis=0, ddof=1) / np.sqrt(len(self.velocities)))


def drift(
    parameters: Parameters,
    attitudes: Array,
    momenta: Array,
    duration: float,
    transient: float = 1000.0,
) -> Drift:
    """Estimate the mean velocity of the contact point over `duration` after a `transient` [s]."""
    starts = Starts(parameters, attitudes, momenta)
    ends = np.array([transient, transient + duration])
    # In the turned axes each momentum points along -X, so X is OX.
    states, status = starts.march(PATH, np.zeros((len(starts.rows), 2)), ends, LONG_RUN_TOLERANCE)
    assert not status.any()
    return Drift(np.diff(states, axis=1)[:, 0, 4:] / duration, duration)

"""Periodic motions of MuJoCo's own map."""

from functools import partial

import numpy as np

from robotball.dynamics.cycles import Cycle, Followed, close_map, tangent
from robotball.dynamics.sections import Crossings, crossings_of_motion, own_start
from robotball.engines.mujoco.model import Model
from robotball.rotations import Array, turned
from robotball.theory.ensembles.orbits import angular_velocity, orbit
from validation.studies.contact_sections import each_step, sound_run
from validation.studies.contact_tangent import rolled

_CLOSED = 1e-9  # of γ and M/|M|


def contact_cycle(model: Model, cycle: Cycle, parts: int = 1) -> Cycle:
    """Return the periodic motion of the contact engine's map near one of the equations.

    parts: of the period, each short enough for what leaves the motion to stay near it. Raises
    InputError where Newton's method does not converge, or where a run has a fault.
    """
    ball, M = model.scene.parameters, cycle.momentum
    times = np.linspace(0.0, cycle.period, parts + 1)
    # Off the equations' motion by far more than both engines are apart: the search is the map's.
    near = turned(orbit(ball, cycle.attitude, M, times)[:-1, :4], np.full((parts, 3), 1e-3))

    def follow(attitudes: Array, duration: float) -> Followed:
        # Turns alone: M stays what it is, so that the cycle is sought on its level.
        turns, momenta = np.tile(np.eye(6)[:, :3], (parts, 1, 1)), np.tile(M, (parts, 1))
        (ends, _), images = tangent(partial(rolled, model, duration), attitudes, momenta, turns)
        monodromies = images[:, :3]
        omegas = np.array([angular_velocity(ball, end, M) for end in ends])
        return ends, monodromies, np.linalg.slogdet(monodromies)[1], omegas

    return close_map(follow, near, M, cycle.period, _CLOSED)


def cycle_crossings(model: Model, cycle: Cycle) -> Crossings:
    """Return where a periodic motion of the contact model crosses g = 0, in a little over a period.

    Raises InputError where the run has a fault.
    """
    start = own_start(model.scene, cycle.attitude, cycle.momentum)
    motion = sound_run(model, start, each_step(model, 1.01 * cycle.period))
    return crossings_of_motion(motion, model.scene)

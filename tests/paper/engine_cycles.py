"""Periodic motions of MuJoCo's map."""

from functools import partial

import numpy as np

from robotball.dynamics.cycles import Cycle, Followed, close_map, tangent
from robotball.dynamics.sections import Crossings, crossings_of_motion, own_start
from robotball.engines.mujoco.model import Model
from robotball.rotations import Array, turned
from robotball.theory.ensembles.orbits import angular_velocity, orbit
from validation.studies.contact_sections import each_step, sound_run
from validation.studies.contact_tangent import rolled

_CLOSED = 1e-9  # tolerance of γ and M/|M|


def contact_cycle(model: Model, cycle: Cycle, parts: int = 1) -> Cycle:
    """Return the periodic motion of MuJoCo's map near a cycle of the equations.

    parts: of the period, short enough that unstable deviations stay small. Raises InputError if
    Newton's method does not converge or a run has a fault.
    """
    ball, M = model.scene.parameters, cycle.momentum
    times = np.linspace(0.0, cycle.period, parts + 1)
    # Start farther off than MuJoCo and the equations differ, to find the motion of MuJoCo alone.
    near = turned(orbit(ball, cycle.attitude, M, times)[:-1, :4], np.full((parts, 3), 1e-3))

    def follow(attitudes: Array, duration: float) -> Followed:
        # Rotate only: a constant M keeps the search on the level of M².
        turns, momenta = np.tile(np.eye(6)[:, :3], (parts, 1, 1)), np.tile(M, (parts, 1))
        (ends, _), images = tangent(partial(rolled, model, duration), attitudes, momenta, turns)
        monodromies = images[:, :3]
        omegas = np.array([angular_velocity(ball, end, M) for end in ends])
        return ends, monodromies, np.linalg.slogdet(monodromies)[1], omegas

    return close_map(follow, near, M, cycle.period, _CLOSED)


def cycle_crossings(model: Model, cycle: Cycle) -> Crossings:
    """Return the crossings of g = 0 of a periodic motion in MuJoCo within 1.01 periods.

    Raises InputError if the run has a fault.
    """
    start = own_start(model.scene, cycle.attitude, cycle.momentum)
    motion = sound_run(model, start, each_step(model, 1.01 * cycle.period))
    return crossings_of_motion(motion, model.scene)

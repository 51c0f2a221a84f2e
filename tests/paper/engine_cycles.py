"""The map of MuJoCo over a stretch of time: its tangent, exponents and periodic motions."""

from functools import partial

import numpy as np

from robotball.dynamics.cycles import Cycle, Followed, close_map, tangent
from robotball.dynamics.long_run import Exponents, exponents_of
from robotball.dynamics.sections import Crossings, crossings_of_motion, own_start
from robotball.engines.mujoco.model import Model
from robotball.robot.formulas import Parameters
from robotball.rotations import Array, multiply, turned
from robotball.theory.ensembles.orbits import angular_velocity, orbit, orbits
from validation.studies.contact_sections import each_step, sound_run
from validation.studies.long_runs import Growth

_CLOSED = 1e-9  # tolerance of γ and M/|M|


def rolled(model: Model, duration: float, attitudes: Array, momenta: Array) -> tuple[Array, Array]:
    """Roll the ball with MuJoCo for a duration [s], and return attitudes (m, 4) and M (m, 3).

    `attitudes` of the principal axes and `momenta` in the world are the starts. Raises InputError
    if a run has a fault.
    """
    ends, times = [], np.array([0.0, duration])
    for q, M in zip(attitudes, momenta, strict=True):
        motion = sound_run(model, own_start(model.scene, q, M), times)
        ends.append((motion.attitude[-1], motion.momentum[-1]))
    last, M = map(np.array, zip(*ends, strict=True))
    return multiply(last, model.scene.principal_quaternion), M


def integrated(
    parameters: Parameters, duration: float, attitudes: Array, momenta: Array
) -> tuple[Array, Array]:
    """Integrate the equations for a duration [s], like `rolled`."""
    times = np.array([0.0, duration])
    return orbits(parameters, attitudes, momenta, times).attitudes[:, -1], momenta


def by_equations(growth: Growth, parameters: Parameters, momenta: Array) -> tuple[Array, float]:
    """Return `logarithms` and the mean divergence [1/s] of the equations, for momenta (n, 3).

    Every stretch begins with the same states and deviations as in the growth.
    """
    states = growth.attitudes.reshape(-1, 4), momenta.repeat(growth.along.shape[1], axis=0)
    along = growth.along.reshape(-1, *growth.along.shape[2:])
    images = tangent(partial(integrated, parameters, growth.stretch), *states, along)[1]
    # The means begin as soon as they may.
    divergence = exponents_of(parameters, *states, growth.stretch, transient=1e-9).divergence
    R = np.linalg.qr(images)[1]
    logarithms = np.log(np.abs(np.diagonal(R, axis1=1, axis2=2))).reshape(growth.logarithms.shape)
    return logarithms, float(divergence.mean())


def ends_of(growth: Growth, last: int) -> Exponents:
    """Return the first exponent in two halves of the time, and the divergence."""
    parts = np.array_split(growth.logarithms[:, :, 0] / growth.stretch, 2, axis=1)
    halves = np.stack([part.mean(axis=1) for part in parts], axis=1)
    divergence = halves.mean(axis=1) + growth.spectra[:, last:].sum(axis=1)
    return Exponents(halves, divergence, growth.logarithms.shape[1] * growth.stretch)


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

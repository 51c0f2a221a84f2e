"""The map of MuJoCo over a stretch of time: its tangent, exponents and periodic motions."""

from collections.abc import Callable
from functools import partial, reduce

import numpy as np

from robotball.dynamics.cycles import (
    Cycle,
    by_turn,
    level_vectors,
    multipliers_of,
    tangent,
)
from robotball.dynamics.long_run import Exponents, exponents_of
from robotball.dynamics.sections import Crossings, crossings_of_motion, own_start
from robotball.engines.mujoco.model import Model
from robotball.errors import InputError
from robotball.robot.formulas import Parameters
from robotball.rotations import Array, multiply, turned
from robotball.theory.ensembles.orbits import angular_velocity, orbit, orbits
from validation.studies.contact_sections import each_step, sound_run
from validation.studies.long_runs import Growth

_ITERATIONS = 30  # of Newton's method
_CLOSED = 1e-9  # tolerance of γ and M/|M|
_BLIND = 1e-7  # relative error of the map's derivative

Followed = tuple[Array, Array, Array, Array]
"""Ends of n segments: attitudes (n, 4), monodromies (n, 3, 3), the logarithms of their determinants
(n,), and angular velocities (n, 3) in frame axes [rad/s]."""


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

    return _close(follow, near, M, cycle.period)


def _close(
    follow: Callable[[Array, float], Followed], attitudes: Array, momentum: Array, period: float
) -> Cycle:
    """Return the cycle near n attitudes (n, 4), equally spaced in time over a period [s].

    follow: maps attitudes (n, 4) and a duration [s] to the ends of the segments; momentum (3,):
    constant. Multiple shooting: Newton's method acts on a small rotation of every attitude and on
    the period, so an unstable motion can grow only over one segment.
    """
    n = len(attitudes)
    for _ in range(_ITERATIONS):
        ends, monodromies, volumes, omegas = follow(attitudes, period / n)
        starts = np.array([level_vectors(q, momentum) for q in attitudes])
        reached = np.array([level_vectors(q, momentum) for q in ends])
        gap = np.roll(starts, -1, axis=0) - reached
        if np.abs(gap).max() < _CLOSED:
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
        equations = jacobian.reshape(-1, 3 * n + 1), gap.ravel()
        correction = np.linalg.lstsq(*equations, rcond=_BLIND)[0]
        correction *= 0.3 / max(0.3, float(np.abs(correction[:-1]).max()))
        attitudes = turned(attitudes, correction[:-1].reshape(n, 3))
        period += float(correction[-1])
        if not period > 0:
            break
    raise InputError("no periodic motion found near the start: Newton's method does not converge")


def cycle_crossings(model: Model, cycle: Cycle) -> Crossings:
    """Return the crossings of g = 0 of a periodic motion in MuJoCo within 1.01 periods.

    Raises InputError if the run has a fault.
    """
    start = own_start(model.scene, cycle.attitude, cycle.momentum)
    motion = sound_run(model, start, each_step(model, 1.01 * cycle.period))
    return crossings_of_motion(motion, model.scene)

"""The section map of the contact model: from crossing to crossing of g = 0 by MuJoCo.

A run of many returns is cut into stretches, each begun on the constraints again and with the
momentum it started from: so an attractor is seen at its own level of M² however long the run is.
"""

from dataclasses import dataclass

import numpy as np

from robotball import InputError, Motion, Scene, sample_times
from robotball.engines.mujoco import LABEL
from robotball.engines.mujoco.model import Model
from robotball.engines.mujoco.run import run
from robotball.qualitative.motion_section import Crossings, crossings, joined
from robotball.qualitative.sections import section_starts
from robotball.rotations import Array, conjugate, multiply
from robotball.start import Start

STRETCH = 100.0  # s; in it M drifts by a few millionths at most
NO_RETURN = 100  # stretches without enough crossings, after which a run is given up
NEAR = 1e-4  # of √f and of a radian: how far apart the map is looked at for its derivative
ITERATIONS = 12
CLOSED = 1e-9  # of √f and of a radian; the map itself repeats to rounding


@dataclass(frozen=True)
class ContactCycle:
    """A periodic motion of the contact model: where it crosses g = 0, period s, multipliers."""

    L: float
    l: float
    period: float
    multipliers: Array


def start_at(model: Model, L: float, l: float, f: float) -> Start:
    """The start of the model's ball at the point (L, l) of g = 0, in its frame's own axes."""
    attitudes, momenta = section_starts(np.array([L]), np.array([l]), f)
    return own_start(model.scene, attitudes[0], momenta[0])


def own_start(scene: Scene, attitude: Array, momentum: Array) -> Start:
    """A start of the equations, whose axes are principal axes, in the frame's own axes."""
    return Start(multiply(attitude, conjugate(scene.principal_quaternion)), momentum)


def sound_run(model: Model, start: Start, duration: float) -> Motion:
    """The motion sampled at every step; raises InputError where it has a fault."""
    motion = run(model, sample_times(duration, model.compiled.opt.timestep), start=start)
    if motion.report.faults:
        raise InputError(f"{LABEL.name}'s run is no result: {motion.report.faults[0]}")
    return motion


def returns(
    model: Model, start: Start, count: int, direction: int = 1
) -> tuple[Crossings, float, Array]:
    """The first `count` crossings of g = 0 in a direction (0: in both).

    Also how long the run was [s] and the contact point's displacement (2,) over it [m]. Raises
    InputError where a run has a fault, or does not come back often enough.
    """
    found: list[Crossings] = []
    moved, at = np.zeros(2), start
    for stretch in range(NO_RETURN * count):
        motion = sound_run(model, at, STRETCH)
        some = crossings(motion, model.scene).only(direction)
        found.append(some.later(stretch * STRETCH))
        moved = moved + motion.contact_point[-1]
        at = Start(motion.attitude[-1], start.momentum)
        if sum(len(each.times) for each in found) >= count:
            return joined(found)[:count], (stretch + 1) * STRETCH, moved
    raise InputError(f"{LABEL.name}'s ball does not come back to the section")


def contact_cycle(
    model: Model, L: float, l: float, f: float, period: float, direction: int = 1
) -> ContactCycle:
    """The periodic motion that crosses g = 0 near (L, l) in a direction, once in about `period` s.

    Newton's method on MuJoCo's own map, whose derivative is from runs started a little apart.
    Raises InputError where that does not converge.
    """

    def mapped(point: Array) -> tuple[Array, float]:
        motion = sound_run(model, start_at(model, point[0], point[1], f), 1.2 * period)
        next_one = crossings(motion, model.scene).only(direction)
        if len(next_one.times) == 0:
            raise InputError(f"{LABEL.name}'s ball does not come back within {1.2 * period:g} s")
        return np.array([next_one.L[0], next_one.l[0]]), float(next_one.times[0])

    scale, point = np.array([np.sqrt(f), 1.0]), np.array([L, l])
    for _ in range(ITERATIONS):
        image, time = mapped(point)
        derivative = np.empty((2, 2))
        for i, step in enumerate(np.diag(NEAR * scale)):
            apart = mapped(point + step)[0] - mapped(point - step)[0]
            derivative[:, i] = _short(apart) / (2 * step[i])
        gap = _short(image - point)
        if np.abs(gap / scale).max() < CLOSED:
            multipliers = np.linalg.eigvals(derivative).astype(complex)
            return ContactCycle(float(point[0]), float(point[1]), time, multipliers)
        point = point - np.linalg.solve(derivative - np.eye(2), gap)
    raise InputError("no periodic motion of the contact model found near the start")


def _short(difference: Array) -> Array:
    """A difference (L, l) with the angle's part between -π and π."""
    L, l = difference
    return np.array([L, (l + np.pi) % (2 * np.pi) - np.pi])

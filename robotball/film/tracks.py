"""Motions at other times than their own."""

from dataclasses import replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, Slerp

from robotball.motion import Loads, Motion
from robotball.rotations import Array


def resampled(motion: Motion, times: Array) -> Motion:
    """`motion` at other times (m,) [s] within its own: attitude by slerp, the rest by splines."""
    inside = np.minimum(times, motion.times[-1])
    turn = Slerp(motion.times, Rotation.from_quat(motion.attitude, scalar_first=True))

    def at(column: Array) -> Array:
        return np.asarray(CubicSpline(motion.times, column)(inside))

    loads = motion.loads
    return replace(
        motion,
        times=times,
        contact_point=at(motion.contact_point),
        attitude=turn(inside).as_quat(scalar_first=True),
        momentum=at(motion.momentum),
        angular_velocity=at(motion.angular_velocity),
        hinge_angles=at(motion.hinge_angles),
        hinge_rates=at(motion.hinge_rates),
        loads=Loads(at(loads.contact_force), at(loads.spin_torque), at(loads.motor_torques)),
    )


def heading_of(points: Array) -> float:
    """The direction (rad) from the first of the points (m, 2) to the last."""
    travel = points[-1] - points[0]
    return float(np.arctan2(travel[1], travel[0]))

"""Motions at other times than their own, and where the bodies of their balls stand then."""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, Slerp

from robotball.motion import Loads, Motion
from robotball.rotations import Array


@dataclass(frozen=True)
class Track:
    """A motion to be asked at any times within its own: attitude by slerp, the rest by splines."""

    motion: Motion

    @cached_property
    def _turn(self) -> Slerp:
        return Slerp(self.motion.times, Rotation.from_quat(self.motion.attitude, scalar_first=True))

    @cached_property
    def _columns(self) -> CubicSpline:
        return CubicSpline(self.motion.times, np.column_stack(list(self._all.values())))

    @property
    def _all(self) -> dict[str, Array]:
        motion, loads = self.motion, self.motion.loads
        return {
            "contact_point": motion.contact_point,
            "momentum": motion.momentum,
            "angular_velocity": motion.angular_velocity,
            "hinge_angles": motion.hinge_angles,
            "hinge_rates": motion.hinge_rates,
            "contact_force": loads.contact_force,
            "spin_torque": loads.spin_torque[:, None],
            "motor_torques": loads.motor_torques,
        }

    def points(self, times: Array) -> Array:
        """The contact points (m, 2) at times (m,) [s]."""
        return np.asarray(self._columns(np.minimum(times, self.motion.times[-1]))[:, :2])

    def at(self, times: Array) -> Motion:
        """The motion at times (m,) [s]; after its end it stands still."""
        inside = np.minimum(times, self.motion.times[-1])
        widths = np.cumsum([column.shape[1] for column in self._all.values()])
        parts = np.split(self._columns(inside), widths[:-1], axis=1)
        named = dict(zip(self._all, parts, strict=True))
        return replace(
            self.motion,
            times=times,
            attitude=self._turn(inside).as_quat(scalar_first=True),
            contact_point=named["contact_point"],
            momentum=named["momentum"],
            angular_velocity=named["angular_velocity"],
            hinge_angles=named["hinge_angles"],
            hinge_rates=named["hinge_rates"],
            loads=Loads(named["contact_force"], named["spin_torque"][:, 0], named["motor_torques"]),
        )


def stands(motion: Motion) -> dict[str, tuple[Array, Array]]:
    """Where each body's looks stand: the turn (n, 3, 3) and the shift (n, 3), in radii, from the
    contact point's place on the floor.
    """
    scene, up = motion.scene, np.array([0.0, 0.0, 1.0])
    frame = Rotation.from_quat(motion.attitude, scalar_first=True)
    found = {"frame": (frame.as_matrix(), np.tile(up, (len(motion.times), 1)))}
    for index, hinge in enumerate(scene.hinges):
        # The frame is where it is; what turns by its hinge's angle is the shell, the other way.
        name, sign = ("shell", -1) if index == 0 else (hinge.name, 1)
        turn = Rotation.from_rotvec(np.outer(sign * motion.hinge_angles[:, index], hinge.axis))
        pivot = hinge.pivot / scene.ball.radius
        found[name] = (
            (frame * turn).as_matrix(),
            up + frame.apply(pivot - turn.apply(pivot)),
        )
    return found


def heading_of(points: Array) -> float:
    """The direction (rad) from the first of the points (m, 2) to the last."""
    travel = points[-1] - points[0]
    return float(np.arctan2(travel[1], travel[0]))

"""Motions at any times, and where the bodies of their balls stand then; plain data alone."""

from dataclasses import dataclass, fields
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, Slerp

from robotball.motion import Motion
from robotball.rotations import Array


@dataclass(frozen=True)
class Moments:
    """What a picture shows of a motion at m times; as in Motion and its loads."""

    contact_point: Array
    attitude: Array
    momentum: Array
    angular_velocity: Array
    hinge_angles: Array
    hinge_rates: Array
    contact_force: Array


@dataclass(frozen=True)
class Track:
    """A motion to be asked at any times (m,) [s]: attitude by slerp, the rest by splines.

    hinges: name, axis (3,) and pivot (3,), in radii, of each. After its end it stands still.
    """

    times: Array
    sampled: Moments
    radius: float
    hinges: tuple[tuple[str, Array, Array], ...]

    @cached_property
    def _turn(self) -> Slerp:
        return Slerp(self.times, Rotation.from_quat(self.sampled.attitude, scalar_first=True))

    @cached_property
    def _columns(self) -> dict[str, CubicSpline]:
        names = [each.name for each in fields(Moments) if each.name != "attitude"]
        return {name: CubicSpline(self.times, getattr(self.sampled, name)) for name in names}

    def points(self, times: Array) -> Array:
        """The contact points (m, 2) in radii."""
        inside = np.minimum(times, self.times[-1])
        return np.asarray(self._columns["contact_point"](inside) / self.radius)

    def at(self, times: Array) -> Moments:
        """What the motion is then."""
        inside = np.minimum(times, self.times[-1])
        return Moments(
            attitude=self._turn(inside).as_quat(scalar_first=True),
            **{name: np.asarray(spline(inside)) for name, spline in self._columns.items()},
        )

    def stands(self, then: Moments) -> dict[str, tuple[Array, Array]]:
        """Where each body's looks stand: the turn (m, 3, 3) and the shift (m, 3) in radii."""
        frame = Rotation.from_quat(then.attitude, scalar_first=True)
        ones = np.ones((len(then.attitude), 1))
        centre = np.concatenate([then.contact_point / self.radius, ones], axis=1)
        found = {"frame": (frame.as_matrix(), centre)}
        for index, (hung, axis, pivot) in enumerate(self.hinges):
            # The frame is where it is; what turns by its hinge's angle is the shell, the other way.
            name, sign = ("shell", -1) if index == 0 else (hung, 1)
            turn = Rotation.from_rotvec(np.outer(sign * then.hinge_angles[:, index], axis))
            shift = centre + frame.apply(pivot - turn.apply(pivot))
            found[name] = (np.asarray((frame * turn).as_matrix()), shift)
        return found


def track_of(motion: Motion) -> Track:
    """The track of a motion of two times at least."""
    ball = motion.scene.ball
    own = {each.name for each in fields(Moments)} - {"contact_force"}
    return Track(
        motion.times,
        Moments(
            **{name: getattr(motion, name) for name in own},
            contact_force=motion.loads.contact_force,
        ),
        ball.radius,
        tuple((each.name, each.axis, each.pivot / ball.radius) for each in motion.scene.hinges),
    )


def heading_of(points: Array) -> float:
    """The direction (rad) from the first of the points (m, 2) to the last."""
    travel = points[-1] - points[0]
    return float(np.arctan2(travel[1], travel[0]))

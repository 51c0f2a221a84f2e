"""Interpolate motions at any times, and place the bodies of their balls there.

Motions show themselves in notebooks by this module, and so are not imported by it.
"""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, Slerp

from robotball.robot.mechanics import Robot
from robotball.rotations import Array, rotation_matrix

# Samples on each side of those in question: the influence on a cubic spline of one so far away is
# below 1e-9.
_MARGIN = 16


@dataclass(frozen=True)
class Moments:
    """The part of a motion that a picture shows, at m times; fields as in Motion and its loads."""

    contact_point: Array
    attitude: Array
    momentum: Array
    angular_velocity: Array
    hinge_angles: Array
    hinge_rates: Array
    contact_force: Array

    def __getitem__(self, some: slice) -> "Moments":
        """Return some of the times."""
        return Moments(*(getattr(self, each.name)[some] for each in fields(Moments)))


@dataclass(frozen=True)
class Track:
    """A motion interpolated at any times: attitude by slerp, the rest by cubic splines.

    names: of the robot's bodies. After its end it stands still.
    """

    times: Array
    sampled: Moments
    names: tuple[str, ...]
    robot: Robot

    @property
    def points(self) -> Array:
        """The sampled contact points (n, 2) in radii."""
        return self.sampled.contact_point / self.robot.radius

    def at(self, times: Array) -> Moments:
        """Return the motion at ascending times (m,) [s]."""
        inside = np.minimum(times, self.times[-1])
        first, last = np.searchsorted(self.times, inside[[0, -1]])
        samples = slice(max(first - _MARGIN, 0), last + _MARGIN + 1)
        known, here = self.times[samples], vars(self.sampled[samples]).copy()
        # Splines of a quaternion's parts would leave the unit sphere.
        attitude = Rotation.from_quat(here.pop("attitude"), scalar_first=True)
        return Moments(
            attitude=Slerp(known, attitude)(inside).as_quat(scalar_first=True),
            **{name: np.asarray(CubicSpline(known, row)(inside)) for name, row in here.items()},
        )

    def sampled_at(self, times: Array) -> "Track":
        """Return the track resampled at ascending times (m,) [s]."""
        return replace(self, times=times, sampled=self.at(times))

    def stands(self, then: Moments) -> dict[str, tuple[Array, Array]]:
        """Return each body's rotation (m, 3, 3) and shift (m, 3) in radii."""
        to_world, radius = rotation_matrix(then.attitude), self.robot.radius
        centre = np.column_stack([then.contact_point / radius, np.ones(len(then.attitude))])
        turned, shifted = self.robot.moved(then.hinge_angles)
        shifts = centre + np.einsum("nij,bnj->bni", to_world, shifted / radius)
        return dict(zip(self.names, zip(to_world @ turned, shifts, strict=True), strict=True))


def track_of(motion: Any) -> Track:
    """Return the track of a `Motion` of at least two times."""
    own = {each.name for each in fields(Moments)} - {"contact_force", "momentum"}
    sampled = Moments(
        **{name: getattr(motion, name) for name in own},
        contact_force=motion.loads.contact_force,
        momentum=np.nan_to_num(motion.momentum),  # where it is unknown it has no arrow
    )
    names = tuple(link.name for link in motion.scene.ball.tree)
    return Track(motion.times, sampled, names, motion.scene.robot)


def heading_of(points: Array) -> float:
    """Return the direction [rad] from the first of the points (m, 2) to the last."""
    travel = points[-1] - points[0]
    return float(np.arctan2(travel[1], travel[0]))

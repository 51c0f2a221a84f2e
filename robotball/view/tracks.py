"""Interpolate motions at any times, and place the bodies of their balls there.

Not imported from `motion`, because motions are displayed in notebooks through this module.
"""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation, Slerp

from robotball.robot.mechanics import Robot
from robotball.rotations import Array, rotation_matrix

# Samples used on each side of the requested ones: the influence of a farther sample on a cubic
# spline is below 1e-9.
_MARGIN = 16


@dataclass(frozen=True)
class Moments:
    """The parts of a motion that a picture shows, at m times; fields as in Motion and Loads."""

    contact_point: Array
    attitude: Array
    momentum: Array
    angular_velocity: Array
    hinge_angles: Array
    hinge_rates: Array
    contact_force: Array

    def __getitem__(self, some: slice) -> "Moments":
        """Return a subset of the times."""
        return Moments(*(getattr(self, field.name)[some] for field in fields(Moments)))


@dataclass(frozen=True)
class Track:
    """A motion that can be interpolated: attitude by slerp, the rest with cubic splines.

    names: of the robot's bodies. After its last sample the motion is at rest.
    """

    times: Array
    sampled: Moments
    names: tuple[str, ...]
    robot: Robot

    @property
    def points(self) -> Array:
        """Sampled contact points (n, 2) in radii."""
        return self.sampled.contact_point / self.robot.radius

    def at(self, times: Array) -> Moments:
        """Return the motion at ascending times (m,) [s]."""
        inside = np.minimum(times, self.times[-1])
        first, last = np.searchsorted(self.times, inside[[0, -1]])
        samples = slice(max(first - _MARGIN, 0), last + _MARGIN + 1)
        known, here = self.times[samples], vars(self.sampled[samples]).copy()
        # Splines of quaternion components would leave the unit sphere.
        attitude = Rotation.from_quat(here.pop("attitude"), scalar_first=True)
        return Moments(
            attitude=Slerp(known, attitude)(inside).as_quat(scalar_first=True),
            **{name: np.asarray(CubicSpline(known, row)(inside)) for name, row in here.items()},
        )

    def sampled_at(self, times: Array) -> "Track":
        """Return the track resampled at ascending times (m,) [s]."""
        return replace(self, times=times, sampled=self.at(times))

    def stands(self, then: Moments) -> dict[str, tuple[Array, Array]]:
        """Return each body's rotation matrix (m, 3, 3) and translation (m, 3) in radii."""
        to_world, radius = rotation_matrix(then.attitude), self.robot.radius
        centre = np.column_stack([then.contact_point / radius, np.ones(len(then.attitude))])
        turned, shifted = self.robot.moved(then.hinge_angles)
        shifts = centre + np.einsum("nij,bnj->bni", to_world, shifted / radius)
        return dict(zip(self.names, zip(to_world @ turned, shifts, strict=True), strict=True))


def track_of(motion: Any) -> Track:
    """Return the track of a motion with at least two samples."""
    names = {field.name for field in fields(Moments)} - {"contact_force", "momentum"}
    sampled = Moments(
        **{name: getattr(motion, name) for name in names},
        contact_force=motion.loads.contact_force,
        momentum=np.nan_to_num(motion.momentum),  # no arrow if unknown
    )
    bodies = tuple(link.name for link in motion.scene.ball.tree)
    return Track(motion.times, sampled, bodies, motion.scene.robot)


def heading_of(points: Array) -> float:
    """Return the direction [rad] from the first of the points (m, 2) to the last."""
    travel = points[-1] - points[0]
    return float(np.arctan2(travel[1], travel[0]))

"""An orthographic view of space: points to the picture's plane, with their depth."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from robotball.rotations import Array


@dataclass(frozen=True)
class View:
    """Seen from far away: the viewer's azimuth from the first axis and height over it [degrees]."""

    azimuth: float
    elevation: float

    @cached_property
    def axes(self) -> Array:
        """(3, 3): the picture's right, its up, and the direction to the viewer."""
        turn, rise = np.radians([self.azimuth, self.elevation])
        toward = np.array([np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.sin(rise)])
        right = np.array([-np.sin(turn), np.cos(turn), 0.0])
        return np.stack([right, np.cross(toward, right), toward])

    def places(self, points: Array) -> Array:
        """Where points (..., 3) are in the picture, (..., 2)."""
        return points @ self.axes[:2].T

    def place(self, point: Array) -> tuple[float, float]:
        """Where a point (3,) is in the picture."""
        right, up = self.places(point).tolist()
        return right, up

    def depth(self, points: Array) -> Array:
        """How near points (..., 3) are to the viewer, (...,)."""
        return points @ self.axes[2]

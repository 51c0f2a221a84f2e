"""Where a picture is seen from."""

from dataclasses import dataclass

import numpy as np

from robotball.rotations import Array

LENS = 3.1  # the distance at which the picture's height is 2
NEAR, FAR = 0.1, 300.0
EDGE = 3  # pixels around what is framed


@dataclass(frozen=True)
class Camera:
    """Looks at a point (3,) from a distance, azimuth and elevation [rad]; lengths in radii."""

    look: Array
    distance: float
    azimuth: float
    elevation: float

    @property
    def back(self) -> Array:
        """From the point looked at to the eye (3,), a unit vector."""
        c = np.cos(self.elevation)
        return np.array(
            [c * np.cos(self.azimuth), c * np.sin(self.azimuth), np.sin(self.elevation)]
        )

    @property
    def eye(self) -> Array:
        return self.look + self.distance * self.back

    def matrix(self, width: int, height: int) -> Array:
        """From the world to GL's clip space (4, 4) of a picture of so many pixels."""
        right = np.array([-np.sin(self.azimuth), np.cos(self.azimuth), 0.0])
        axes = np.stack([right, np.cross(self.back, right), self.back])
        view = np.eye(4)
        view[:3, :3], view[:3, 3] = axes, -axes @ self.eye
        lens = LENS * min(1.0, width / height)
        deep = np.array([NEAR + FAR, 2 * NEAR * FAR]) / (NEAR - FAR)
        project = np.zeros((4, 4))
        project[0, 0], project[1, 1] = lens * height / width, lens
        project[2, 2:], project[3, 2] = deep, -1.0
        return np.asarray(project @ view, dtype=np.float32)

    def frame(self, points: Array, width: int, height: int) -> tuple[int, int, int, int]:
        """The part (x, y, width, height) of a picture in pixels that shows points (n, 3)."""
        clip = np.column_stack([points, np.ones(len(points))]) @ self.matrix(width, height).T
        if clip[:, 3].min() <= NEAR:
            return 0, 0, width, height
        at = (clip[:, :2] / clip[:, 3:] + 1) / 2 * [width, height]
        low = np.clip(np.floor(at.min(axis=0)) - EDGE, 0, [width - 1, height - 1]).astype(int)
        high = np.clip(np.ceil(at.max(axis=0)) + EDGE, low + 1, [width, height]).astype(int)
        return int(low[0]), int(low[1]), int(high[0] - low[0]), int(high[1] - low[1])

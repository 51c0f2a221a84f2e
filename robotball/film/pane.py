"""What a picture shows: balls, their paths and arrows, under a camera."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from robotball.film.camera import Camera
from robotball.rotations import Array

SUN = np.array([-0.35, 0.45, -1.0])
BOX = np.array(list(product((-1.05, 1.05), repeat=3)))  # around a ball


@dataclass(frozen=True)
class Drawn:
    """One ball in one picture; lengths in radii.

    colour  of its shell; stands  a (4, 4) matrix for each body; blurred  of each body, from 0, its
    marks are seen, to 1, it turns too fast for them; opacity  1, or less of a ghost
    """

    colour: str
    stands: Mapping[str, Array]
    blurred: Mapping[str, float]
    opacity: float = 1.0


@dataclass(frozen=True)
class Line:
    """A path's first `count` corners on the floor, of a strip that `Canvas.keep` has."""

    strip: str
    count: int
    colour: str
    opacity: float = 1.0


@dataclass(frozen=True)
class Loose:
    """Triangles (n, 6) where they are, as of an arrow."""

    corners: Array
    colour: str


@dataclass(frozen=True)
class Pane:
    """A picture: balls, lines and loose shapes under a camera."""

    camera: Camera
    balls: Sequence[Drawn]
    lines: Sequence[Line] = ()
    loose: Sequence[Loose] = ()


def around(pane: Pane) -> Array:
    """Corners (n, 3) of what holds balls, their shadows, and loose shapes."""
    around = []
    for ball in pane.balls:
        corners = BOX + ball.stands["shell"][:3, 3]
        around += [corners, corners - SUN * (corners[:, 2:] / SUN[2])]
    return np.concatenate([*around, *(each.corners[:, :3] for each in pane.loose)])

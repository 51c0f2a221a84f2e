"""The looks of a ball as shaded triangles, for drawings that need no OpenGL."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection

from robotball.film.triangles import triangles_of
from robotball.looks import BLUR, Shape, colours
from robotball.rotations import Array
from validation.figures.view import View

LIGHT = np.array([-0.4, -0.35, 0.85])  # where it comes from
SHADE = 0.55  # of the colour, on a face that is turned away from it


@dataclass(frozen=True)
class Solid:
    """The triangles (n, 3, 3) of a body in world axes, in radii, and their colours (n, 3)."""

    corners: Array
    colours: Array


def solid_of(shapes: Sequence[Shape], turn: Array, shift: Array) -> Solid:
    """A body's shapes turned (3, 3) and then shifted (3,), but for its glass and what blurs."""
    solid = [shape for shape in shapes if shape.material not in ("shell", BLUR)]
    corners = [triangles_of(shape)[:, :3].reshape(-1, 3, 3) for shape in solid]
    colour = [
        np.tile(colours()[shape.material][:3], (len(own), 1))
        for shape, own in zip(solid, corners, strict=True)
    ]
    return Solid(np.concatenate(corners) @ turn.T + shift, np.concatenate(colour))


def draw_solid(axes: Axes, view: View, solids: Sequence[Solid]) -> None:
    """The triangles of all, the farthest first, each in one shade."""
    corners = np.concatenate([solid.corners for solid in solids])
    plain = np.concatenate([solid.colours for solid in solids])
    edges = np.diff(corners, axis=1)
    normals = np.cross(edges[:, 0], edges[:, 1])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-300)
    lit = np.abs(normals @ (LIGHT / np.linalg.norm(LIGHT)))
    colours = plain * (SHADE + (1 - SHADE) * lit)[:, None]
    order = np.argsort(view.depth(corners).mean(axis=1))
    faces = view.places(corners)[order]
    axes.add_collection(
        PolyCollection(
            list(faces),
            facecolors=colours[order],
            edgecolors=colours[order],
            linewidths=0.4,
            zorder=2,
        )
    )

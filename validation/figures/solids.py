"""A posed MuJoCo model as shaded triangles, for drawings that need no OpenGL."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PolyCollection

from robotball.rotations import Array
from validation.figures.view import View

SIDES = 24  # of a round bar
LIGHT = np.array([-0.4, -0.35, 0.85])  # where it comes from
SHADE = 0.55  # of the colour, on a face that is turned away from it


@dataclass(frozen=True)
class Solid:
    """The triangles (n, 3, 3) of some geoms in world axes [m], and their colours (n, 3)."""

    corners: Array
    colours: Array


def solid_of(model: mujoco.MjModel, data: mujoco.MjData, prefix: str) -> Solid:
    """The geoms of all bodies whose names begin so, but for spheres and planes."""
    corners, colours = [], []
    for i in range(model.ngeom):
        if not model.body(model.geom_bodyid[i]).name.startswith(prefix):
            continue
        own = _triangles(model, i)
        if own is None:
            continue
        placed = own @ data.geom_xmat[i].reshape(3, 3).T + data.geom_xpos[i]
        corners.append(placed)
        colours.append(np.tile(model.mat_rgba[model.geom_matid[i], :3], (len(placed), 1)))
    return Solid(np.concatenate(corners), np.concatenate(colours).astype(float))


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


def _triangles(model: mujoco.MjModel, geom: int) -> Array | None:
    """A geom's surface (n, 3, 3) in its own axes; None for a sphere or a plane."""
    kind, size = mujoco.mjtGeom(model.geom_type[geom]), model.geom_size[geom]
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        vertices = model.mesh_vert[first : first + count].astype(float)
        first, count = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
        return vertices[model.mesh_face[first : first + count]]
    if kind in (mujoco.mjtGeom.mjGEOM_CYLINDER, mujoco.mjtGeom.mjGEOM_CAPSULE):
        turn = 2 * np.pi * np.arange(SIDES) / SIDES
        return _prism(size[0] * np.stack([np.cos(turn), np.sin(turn)], axis=1), size[1])
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return _prism(size[:2] * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]), size[2])
    return None


def _prism(base: Array, half: float) -> Array:
    """The surface (n, 3, 3) over a polygon (m, 2), from -half to half along z."""
    low, high = (np.column_stack([base, np.full(len(base), z)]) for z in (-half, half))
    following = np.roll(np.arange(len(base)), -1)
    sides = [
        np.stack([low, low[following], high], axis=1),
        np.stack([low[following], high[following], high], axis=1),
    ]
    ends = [
        np.stack([np.broadcast_to(end.mean(axis=0), end.shape), end, end[following]], axis=1)
        for end in (low, high)
    ]
    return np.concatenate([*sides, *ends])

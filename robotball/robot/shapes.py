"""Shapes of bodies: boxes, round shapes, tubes and meshes.

A shape comes from a geom of a MuJoCo model, a part of a scene file or a hand-written part. It is
converted to triangles for drawings without OpenGL, or to a geom of MJCF without mass and contact.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, Literal
from xml.etree.ElementTree import Element, SubElement
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from robotball.robot.ball import Value
from robotball.rotations import Array, from_matrix, multiply, rotation_matrix

Kind = Literal["torus", "sphere", "ellipsoid", "capsule", "cylinder", "box", "mesh"]

_ORIGIN = np.zeros(3)
# The kinds of MuJoCo's mjtGeom from number 2 on. The last is a mesh with a signed distance field.
_GEOMS: tuple[Kind, ...] = ("sphere", "capsule", "ellipsoid", "cylinder", "box", "mesh", "mesh")
_KINDS = dict(enumerate(_GEOMS, start=2))
_HIDDEN = 3  # the first group of geoms that MuJoCo's viewer hides
_UNCOLOURED = (0.5, 0.5, 0.5, 1.0)  # MuJoCo's default grey
_CELLS = 400.0  # initial cells along the longest side of a mesh that is thinned
_RESOLUTION = 48  # points around a torus, and around its tube
_AROUND, _SECTION = 48, 8  # steps about a shape's axis, and around a tube or a round end
_THIN = 12  # steps about the axis of a capsule or a small sphere


@dataclass(frozen=True)
class Shape(Value):
    """A shape of a body at joint angles 0, in the ball's axes, from the sphere's centre.

    Attributes
    ----------
    kind : str
    size : (3,)
        As in MJCF; 0 for a shape that is too thin to have a size. For a torus about z, the radius
        of the torus and the radius of its tube; for a mesh, factors of the vertices.
    pos : (3,)
        In the unit of the size: metres for a body, radii of the ball for a picture.
    turn : (4,)
        Quaternion.
    material : str
        A name, a colour "#rrggbbaa", or "" for the colour of the body.
    vertices : (v, 3)
        Vertices of a mesh.
    faces : (f, 3)
        Indices of the vertices of each triangle, anticlockwise.
    """

    kind: Kind
    size: Array
    pos: Array = field(default_factory=lambda: np.zeros(3))
    turn: Array = field(default_factory=lambda: np.array([1.0, 0.0, 0.0, 0.0]))
    material: str = ""
    vertices: Array = field(default_factory=lambda: np.empty((0, 3)))
    faces: NDArray[np.int64] = field(default_factory=lambda: np.empty((0, 3), np.int64))

    def moved(self, turn: Array, shift: Array = _ORIGIN, scale: float = 1.0) -> "Shape":
        """Return the shape scaled, rotated about the origin by a quaternion (4,), and shifted."""
        pos = shift + rotation_matrix(turn) @ self.pos * scale
        return replace(self, size=self.size * scale, pos=pos, turn=multiply(turn, self.turn))

    @cached_property
    def triangles(self) -> Array:
        """The triangles (n, 3, 3), with anticlockwise corners from outside."""
        return self._local @ rotation_matrix(self.turn).T + self.pos

    def encloses(self, points: Array) -> bool:
        """Return whether all points (n, 3) are in the bounding box along the shape's axes."""
        local = (points - self.pos) @ rotation_matrix(self.turn)
        corners = self._local.reshape(-1, 3)
        inside = (local >= corners.min(axis=0)) & (local <= corners.max(axis=0))
        return len(points) > 0 and bool(inside.all())

    @cached_property
    def _local(self) -> Array:
        if self.kind == "mesh":
            return np.asarray(self.vertices[self.faces] * self.size)
        return _triangles(self.kind, self.size)

    def thinned(self, most: int) -> "Shape":
        """Return a mesh with at most `most` triangles, by merging the vertices in each cell."""
        vertices, faces, cells = self.vertices, self.faces, _CELLS
        while len(faces) > most:
            low = self.vertices.min(axis=0)
            size = (self.vertices.max(axis=0) - low).max() / cells
            grid = np.round((self.vertices - low) / size)
            _, first, number = np.unique(grid, axis=0, return_index=True, return_inverse=True)
            vertices, faces = self.vertices[first], number.reshape(-1)[self.faces]
            faces = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
            cells *= 0.8
        return replace(self, vertices=vertices, faces=faces)


def tube(outer: float, inner: float, length: float) -> Shape:
    """Return a tube about z with its radii and full length; a wall of size 0 is drawn thin."""
    # Wall and length must not be 0, because triangles of area 0 have no normal.
    a, b, h = outer, min(inner, 0.98 * outer), max(length, 0.02 * outer) / 2
    section = np.array([(b, -h), (a, -h), (a, h), (b, h), (b, -h)])
    corners = _rotated_shape(section, _AROUND).reshape(-1, 3)
    # Triangles share their corners for smooth shading.
    vertices, numbers = np.unique(np.round(corners / a, 9), axis=0, return_inverse=True)
    return Shape("mesh", np.full(3, a), vertices=vertices, faces=numbers.reshape(-1, 3))


def shapes_of_geoms(model: Any, data: Any, bodies: Iterable[int]) -> Iterator[Shape]:
    """Yield the shapes of the geoms of bodies of a MuJoCo model, placed as in `data`; world [m].

    Geoms in groups that MuJoCo's viewer hides are left out if the bodies have other geoms. Planes,
    height fields, textures and fully transparent geoms are always left out.
    """
    geoms = np.flatnonzero(np.isin(model.geom_bodyid, list(bodies)))
    visible = geoms[model.geom_group[geoms] < _HIDDEN]
    for i in visible if len(visible) else geoms:
        rgba, material = model.geom_rgba[i], model.geom_matid[i]
        # The colour of a geom takes precedence over its material, unless the colour is the default.
        if material >= 0 and np.all(rgba == _UNCOLOURED):
            rgba = model.mat_rgba[material]
        kind = _KINDS.get(int(model.geom_type[i]))
        if kind is None or rgba[3] == 0:
            continue
        colour = "#" + bytes(np.round(255 * rgba).astype(np.uint8)).hex()
        place = data.geom_xpos[i].copy(), from_matrix(data.geom_xmat[i].reshape(3, 3)), colour
        if kind == "mesh":
            m = model.geom_dataid[i]
            vertices = model.mesh_vert[model.mesh_vertadr[m] :][: model.mesh_vertnum[m]]
            faces = model.mesh_face[model.mesh_faceadr[m] :][: model.mesh_facenum[m]]
            yield Shape(kind, np.ones(3), *place, vertices.astype(float), faces.astype(np.int64))
        else:
            yield Shape(kind, model.geom_size[i].copy(), *place)


def add_geoms(
    assets: Element, body: Element, shapes: Iterable[Shape], unit: float = 1.0, prefix: str = ""
) -> None:
    """Add shapes to a body of MJCF that has the same axes.

    unit: factor of lengths; prefix: put before the names of materials.
    """
    for shape in shapes:
        geom = SubElement(body, "geom", contype="0", conaffinity="0", mass="0")
        if shape.kind in ("torus", "mesh"):
            geom.attrib.update(type="mesh", mesh=_asset(assets, shape, unit))
        else:
            geom.attrib.update(type=shape.kind, size=_digits(shape.size * unit))
        geom.attrib.update(pos=_digits(shape.pos * unit), quat=_digits(shape.turn))
        geom.attrib["material"] = f"{prefix}{shape.material}"


def _asset(assets: Element, shape: Shape, unit: float) -> str:
    """Return the name of a shape's mesh. Add the mesh unless an equal shape already has it."""
    radius, tube, _ = shape.size
    if shape.kind == "torus":
        name, scale = f"ring_{radius:.4g}_{tube:.4g}", np.full(3, radius * unit)
        params = f"{_RESOLUTION} {tube / radius:.6g} 1 1"
        source = {"builtin": "supertorus", "params": params}
    else:
        vertices, faces = _digits(shape.vertices.ravel()), " ".join(map(str, shape.faces.ravel()))
        scale = shape.size * unit
        name = f"mesh_{crc32((vertices + faces + _digits(scale)).encode()):08x}"
        # Use the inertia of a shell, because a visual mesh may be open.
        source = {"vertex": vertices, "face": faces, "inertia": "shell"}
    if assets.find(f"mesh[@name='{name}']") is None:
        SubElement(assets, "mesh", {"name": name, "scale": _digits(scale), **source})
    return name


def _digits(numbers: Array) -> str:
    return " ".join(f"{number:.9g}" for number in numbers)


def _rotated_shape(section: Array, steps: int) -> Array:
    """Return the triangles (n, 3, 3) of a section (m, 2) of r and z, rotated about z."""
    # The angles are offset by half a step, so that the four sides of a box face its axes.
    angles = 2 * np.pi * (np.arange(steps + 1) + 0.5) / steps
    r, z = section.T
    grid = np.stack(
        [np.outer(np.cos(angles), r), np.outer(np.sin(angles), r), np.tile(z, (steps + 1, 1))],
        axis=2,
    )
    a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
    return np.stack([a, b, c, a, c, d], axis=-2).reshape(-1, 3, 3)


def _triangles(kind: Kind, size: Array) -> Array:
    """Return the triangles (n, 3, 3) of any shape except a mesh, in its axes."""
    a, b, _ = size
    if kind == "torus":
        turn = np.linspace(0.0, 2 * np.pi, _SECTION + 1)
        return _rotated_shape(np.column_stack([a + b * np.cos(turn), b * np.sin(turn)]), _AROUND)
    if kind in ("cylinder", "box"):
        # A box is a cylinder with four sides and a radius √2 times as large.
        r, steps = (1.0, _AROUND) if kind == "cylinder" else (np.sqrt(2), 4)
        section = np.array([(0.0, -1.0), (r, -1.0), (r, 1.0), (0.0, 1.0)])
        return _rotated_shape(section, steps) * ([a, a, b] if kind == "cylinder" else size)
    # Steps are visible only on the shell.
    large = kind != "capsule" and a > 0.5
    rise = np.linspace(-np.pi / 2, np.pi / 2, (2 if large else 1) * _SECTION + 1)
    section, steps = np.column_stack([np.cos(rise), np.sin(rise)]), _AROUND if large else _THIN
    if kind == "capsule":
        return _rotated_shape(a * section + np.outer(np.where(rise > 0, b, -b), [0, 1]), steps)
    return _rotated_shape(section, steps) * (a if kind == "sphere" else size)

"""Colours, and the simple shapes of each body, shared by films, models and pages.

The colours are Okabe and Ito's, which colour-blind readers distinguish, also in grey; each engine
has its own in its label. Shell, frame and rotors are the hand-written parts in mjcf/; a pendulum is
drawn from its numbers. Sizes are chosen so that no two parts touch: the frame's hoop is near the
shell, what turns inside it stays inside, and rotors with one centre are rings within rings. A frame
off balance has a weight on the side of its centre of mass. The shapes become MJCF with materials,
meshes and geoms that take no part in contact and have no mass.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import Literal, cast
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
from scipy.spatial.transform import Rotation

from robotball.robot import PARTS, Ball, Link, Pendulum
from robotball.rotations import Array, rotation_matrix, z_along

INK = "#22262B"  # text
ACCENT = "#D55E00"  # what the rest is held against
FAINT = "#B4B9BF"  # what stands behind
GHOST = 0.35  # opacity of a second ball that is drawn over the first


def rgb(colour: str) -> tuple[float, float, float]:
    """Return (red, green, blue), each 0 to 1, for a colour "#rrggbb"."""
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return red / 255, green / 255, blue / 255


# The materials that show a rotor's angle, and its disc when it turns too fast to be seen.
MARKS, BLUR = "spoke", "blur"
_HUB = ("capsule", "cylinder")  # the shapes inside a rotor's rim

# Lengths in radii of the ball.
INSIDE = 0.75  # bodies that turn in the frame's hoop reach no further
RIM = 0.61  # how far the part "rotor" reaches
_RING = 0.7  # the size of a ring over that of the ring around it
_LEAST = 0.06  # the smallest rotor, and the smallest bob, that can still be seen
_CORE = 0.28  # room for rotors at the centre where a pendulum swings around them
BOB, _ARM = 0.17, 0.035  # radii of a pendulum's bob and arm
HOOP, _OUTSIDE = 0.82, 0.96  # the frame's hoop, and how far out a weight on it reaches
_BALANCED = 0.01  # a frame whose centre of mass is nearer to the ball's has no weight
_TOGETHER = 0.05  # rotors whose centres are nearer are nested

_ORIGIN, _AS_IT_IS = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])

_Kind = Literal["torus", "sphere", "capsule", "cylinder", "box"]


@dataclass(frozen=True)
class Shape:
    """A shape of a body at hinge angle 0, in the frame's axes; lengths in radii of the ball.

    size      (3,)  as in MJCF; for a torus about z its radius and its tube's, then 0
    pos       (3,)  from the sphere's centre
    turn      (4,)  quaternion
    material  its name
    """

    kind: _Kind
    size: Array
    pos: Array
    turn: Array
    material: str


def looks_of(ball: Ball) -> dict[str, tuple[Shape, ...]]:
    """Return the shapes of each body by its name."""
    axis = ball.shell.axis
    looks = {"shell": _placed(_part("shell"), axis)}
    if ball.has_frame:
        looks["frame"] = _frame(ball)
    for (name, rotor), (size, inmost) in zip(ball.named_rotors, _rings(ball), strict=True):
        shapes = [each for each in _part("rotor") if inmost or each.kind not in _HUB]
        looks[name] = _placed(shapes, rotor.axis, size, rotor.centre / ball.radius)
    for name, pendulum in ball.named_pendulums:
        looks[name] = tuple(_pendulum(ball, pendulum))
    for link in ball.links:
        looks[link.name] = tuple(_pendulum(ball, link))
    return looks


@cache
def colours() -> dict[str, tuple[float, ...]]:
    """Return (red, green, blue, opacity), each 0 to 1, of the parts' materials by name."""
    return {
        material.attrib["name"]: tuple(map(float, material.attrib["rgba"].split()))
        for part in ("shell", "frame", "rotor")
        for material in ElementTree.parse(PARTS / f"{part}.xml").iter("material")
    }


def _rings(ball: Ball) -> Iterator[tuple[float, bool]]:
    """Yield each rotor's size, 1 for the part's own, and whether no other rotor is inside it."""
    centres = [rotor.centre / ball.radius for rotor in ball.rotors]
    for i, centre in enumerate(centres):
        away = [float(np.linalg.norm(centre - other)) for other in centres]
        before = sum(distance < _TOGETHER for distance in away[:i])
        after = sum(distance < _TOGETHER for distance in away[i + 1 :])
        room = [RIM, INSIDE - float(np.linalg.norm(centre))]
        # Half of the way for each of two neighbours, so that they do not touch.
        room += [distance / 2 for distance in away if distance >= _TOGETHER]
        if ball.pendulums:
            room.append(_CORE)
        yield max(_LEAST, min(room)) / RIM * _RING**before, after == 0


def _frame(ball: Ball) -> tuple[Shape, ...]:
    """Return the frame's shapes; off balance, the hoop is turned to carry a weight there."""
    part, axis, centre = _part("frame"), ball.shell.axis, ball.frame.centre / ball.radius
    off = float(np.linalg.norm(centre))
    if off < _BALANCED:
        return _placed(part, axis)
    across = Rotation.from_quat(z_along(axis), scalar_first=True).inv().apply(centre)
    hoop = _placed(part, axis, spin=float(np.arctan2(across[1], across[0])))
    return (*hoop, *_weight(ball, centre / off, off))


def _weight(ball: Ball, side: Array, off: float) -> Iterator[Shape]:
    """Yield a weight on an arm at the frame's centre of mass, or on the hoop above moving parts."""
    reach = INSIDE if ball.pendulums else 0.0
    for rotor, (size, _) in zip(ball.rotors, _rings(ball), strict=True):
        reach = max(reach, float(np.linalg.norm(rotor.centre)) / ball.radius + RIM * size)
    radius = min(BOB, (_OUTSIDE - reach) / 2)
    # Where nothing moves inside, the weight may sit at the centre of mass itself.
    place = _OUTSIDE - radius if reach else min(off, INSIDE - radius)
    yield Shape("sphere", np.array([radius, 0, 0]), place * side, _AS_IT_IS, "rotor")
    if not reach:
        arm = np.array([_ARM, (HOOP - place) / 2, 0.0])
        yield Shape("capsule", arm, side * (place + HOOP) / 2, z_along(side), "frame")


def _pendulum(ball: Ball, pendulum: Pendulum | Link) -> Iterator[Shape]:
    """Yield an arm from the hinge to a bob at the centre of mass, and the hinge's axle."""
    pivot, arm = pendulum.pivot / ball.radius, (pendulum.centre - pendulum.pivot) / ball.radius
    along = float(pivot @ pendulum.axis) * pendulum.axis
    # The farthest that the bob comes at any angle of the hinge.
    reach = float(np.linalg.norm(along) + np.linalg.norm(pivot - along) + np.linalg.norm(arm))
    arm = arm * min(1.0, (INSIDE - _LEAST) / reach) if reach > 0 else arm
    length = float(np.linalg.norm(arm))
    bob = float(np.clip(INSIDE - reach, _LEAST, BOB))
    yield Shape("sphere", np.array([bob, 0, 0]), pivot + arm, _AS_IT_IS, "rotor")
    axle = np.array([1.4 * _ARM, 4 * _ARM, 0.0])
    yield Shape("capsule", axle, pivot, z_along(pendulum.axis), "frame")
    begin = _CORE if ball.rotors else 0.0  # the rotors are in the way
    if length > begin:
        unit = arm / length
        size = np.array([_ARM, (length - begin) / 2, 0.0])
        yield Shape("capsule", size, pivot + unit * (begin + length) / 2, z_along(unit), "frame")


def _placed(
    shapes: Sequence[Shape],
    axis: Array,
    size: float = 1.0,
    centre: Array = _ORIGIN,
    spin: float = 0.0,
) -> tuple[Shape, ...]:
    """Turn a part's shapes from z to an axis (3,), scale them, and move them to a centre (3,).

    spin: the angle about that axis [rad].
    """
    turn = Rotation.from_quat(z_along(axis), scalar_first=True) * Rotation.from_rotvec([0, 0, spin])
    return tuple(
        replace(
            shape,
            size=shape.size * size,
            pos=centre + turn.apply(shape.pos * size),
            turn=(turn * Rotation.from_quat(shape.turn, scalar_first=True)).as_quat(
                scalar_first=True
            ),
        )
        for shape in shapes
    )


@cache
def _part(name: str) -> tuple[Shape, ...]:
    """Read the shapes of a hand-written part."""
    root = ElementTree.parse(PARTS / f"{name}.xml").getroot()
    meshes = {mesh.attrib["name"]: mesh for mesh in root.iter("mesh")}
    return tuple(_shape(geom, meshes) for geom in root.iterfind("worldbody/geom"))


def _shape(geom: ElementTree.Element, meshes: dict[str, ElementTree.Element]) -> Shape:
    kind, material = geom.get("type", "sphere"), geom.attrib["material"]
    numbers = {
        name: np.array([float(number) for number in geom.get(name, "0 0 0").split()])
        for name in ("size", "pos", "euler", "fromto")
    }
    size, pos = np.zeros(3), numbers["pos"]
    size[: len(numbers["size"])] = numbers["size"]
    turn = Rotation.from_euler("XYZ", numbers["euler"], degrees=True).as_quat(scalar_first=True)
    if "fromto" in geom.attrib:
        begin, end = numbers["fromto"].reshape(2, 3)
        length = float(np.linalg.norm(end - begin))
        size[1], pos, turn = length / 2, (begin + end) / 2, z_along((end - begin) / length)
    if kind == "mesh":
        mesh = meshes[geom.attrib["mesh"]]
        tube = float(mesh.attrib["params"].split()[1])
        radius = float(mesh.get("scale", "1").split()[0])
        return Shape("torus", np.array([1, tube, 0]) * radius, pos, turn, material)
    return Shape(cast(_Kind, kind), size, pos, turn, material)


_AROUND, _SECTION = 48, 8  # steps about a shape's axis, and around a tube or a round end
_THIN = 12  # steps about the axis of a capsule or a small sphere


def triangles_of(shape: Shape) -> Array:
    """Return the triangles (n, 3, 3) of a shape in the frame's axes; lengths in radii of the ball.

    They are for drawings without OpenGL. Seen from outside, corners run anticlockwise.
    """
    if shape.kind == "box":
        own = _box(shape.size)
    else:
        profile, steps = _profile(shape)
        angles = np.linspace(0.0, 2 * np.pi, steps + 1)
        r, z = profile.T
        grid = np.stack(
            [np.outer(np.cos(angles), r), np.outer(np.sin(angles), r), np.tile(z, (steps + 1, 1))],
            axis=2,
        )
        a, b, c, d = grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]
        own = np.stack([a, b, c, a, c, d], axis=-2).reshape(-1, 3, 3)
    return own @ rotation_matrix(shape.turn).T + shape.pos


def _profile(shape: Shape) -> tuple[Array, int]:
    """Return the section (m, 2) of a shape turned about z, as r and z, and its steps about z."""
    a, b, _ = shape.size
    if shape.kind == "torus":
        turn = np.linspace(0.0, 2 * np.pi, _SECTION + 1)
        return np.column_stack([a + b * np.cos(turn), b * np.sin(turn)]), _AROUND
    if shape.kind == "cylinder":
        return np.array([(0.0, -b), (a, -b), (a, b), (0.0, b)]), _AROUND
    # Only the shell is so large that its steps would be seen.
    large = shape.kind == "sphere" and a > 0.5
    rise = np.linspace(-np.pi / 2, np.pi / 2, (2 if large else 1) * _SECTION + 1)
    side = b * np.where(rise > 0, 1, -1)  # a sphere's is 0
    return np.column_stack([a * np.cos(rise), a * np.sin(rise) + side]), _AROUND if large else _THIN


def _box(size: Array) -> Array:
    corners = []
    square = np.array([(-1, -1), (1, -1), (1, 1), (-1, -1), (1, 1), (-1, 1)])
    for axis in range(3):
        for side in (-1, 1):
            face = np.full((6, 3), side)
            # The far side's corners run the other way round, anticlockwise from outside as well.
            face[:, [(axis + 1) % 3, (axis + 2) % 3]] = square[::side]
            corners.append(face * size)
    return np.reshape(corners, (-1, 3, 3))


_RESOLUTION = 48  # points around a torus, and around its tube
_BLUR_GROUP = "3"  # hidden until a picture asks for it


def add_materials(
    assets: Element,
    own: Mapping[str, str] | None = None,
    prefix: str = "",
    opacity: float = 1.0,
) -> None:
    """Add the parts' materials; own: "r g b" for those that have another colour here."""
    for name, (red, green, blue, solid) in colours().items():
        rgb = (own or {}).get(name, f"{red:g} {green:g} {blue:g}")
        SubElement(
            assets,
            "material",
            name=f"{prefix}{name}",
            rgba=f"{rgb} {solid * opacity:g}",
            specular="0.4",
            shininess="0.6",
        )


def add_shapes(
    assets: Element,
    body: Element,
    shapes: Iterable[Shape],
    unit: float = 1.0,
    prefix: str = "",
) -> None:
    """Add shapes to a body that has the same axes; unit: the ball's radius [m]."""
    for shape in shapes:
        geom = SubElement(body, "geom", contype="0", conaffinity="0", mass="0")
        if shape.kind == "torus":
            radius, tube, _ = shape.size
            name = f"ring_{radius:.4g}_{tube:.4g}"
            # Rings of one size share a mesh, which has thousands of triangles.
            if assets.find(f"mesh[@name='{name}']") is None:
                SubElement(
                    assets,
                    "mesh",
                    name=name,
                    builtin="supertorus",
                    params=f"{_RESOLUTION} {tube / radius:.6g} 1 1",
                    scale=_text(np.full(3, radius * unit)),
                )
            geom.attrib.update(type="mesh", mesh=name)
        else:
            geom.attrib.update(type=shape.kind, size=_text(shape.size * unit))
        geom.attrib.update(
            pos=_text(shape.pos * unit),
            quat=_text(shape.turn),
            material=f"{prefix}{shape.material}",
        )
        if shape.material == BLUR:
            geom.set("group", _BLUR_GROUP)


def _text(numbers: Array) -> str:
    return " ".join(f"{number:.9g}" for number in numbers)

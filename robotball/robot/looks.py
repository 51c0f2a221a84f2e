"""Colours and shapes of bodies in films, models and pages.

A body that has shapes, from parts or from a user's model, is drawn with these shapes. A body that
has only numbers is drawn as a symbol. The symbols of shell, frame and rotor are the hand-written
parts in mjcf/. The symbol of a pendulum or link is the box with the same inertia, on an arm.

The sizes of symbols are chosen so that symbols do not touch: the frame's hoop is near the shell,
bodies that turn inside the hoop stay inside, and rotors with the same centre are nested rings. An
unbalanced frame has a weight on the side of its centre of mass. The shell is always glass, with
bands that make its rolling visible.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import cast
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from robotball.robot.ball import PARTS, Ball, Body, Frame, Link, Pendulum, Rotor, Shell
from robotball.robot.shapes import Kind, Shape
from robotball.rotations import Array, from_matrix, multiply, rotation_matrix, turned, z_along

INK = "#22262B"  # text
ACCENT = "#D55E00"  # the reference
FAINT = "#B4B9BF"  # the background
GHOST = 0.35  # opacity of a ball that is drawn over other balls
# Materials of a rotor's marks, and of the rotor's disc if the marks turn too fast to be visible.
MARKS, BLUR = "spoke", "blur"
_HUB = ("capsule", "cylinder")  # the shapes inside a rotor's rim

# Lengths in units of the ball's radius.
_INSIDE = 0.75  # outer radius of bodies that turn in the frame's hoop
_RIM = 0.61  # outer radius of the part "rotor"
_RING = 0.7  # size ratio of nested rings
_LEAST = 0.06  # smallest visible rotor or box
_CORE = 0.28  # space for rotors at the centre if there are pendulums
_ARM, _HINGE = 0.035, 0.14  # radius of a pendulum's arm, and half of the length of its hinge
_OUTSIDE = 0.96  # outer radius of a weight on the frame's hoop
_BALANCED = 0.01  # a frame with a smaller offset has no weight
_TOGETHER = 0.05  # rotors are nested if the distance of their centres is smaller

_ORIGIN, _NO_TURN = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
_AXLE, _POLE = 0.02, 0.97  # radius of the axle of a frame with parts, and half of its length
_THIN = 0.012  # size with which a shape without a size is drawn
_SAME = 0.02  # a sphere of the shell's parts that differs by less is the shell itself
_GLASS = "26"  # opacity, at the end of a colour, of a user's part that encloses others
_INERTIA = "#f2c23399"  # the box of a body that has a mass but no shape

Looks = Mapping[str, Sequence[Shape]]


def rgb(colour: str) -> tuple[float, float, float]:
    """Return (red, green, blue), each 0 to 1, for a colour "#rrggbb"."""
    red, green, blue = bytes.fromhex(colour.removeprefix("#"))
    return red / 255, green / 255, blue / 255


def looks_of(ball: Ball) -> dict[str, tuple[Shape, ...]]:
    """Return the shapes of each body by body name, in units of the ball's radius.

    A user's shape is transparent if it encloses another body completely, or if it belongs to the
    shell and encloses the centre of another body.
    """
    rings = _rings(ball)
    looks = {name: tuple(_look(ball, body, rings)) for name, body in ball.named_bodies}
    corners = {
        name: np.concatenate([shape.triangles.reshape(-1, 3) for shape in shapes])
        for name, shapes in looks.items()
        if shapes and name != "shell"
    }

    def drawn(name: str, shape: Shape) -> Shape:
        others = [points for other, points in corners.items() if other != name]
        if name == "shell":  # an axle may extend through a hull
            others = [points.mean(axis=0, keepdims=True) for points in others]
        if shape.material.startswith("#") and any(map(shape.encloses, others)):
            return replace(shape, material=shape.material[:7] + min(shape.material[7:], _GLASS))
        return shape

    return {name: tuple(drawn(name, shape) for shape in shapes) for name, shapes in looks.items()}


def _look(ball: Ball, body: Body, rings: Iterator[tuple[float, bool]]) -> Iterator[Shape]:
    """Yield a body's shapes, then symbols for features that the shapes do not show.

    rings: an iterator; each rotor takes the next ring.
    """
    radius, axis = ball.radius, ball.shell.axis
    colour = _hex("frame" if isinstance(body, Shell | Frame) else "rotor")
    built = [
        replace(
            shape,
            pos=shape.pos / radius,
            size=np.where((shape.size == 0) & (not shape.material), _THIN, shape.size / radius),
            material=shape.material or colour,
        )
        for shape in body.shapes
    ]
    # The glass sphere replaces the sphere that rolls, and visual copies of that sphere.
    yield from (shape for shape in built if not (isinstance(body, Shell) and _is_the_ball(shape)))
    match body:
        case Shell():
            part = [s for s in _part("shell") if ball.has_frame or s.kind != "cylinder"]
            yield from _placed(part, axis)
        case Frame():
            yield from [_rod(-_POLE * axis, _POLE * axis, _AXLE)] if built else _frame(ball)
        case Rotor():
            size, inmost = next(rings)
            part = [s for s in _part("rotor") if inmost or s.kind not in _HUB]
            ring = _placed(part, body.axis, size, body.centre / radius)
            yield from [_bar(built, body, radius)] if built else ring
        case Pendulum() | Link():
            pivot, centre = body.pivot / radius, body.centre / radius
            if not built and body.mass:
                yield _inertia_box(body, radius)
                yield _rod(pivot, centre, _ARM)
            if isinstance(body, Pendulum):
                yield _rod(pivot - _HINGE * body.axis, pivot + _HINGE * body.axis, 1.4 * _ARM)


def _is_the_ball(shape: Shape) -> bool:
    """Return whether a shape is a sphere with the ball's size and position, within 2 %."""
    off = max(float(np.linalg.norm(shape.pos)), abs(float(shape.size[0]) - 1))
    return shape.kind == "sphere" and off < _SAME


def _rod(begin: Array, end: Array, radius: float) -> Shape:
    length = float(np.linalg.norm(end - begin))
    turn = z_along((end - begin) / length) if length else _NO_TURN
    return Shape("capsule", np.array([radius, length / 2, 0.0]), (begin + end) / 2, turn, "frame")


def _bar(built: Sequence[Shape], rotor: Rotor, radius: float) -> Shape:
    """Return a bar from a rotor's axis to its rim, which marks its angle on both faces."""
    centre, turn = rotor.centre / radius, z_along(rotor.axis)
    corners = np.concatenate([shape.triangles.reshape(-1, 3) for shape in built])
    local = (corners - centre) @ rotation_matrix(turn)
    rim, high = float(np.hypot(*local.T[:2]).max()), float(np.abs(local[:, 2]).max())
    size = np.array([rim / 2, 0.05 * rim, high + 0.01 * rim])
    at = centre + rotation_matrix(turn) @ [rim / 2, 0.0, 0.0]
    return Shape("box", size, at, turn, MARKS)


def _inertia_box(body: Pendulum | Link, radius: float) -> Shape:
    """Return the homogeneous box with a body's mass and moments."""
    moments, axes = np.linalg.eigh(body.inertia / body.mass)
    size = np.sqrt(np.maximum(1.5 * (moments.sum() - 2 * moments), 0.0)) / radius
    turn = from_matrix(axes * np.sign(np.linalg.det(axes)))  # eigh may return a reflection
    return Shape("box", np.maximum(size, _LEAST / 2), body.centre / radius, turn, _INERTIA)


def materials_of(looks: Looks) -> dict[str, tuple[float, ...]]:
    """Return the colours of all materials by name, see `_rgba_of`."""
    used = sorted({shape.material for shapes in looks.values() for shape in shapes})
    return {name: _rgba_of(name) for name in used}


def _rgba_of(material: str) -> tuple[float, ...]:
    """Return (red, green, blue, opacity), each 0 to 1, of a material or a colour "#rrggbbaa"."""
    if material in colours():
        return colours()[material]
    return (*rgb(material[:7]), int(material[7:], 16) / 255)


def _hex(material: str) -> str:
    return "#" + bytes(round(255 * part) for part in colours()[material]).hex()


@cache
def colours() -> dict[str, tuple[float, ...]]:
    """Return (red, green, blue, opacity), each 0 to 1, of hand-written materials by name."""
    return {
        material.attrib["name"]: tuple(map(float, material.attrib["rgba"].split()))
        for part in ("shell", "frame", "rotor")
        for material in ElementTree.parse(PARTS / f"{part}.xml").iter("material")
    }


def _rings(ball: Ball) -> Iterator[tuple[float, bool]]:
    """Yield each rotor's size relative to its part, and whether no other rotor is inside it."""
    centres = [rotor.centre / ball.radius for rotor in ball.rotors]
    for i, centre in enumerate(centres):
        away = [float(np.linalg.norm(centre - other)) for other in centres]
        before = sum(distance < _TOGETHER for distance in away[:i])
        after = sum(distance < _TOGETHER for distance in away[i + 1 :])
        room = [_RIM, _INSIDE - float(np.linalg.norm(centre))]
        # Each of two neighbours gets half of their distance, so that they do not touch.
        room += [distance / 2 for distance in away if distance >= _TOGETHER]
        if ball.pendulums:
            room.append(_CORE)
        yield max(_LEAST, min(room)) / _RIM * _RING**before, after == 0


def _frame(ball: Ball) -> tuple[Shape, ...]:
    """Return the frame's shapes, with a weight on the side of its centre of mass."""
    part, axis, centre = _part("frame"), ball.shell.axis, ball.frame.centre / ball.radius
    off = float(np.linalg.norm(centre))
    if off < _BALANCED:
        return _placed(part, axis)
    across = rotation_matrix(z_along(axis)).T @ centre
    hoop = _placed(part, axis, spin=float(np.arctan2(across[1], across[0])))
    # Rotors at the centre leave more space than other bodies.
    elsewhere = ball.pendulums or any(rotor.centre.any() for rotor in ball.rotors)
    size = (_OUTSIDE - (_INSIDE if elsewhere else _RIM)) / 2
    at = (_OUTSIDE - size) * centre / off
    return (*hoop, Shape("sphere", np.array([size, 0.0, 0.0]), at, _NO_TURN, "rotor"))


def _placed(
    shapes: Sequence[Shape],
    axis: Array,
    size: float = 1.0,
    centre: Array = _ORIGIN,
    spin: float = 0,
) -> tuple[Shape, ...]:
    """Rotate a part's shapes from z to an axis (3,), scale them, and move them to a centre (3,).

    spin: the angle about that axis [rad].
    """
    turn = multiply(z_along(axis), np.array([np.cos(spin / 2), 0.0, 0.0, np.sin(spin / 2)]))
    return tuple(shape.moved(turn, centre, size) for shape in shapes)


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
        for name in ("size", "pos", "euler")
    }
    size, pos = np.zeros(3), numbers["pos"]
    size[: len(numbers["size"])] = numbers["size"]
    turn = np.array([1.0, 0.0, 0.0, 0.0])
    for axis, angle in zip(np.eye(3), np.radians(numbers["euler"]), strict=True):
        turn = turned(turn, angle * axis)
    if kind == "mesh":
        mesh = meshes[geom.attrib["mesh"]]
        tube = float(mesh.attrib["params"].split()[1])
        radius = float(mesh.get("scale", "1").split()[0])
        return Shape("torus", np.array([1, tube, 0]) * radius, pos, turn, material)
    return Shape(cast(Kind, kind), size, pos, turn, material)


def add_materials(
    assets: Element,
    looks: Looks,
    own: Mapping[str, str] | None = None,
    prefix: str = "",
    opacity: float = 1.0,
) -> None:
    """Add the materials of shapes. own: "r g b" for the materials that have another colour here."""
    for name, (red, green, blue, solid) in materials_of(looks).items():
        rgb = (own or {}).get(name, f"{red:g} {green:g} {blue:g}")
        look = {"rgba": f"{rgb} {solid * opacity:g}", "specular": "0.4", "shininess": "0.6"}
        SubElement(assets, "material", {"name": f"{prefix}{name}", **look})

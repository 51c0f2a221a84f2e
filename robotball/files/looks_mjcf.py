"""The shapes of a ball as MJCF: materials, meshes and geoms that only pictures see."""

from collections.abc import Iterable, Mapping
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from robotball.looks import BLUR, Shape, colours
from robotball.rotations import Array

RESOLUTION = 48  # of a torus: points around it, and around its tube
BLUR_GROUP = "3"  # hidden until a picture asks for it


def add_materials(
    assets: Element,
    own: Mapping[str, str] | None = None,
    prefix: str = "",
    opacity: float = 1.0,
) -> None:
    """Adds the parts' materials; own: "r g b" of those that have another colour here."""
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
    """Adds shapes to a body whose axes are theirs; unit: the ball's radius [m]."""
    for shape in shapes:
        geom = SubElement(body, "geom", contype="0", conaffinity="0", mass="0")
        if shape.kind == "torus":
            radius, tube, _ = shape.size
            name = f"ring_{radius:.4g}_{tube:.4g}"
            if assets.find(f"mesh[@name='{name}']") is None:
                SubElement(
                    assets,
                    "mesh",
                    name=name,
                    builtin="supertorus",
                    params=f"{RESOLUTION} {tube / radius:.6g} {shape.profile:g} 1",
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
            geom.set("group", BLUR_GROUP)


def _text(numbers: Array) -> str:
    return " ".join(f"{number:.9g}" for number in numbers)

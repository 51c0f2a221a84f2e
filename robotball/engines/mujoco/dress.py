"""A model dressed for a picture: its bodies' shapes, floor, lights and a camera that follows it.

Nothing is added that a step depends on, so a dressed model moves as the bare one does.
"""

from dataclasses import replace
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import mujoco
from scipy.spatial.transform import Rotation

from robotball.film.looks import BLUR, Shape, add_materials, add_shapes, looks_of
from robotball.robot import PARTS, Ball
from robotball.rotations import Array

# In radii of the ball.
CAMERA, EXTENT, SUN, TILE = "0 -5 2", 4.0, 12.0, 0.5


def dress(xml: str, ball: Ball) -> str:
    """Return the MJCF text of a bare model of `ball` with all that a picture needs."""
    root, unit = ElementTree.fromstring(xml), ball.radius
    floor = ElementTree.parse(PARTS / "floor.xml").getroot()
    worldbody, assets = _child(root, "worldbody"), Element("asset")
    assets.extend(_child(floor, "asset"))
    _child(assets, "material").set("texrepeat", f"{TILE / unit:g} {TILE / unit:g}")
    _child(worldbody, "geom").set("material", "floor")
    add_materials(assets)
    looks, stands = looks_of(ball), _stands(xml)
    for body in worldbody.iter("body"):
        shapes = [each for each in looks[body.attrib["name"]] if each.material != BLUR]
        if (sphere := body.find("geom")) is not None:  # the shell's, which the model has
            sphere.set("material", "shell")
            shapes = [each for each in shapes if each.material != "shell"]
        stand = stands[body.attrib["name"]]
        add_shapes(assets, body, [_seen_from(stand, unit, each) for each in shapes], unit)
    ball_body, sun = _child(worldbody, "body"), _child(_child(floor, "worldbody"), "light")
    place = " ".join(f"{float(part) * unit:g}" for part in CAMERA.split())
    SubElement(ball_body, "camera", name="track", mode="trackcom", pos=place, xyaxes="1 0 0 0 2 5")
    sun.attrib.update(mode="trackcom", pos=f"0 0 {SUN * unit:g}")
    ball_body.append(sun)
    size = Element("statistic", center=f"0 0 {unit:g}", extent=f"{EXTENT * unit:g}")
    place_of_world = list(root).index(worldbody)
    root[place_of_world:place_of_world] = [size, _child(floor, "visual"), assets]
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _child(element: Element, tag: str) -> Element:
    found = element.find(tag)
    assert found is not None
    return found


def _stands(xml: str) -> dict[str, tuple[Array, Rotation]]:
    """Return each body's own axes as seen from the sphere's centre [m], with all hinges at 0."""
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    data.qpos[:] = 0
    data.qpos[3] = 1
    mujoco.mj_kinematics(model, data)
    centre = data.body("shell").xpos
    return {
        model.body(i).name: (
            data.xpos[i] - centre,
            Rotation.from_quat(data.xquat[i], scalar_first=True),
        )
        for i in range(1, model.nbody)
    }


def _seen_from(stand: tuple[Array, Rotation], unit: float, shape: Shape) -> Shape:
    """Return the shape in a body's own axes."""
    origin, turn = stand
    own = turn.inv() * Rotation.from_quat(shape.turn, scalar_first=True)
    return replace(
        shape,
        pos=turn.inv().apply(shape.pos - origin / unit),
        turn=own.as_quat(scalar_first=True),
    )

"""A scene's bodies and hinges as URDF and as SDF."""

from xml.etree.ElementTree import Element, SubElement

import numpy as np
from scipy.spatial.transform import Rotation

from robotball.engines.links import SHELL, Link, links_of
from robotball.files.export.mjcf_text import MARGIN, numbers, xml_text
from robotball.files.export.plain import friction_needed
from robotball.mechanics.poses import poses
from robotball.motion import Motion
from robotball.rotations import Array
from robotball.scene import Scene

FASTEST, STRONGEST = "1e6", "1e9"  # limits that limit nothing


def urdf(scene: Scene) -> str:
    """The URDF of a scene's ball; it has no place for the plane, the start, rates and friction."""
    root = Element("robot", name=scene.name)
    links = links_of(scene)
    for link in links:
        element = SubElement(root, "link", name=link.name)
        inertial = SubElement(element, "inertial")
        SubElement(inertial, "origin", xyz=numbers(link.centre), rpy="0 0 0")
        SubElement(inertial, "mass", value=repr(float(link.mass)))
        SubElement(inertial, "inertia", _moments(link.inertia))
        if link.parent == SHELL:
            collision = SubElement(element, "collision")
            geometry = SubElement(collision, "geometry")
            SubElement(geometry, "sphere", radius=repr(float(scene.ball.radius)))
    for link in links:
        if link.parent != SHELL:
            joint = SubElement(root, "joint", name=f"{link.name}_hinge", type="continuous")
            SubElement(joint, "parent", link=links[link.parent].name)
            SubElement(joint, "child", link=link.name)
            SubElement(joint, "origin", xyz=numbers(link.origin), rpy="0 0 0")
            SubElement(joint, "axis", xyz=numbers(link.axis))
            SubElement(joint, "limit", velocity=FASTEST, effort=STRONGEST)
    return xml_text(root)


def sdf(motion: Motion) -> str:
    """The SDF world of a motion's scene, its pose at the start; it has no place for velocities.

    Hinges are at angle 0, and their rates are left to who simulates it.
    """
    scene = motion.scene
    root = Element("sdf", version="1.9")
    world = SubElement(root, "world", name=scene.name)
    _text(world, "gravity", numbers(scene.gravity * np.array(scene.gravity_direction)))
    needed = friction_needed(motion)
    plane = SubElement(world, "model", name="plane")
    _text(plane, "static", "true")
    ground = SubElement(SubElement(plane, "link", name="plane"), "collision", name="plane")
    shape = SubElement(SubElement(ground, "geometry"), "plane")
    _text(shape, "normal", "0 0 1")
    _text(shape, "size", "100 100")  # of its picture, without which PyBullet reads no plane
    _surface(ground, needed["sliding"], needed["torsional"])
    ball = SubElement(world, "model", name="ball")
    shell = poses(motion)["shell"]
    angles = Rotation.from_quat(shell.attitude[0], scalar_first=True).as_euler("xyz")
    _text(ball, "pose", numbers([0.0, 0.0, scene.ball.radius, *angles]))
    links = links_of(scene)
    places: list[Array] = []
    for link in links:
        above = np.zeros(3) if link.parent == SHELL else places[link.parent]
        places.append(above + link.origin)
        _link(ball, link, places[-1], scene.ball.radius, needed)
    for link in links:
        if link.parent != SHELL:
            joint = SubElement(ball, "joint", name=f"{link.name}_hinge", type="continuous")
            _text(joint, "parent", links[link.parent].name)
            _text(joint, "child", link.name)
            _text(SubElement(joint, "axis"), "xyz", numbers(link.axis))
    return xml_text(root)


def _link(ball: Element, link: Link, place: Array, radius: float, needed: dict[str, float]) -> None:
    element = SubElement(ball, "link", name=link.name)
    _text(element, "pose", numbers([*place, 0.0, 0.0, 0.0]))
    inertial = SubElement(element, "inertial")
    _text(inertial, "pose", numbers([*link.centre, 0.0, 0.0, 0.0]))
    _text(inertial, "mass", repr(float(link.mass)))
    inertia = SubElement(inertial, "inertia")
    for name, value in _moments(link.inertia).items():
        _text(inertia, name, value)
    if link.parent == SHELL:
        collision = SubElement(element, "collision", name="sphere")
        _text(
            SubElement(SubElement(collision, "geometry"), "sphere"), "radius", repr(float(radius))
        )
        _surface(collision, needed["sliding"], needed["torsional"])


def _surface(collision: Element, sliding: float, torsional: float) -> None:
    friction = SubElement(SubElement(collision, "surface"), "friction")
    ode = SubElement(friction, "ode")
    for name in ("mu", "mu2"):
        _text(ode, name, repr(MARGIN * sliding))
    if torsional:
        # Its torque is 3π/16 · coefficient · patch radius · normal force; the radius is 1 m here.
        spin = SubElement(friction, "torsional")
        _text(spin, "use_patch_radius", "true")
        _text(spin, "patch_radius", "1.0")
        _text(spin, "coefficient", repr(MARGIN * torsional * 16 / (3 * np.pi)))


def _moments(inertia: Array) -> dict[str, str]:
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia.tolist()
    names = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    return dict(zip(names, map(repr, (xx, yy, zz, xy, xz, yz)), strict=True))


def _text(parent: Element, name: str, text: str) -> None:
    SubElement(parent, name).text = text

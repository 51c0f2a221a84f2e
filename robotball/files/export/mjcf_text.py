"""A scene as plain MJCF: bodies, hinges, contact and start, without any engine's recipe."""

from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from robotball.engines.links import SHELL, links_of
from robotball.files.export.plain import friction_needed
from robotball.mechanics.poses import poses
from robotball.motion import Motion
from robotball.rotations import Array, rotation_matrix

MARGIN = 1.5  # times the friction that the motion needs


def numbers(values: Array | list[float]) -> str:
    """Numbers with all their digits."""
    return " ".join(repr(float(value)) for value in values)


def xml_text(root: Element) -> str:
    """An indented document."""
    indent(root)
    return tostring(root, encoding="unicode")


def mjcf(motion: Motion) -> str:
    """The MJCF of a reference motion's scene, its start as the keyframe `start`.

    It cannot say how the hinges are driven: their motors are left to who simulates it.
    """
    scene = motion.scene
    root = Element("mujoco", model=scene.name)
    gravity = scene.gravity * np.array(scene.gravity_direction)
    SubElement(root, "option", gravity=numbers(gravity))
    world = SubElement(root, "worldbody")
    needed = friction_needed(motion)
    friction = [MARGIN * needed["sliding"], MARGIN * needed["torsional"], 0.0]
    condim = "4" if scene.rolling == "rubber" else "3"
    contact = {"friction": numbers(friction), "condim": condim}
    SubElement(world, "geom", {"name": "floor", "type": "plane", "size": "0 0 1", **contact})
    bodies: list[Element] = []
    for link in links_of(scene):
        parent = world if link.parent == SHELL else bodies[link.parent]
        origin = [0.0, 0.0, scene.ball.radius] if link.parent == SHELL else link.origin
        body = SubElement(parent, "body", name=link.name, pos=numbers(origin))
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = link.inertia
        SubElement(
            body,
            "inertial",
            pos=numbers(link.centre),
            mass=repr(float(link.mass)),
            fullinertia=numbers([xx, yy, zz, xy, xz, yz]),
        )
        if link.parent == SHELL:
            SubElement(body, "freejoint", name=link.name)
            sphere = {"name": "sphere", "type": "sphere", "size": repr(float(scene.ball.radius))}
            SubElement(body, "geom", {**sphere, "mass": "0", **contact})
        else:
            SubElement(body, "joint", name=link.name, type="hinge", axis=numbers(link.axis))
        bodies.append(body)
    shell = poses(motion)["shell"]
    hinges = scene.hinges
    centre = [0.0, 0.0, scene.ball.radius]
    turning = rotation_matrix(shell.attitude[0]).T @ shell.angular_velocity[0]
    velocity = np.cross(shell.angular_velocity[0], centre)
    keyframe = SubElement(root, "keyframe")
    qpos = [*centre, *shell.attitude[0], *(hinge.angle for hinge in hinges)]
    qvel = [*velocity, *turning, *(hinge.rate for hinge in hinges)]
    SubElement(keyframe, "key", name="start", qpos=numbers(qpos), qvel=numbers(qvel))
    return xml_text(root)

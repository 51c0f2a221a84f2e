"""Export a scene for other simulators: a folder with JSON, MJCF, URDF, SDF and conventions.

The JSON has the numbers that an engine's model is made of. The MJCF has bodies, hinges, contact and
start, without any engine's recipe; URDF and SDF have bodies and hinges.
"""

import contextlib
import json
from dataclasses import asdict
from importlib.resources import files
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import msgspec
import numpy as np
from scipy.spatial.transform import Rotation

from robotball.drives import Constant, Drive, Free, PositionServo, Ramp, Samples, Servo, Sine, Total
from robotball.engine import integrate
from robotball.engines.links import SHELL, Link, links_of
from robotball.errors import InputError
from robotball.files import replacing
from robotball.files.columns import Table, write_table
from robotball.files.scene_writer import scene_toml
from robotball.motion import Motion
from robotball.poses import poses
from robotball.rotations import Array, rotation_matrix
from robotball.scene import Hinge, Scene

FORMAT = "robotball scene 1"
SHAPES = {"linear": "u", "smooth": "3u² - 2u³", "quintic": "10u³ - 15u⁴ + 6u⁵"}
COMMANDED = {Servo: "rad/s", PositionServo: "rad", Free: "none"}


def plain(motion: Motion) -> dict[str, Any]:
    """The scene of a reference motion, as JSON takes it; SI units, quaternions (w, x, y, z).

    The bodies' states are those of the start, in world axes; friction is what the whole motion
    needs.
    """
    scene, ball = motion.scene, motion.scene.ball
    moments, axes = ball.principal
    return {
        "format": FORMAT,
        "name": scene.name,
        "title": scene.title,
        "rolling": scene.rolling,
        "duration": float(motion.times[-1]),
        "sample_times": {"count": len(motion.times), "file": "reference.csv", "column": "t"},
        "gravity": (scene.gravity * np.array(scene.gravity_direction)).tolist(),
        "ball": {
            "radius": ball.radius,
            "mass": ball.mass,
            "centre_of_mass": ball.centre_of_mass.tolist(),
            "inertia_about_centre": ball.inertia.tolist(),
            "principal_moments": moments.tolist(),
            "principal_axes": axes.tolist(),
        },
        "bodies": _bodies(motion),
        "start": {
            "attitude": motion.attitude[0].tolist(),
            "angular_velocity": motion.angular_velocity[0].tolist(),
            "momentum_world": motion.momentum[0].tolist(),
            "centre": [*motion.contact_point[0].tolist(), ball.radius],
        },
        "friction_needed": friction_needed(motion),
        "friction": asdict(scene.friction),
    }


def friction_needed(motion: Motion) -> dict[str, Any]:
    """The least coefficients without which the ball slips or, a rubber one, spins."""
    sliding = float(motion.loads.sliding_friction.max())
    torsional = float(motion.loads.torsional_friction.max())
    return {
        "sliding": sliding,
        "torsional": torsional if motion.scene.rolling == "rubber" else 0.0,
        "torsional_unit": "m",
        "least_normal_force": float(motion.loads.normal_force.min()),
    }


def _bodies(motion: Motion) -> list[dict[str, Any]]:
    scene = motion.scene
    hinges = {hinge.name: hinge for hinge in scene.hinges}
    placed = poses(motion)
    return [
        {
            "name": name,
            "mass": body.mass,
            "centre_of_mass": body.centre.tolist(),
            "inertia": body.inertia.tolist(),
            "inertia_about_centre": _about_centre(body.mass, body.centre, body.inertia).tolist(),
            "hinge": _hinge(hinges[name]) if name in hinges else None,
            "start": {
                "position": placed[name].position[0].tolist(),
                "attitude": placed[name].attitude[0].tolist(),
                "velocity": placed[name].velocity[0].tolist(),
                "angular_velocity": placed[name].angular_velocity[0].tolist(),
            },
        }
        for name, body in scene.ball.named_bodies
    ]


def _about_centre(mass: float, centre: Array, inertia: Array) -> Array:
    """By Steiner's theorem."""
    return inertia + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))


def _hinge(hinge: Hinge) -> dict[str, Any]:
    motor = hinge.motor
    unit = "rad/s" if motor is None else COMMANDED.get(type(motor), "N m")
    return {
        "parent": "shell" if hinge.name == "frame" else "frame",
        "axis": hinge.axis.tolist(),
        "pivot": hinge.pivot.tolist(),
        "angle": hinge.angle,
        "rate": hinge.rate,
        "motor": None if motor is None else _motor(motor),
        "command": {"unit": unit, **formula(hinge.command), "breakpoints": _times(hinge.command)},
    }


def _motor(motor: Any) -> dict[str, Any]:
    """Its kind and numbers; what it does with its command is in docs/scene.md."""
    return {"kind": type(motor).__name__, **asdict(motor)}


def _times(command: Drive) -> list[float]:
    return [float(t) for t in command.breakpoints]


def formula(command: Drive) -> dict[str, Any]:
    """A command by its formula, in plain data; one that has none is told by drives.csv alone."""
    if isinstance(command, Constant):
        value = float(command.value)
        return {"kind": "constant", "value": value, "formula": repr(value)}
    if isinstance(command, Ramp):
        first, last, start, end = map(
            float, (command.initial, command.final, command.start, command.end)
        )
        u = f"u = clip((t - {start})/({end} - {start}), 0, 1)"
        text = f"{first} + ({last} - {first})*({SHAPES[command.shape]}), {u}"
        return {**msgspec.to_builtins(command), "formula": text}
    if isinstance(command, Sine):
        swing, often, phase, mean = map(
            float, (command.amplitude, command.frequency, command.phase, command.mean)
        )
        text = f"{mean} + {swing}*sin(2*pi*{often}*t + {phase})"
        return {**msgspec.to_builtins(command), "formula": text}
    if isinstance(command, Samples):
        return {**msgspec.to_builtins(command), "formula": "see drives.csv"}
    if isinstance(command, Total):
        parts = [formula(part) for part in command.drives]
        return {"kind": "sum", "parts": parts, "formula": "the sum of the parts"}
    return {"kind": "function", "formula": "see drives.csv"}


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


README = "README.md"


def export_scene(scene: Scene, folder: Path | str, times: Array | None = None) -> list[Path]:
    """Write a scene for other simulators into a folder; returns the files.

    scene.json, scene.toml where the scene has one, drives.csv and reference.csv at the sample
    times (n,) [s], the scene's own if None, model.xml (MJCF), model.urdf, model.sdf, README.md.
    Raises InputError for a scene that the equations cannot integrate, and where nothing can be
    written.
    """
    folder = Path(folder)
    motion = integrate(scene, times)
    conventions = files("robotball.files").joinpath("export_conventions.md")
    texts = {
        "scene.json": json.dumps(plain(motion), indent=1, ensure_ascii=False, allow_nan=False),
        "model.xml": mjcf(motion),
        "model.urdf": urdf(scene),
        "model.sdf": sdf(motion),
        README: conventions.read_text(encoding="utf-8").replace("SCENE", scene.name),
    }
    with contextlib.suppress(InputError):  # of a rate by a function: drives.csv has it
        texts["scene.toml"] = scene_toml(scene)
    for name, text in texts.items():
        with replacing(folder / name) as temporary:
            temporary.write_text(text.rstrip("\n") + "\n", encoding="utf-8")
    write_table(folder / "drives.csv", _drives(motion))
    motion.save(folder / "reference.csv")
    return sorted(folder / name for name in (*texts, "drives.csv", "reference.csv"))


def _drives(motion: Motion) -> Table:
    """What each hinge is told: its command, and the command's slope and integral from 0."""
    times = motion.times
    columns: dict[str, Array] = {"t": times}
    for hinge in motion.scene.hinges:
        command = hinge.command
        columns[f"{hinge.name}_command"] = np.asarray(command.rate(times), dtype=float)
        columns[f"{hinge.name}_slope"] = np.asarray(command.acceleration(times), dtype=float)
        columns[f"{hinge.name}_integral"] = np.asarray(command.angle(times), dtype=float)
    return Table(columns, {"t": "s"}, {"scene": motion.scene.name})

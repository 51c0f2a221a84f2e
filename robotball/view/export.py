"""Export a scene for other simulators: a folder with JSON, MJCF, URDF, SDF and conventions.

The JSON has all numbers that a model needs. The MJCF has bodies, hinges, contact and start, without
settings for an engine; URDF and SDF have bodies and hinges.
"""

import contextlib
from collections.abc import Mapping
from dataclasses import asdict
from importlib.resources import files
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import msgspec
import numpy as np
from scipy.spatial.transform import Rotation

from robotball.engines.equations import integrate, scene_of
from robotball.engines.states import links_of
from robotball.errors import InputError
from robotball.files import as_path, json_text
from robotball.files.columns import Table, write_table
from robotball.files.replacing import replacing
from robotball.files.scene_writer import toml_of
from robotball.motion import Motion
from robotball.robot.ball import inertia_about
from robotball.robot.drives import Constant, Drive, Ramp, Samples, Sine, Total
from robotball.robot.motors import DCMotor, Free, PositionServo, Servo
from robotball.robot.scene import MovedHinge, Scene, Times
from robotball.rotations import Array, rotation_matrix
from robotball.view.poses import poses

_FORMAT = "robotball scene 1"
_SHAPES = {"linear": "u", "smooth": "3u² - 2u³", "quintic": "10u³ - 15u⁴ + 6u⁵"}
# Unit of a hinge's command by motor type; all other motors take a torque.
_COMMANDED = {type(None) | Servo: "rad/s", PositionServo: "rad", DCMotor: "1", Free: "none"}
_MARGIN = 1.5  # friction over the needed one: contacts of other engines must not slip at the peak
# URDF and SDF require joint limits; these are too large to have an effect.
_FASTEST, _STRONGEST, _FARTHEST, _BOUNDLESS = "1e6", "1e9", "1e6", "1e16"
# The newest version with gravity where DART looks for it; other engines read it, too. It has no
# joint type `continuous`, so joints have infinite limits.
_SDF_VERSION = "1.5"
_README = "README.md"


def scene_toml(scene: Scene | str | Path) -> str:
    """Write a scene as the text of a scene file.

    `load_scene` reads the same scene from it, to the last bit. The name of the scene is the name of
    the file, and is not in the text. Rotors stand before pendulums.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene, a name of the catalog, or the path of a TOML, MJCF or URDF file.

    Returns
    -------
    str
        The text, with the bodies, rates and start of the scene.

    Raises
    ------
    InputError
        If the scene has a rate by a function of time, links, actuators or a controller, which no
        scene file can hold, or if `load_scene` raises it.

    Examples
    --------
    >>> import robotball as rb
    >>> print(rb.scene_toml("fig12").splitlines()[0])
    title = "Drifting along a limit cycle, rubber (Fig. 12)"
    """
    return toml_of(scene_of(scene))


def export_scene(scene: Scene | str | Path, folder: str | Path, times: Times = None) -> list[Path]:
    """Write a scene for other simulators into a folder.

    Writes scene.json, scene.toml if possible, drives.csv and reference.csv at the sample times,
    model.xml (MJCF), model.urdf, model.sdf and README.md.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene, a name of the catalog, or the path of a TOML, MJCF or URDF file.
    folder : str or Path
        The folder. It is created if it does not exist.
    times : float or (n,), s, optional
        The duration, or sample times that increase from 0. The default is `scene.times`.

    Returns
    -------
    list of Path
        The written files, sorted.

    Raises
    ------
    InputError
        If the equations cannot integrate the scene, a file cannot be written, or `load_scene`
        raises it.

    Examples
    --------
    >>> import robotball as rb
    >>> files = rb.export_scene("fig12", "fig12", 0.5)
    >>> print(*(file.name for file in files))
    README.md drives.csv model.sdf model.urdf model.xml reference.csv scene.json scene.toml
    """
    scene, folder = scene_of(scene), as_path("the folder", folder)
    scene.check_open("an export")
    motion = integrate(scene, times)
    conventions = files("robotball.view").joinpath("export_conventions.md")
    texts = {
        "scene.json": json_text(_plain(motion), indent=1),
        "model.xml": _mjcf(motion),
        "model.urdf": _urdf(scene),
        "model.sdf": _sdf(motion),
        _README: conventions.read_text(encoding="utf-8").replace("SCENE", scene.name),
    }
    with contextlib.suppress(InputError):  # for a rate given as a function; drives.csv has it
        texts["scene.toml"] = toml_of(scene)
    # Each file is written whole or not at all, even if the folder remains incomplete.
    for name, text in texts.items():
        with replacing(folder / name) as temporary:
            temporary.write_text(text.rstrip("\n") + "\n", encoding="utf-8")
    write_table(folder / "drives.csv", _drives(motion))
    motion.save(folder / "reference.csv")
    return sorted(folder / name for name in (*texts, "drives.csv", "reference.csv"))


def _drives(motion: Motion) -> Table:
    times = motion.times
    columns: dict[str, Array] = {"t": times}
    for hinge in motion.scene.hinges:
        command = hinge.command
        parts = {"command": command.rate, "slope": command.acceleration, "integral": command.angle}
        for quantity, function in parts.items():
            columns[f"{hinge.name}_{quantity}"] = np.asarray(function(times), dtype=float)
    gravity = zip("XYZ", motion.scene.gravity_at(times).T, strict=True)
    if motion.scene.plane_moves:
        columns |= {f"gravity_{axis}": along for axis, along in gravity}
    return Table(columns, {"t": "s"}, {"scene": motion.scene.name})


def _plain(motion: Motion) -> dict[str, Any]:
    """Return the scene of a reference motion as JSON data; SI, quaternions (w, x, y, z).

    The states of bodies are initial states in world axes; friction is for the whole motion.
    """
    scene, ball = motion.scene, motion.scene.ball
    moments, axes = ball.principal
    return {
        "format": _FORMAT,
        "name": scene.name,
        "title": scene.title,
        "rolling": scene.rolling,
        "duration": float(motion.times[-1]),
        "sample_times": {"count": len(motion.times), "file": "reference.csv", "column": "t"},
        "gravity": scene.gravity_world.tolist(),
        "plane_acceleration": [formula(drive) for drive in scene.plane_drives],
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
        "friction_needed": _friction_needed(motion),
        "friction": asdict(scene.friction),
    }


def _friction_needed(motion: Motion) -> dict[str, Any]:
    """Return the least friction coefficients that prevent slip and, for a rubber ball, spin."""
    sliding = float(motion.loads.sliding_friction.max())
    torsional = float(motion.loads.torsional_friction.max())
    return {
        "sliding": sliding,
        # A classical ball spins freely, so the torque that would prevent it is irrelevant.
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
            "name": link.name,
            "mass": link.mass,
            "centre_of_mass": link.centre.tolist(),
            "inertia": link.inertia.tolist(),
            "inertia_about_centre": inertia_about(np.zeros(3), link).tolist(),
            "hinge": _hinge(hinges[link.name], link.parent) if link.parent else None,
            "start": {name: rows[0].tolist() for name, rows in vars(placed[link.name]).items()},
        }
        for link in scene.ball.tree
    ]


def _hinge(hinge: MovedHinge, parent: str) -> dict[str, Any]:
    motor: Any = hinge.motor
    unit = next((unit for kind, unit in _COMMANDED.items() if isinstance(motor, kind)), "N m")
    return {
        "parent": parent,
        "axis": hinge.body.axis.tolist(),
        "pivot": hinge.body.pivot.tolist(),
        "angle": hinge.angle,
        "rate": hinge.rate,
        # docs/scene.md explains the parameters of each motor.
        "motor": None if motor is None else {"kind": type(motor).__name__, **asdict(motor)},
        "command": {
            "unit": unit,
            **formula(hinge.command),
            "breakpoints": [float(t) for t in hinge.command.breakpoints],
        },
    }


def formula(command: Drive) -> dict[str, Any]:
    """Return a command's parameters and formula as plain data; samples are in drives.csv."""
    text = "see drives.csv"
    match command:
        case Constant():
            value = float(command.value)
            return {"kind": "constant", "value": value, "formula": repr(value)}
        case Total():
            parts = [formula(part) for part in command.drives]
            return {"kind": "sum", "parts": parts, "formula": "the sum of the parts"}
        case Ramp():
            numbers = (command.initial, command.final, command.start, command.end)
            first, last, start, end = map(float, numbers)
            u = f"u = clip((t - {start})/({end} - {start}), 0, 1)"
            text = f"{first} + ({last} - {first})*({_SHAPES[command.shape]}), {u}"
        case Sine():
            numbers = (command.amplitude, command.frequency, command.phase, command.mean)
            swing, often, phase, mean = map(float, numbers)
            text = f"{mean} + {swing}*sin(2*pi*{often}*t + {phase})"
        case Samples():
            pass
        case _:
            return {"kind": "function", "formula": text}
    return {**msgspec.to_builtins(command), "formula": text}


def _mjcf(motion: Motion) -> str:
    """Return the MJCF of a reference motion's scene, with its initial state as keyframe `start`.

    MJCF cannot express prescribed rates: motors are left to the user.
    """
    scene = motion.scene
    root = Element("mujoco", model=scene.name)
    SubElement(root, "option", gravity=_numbers(scene.gravity_world))
    world = SubElement(root, "worldbody")
    needed = _friction_needed(motion)
    friction = [_MARGIN * needed["sliding"], _MARGIN * needed["torsional"], 0.0]
    # condim 4 resists spin about the normal, which the rubber model excludes.
    condim = "4" if scene.rolling == "rubber" else "3"
    contact = {"friction": _numbers(friction), "condim": condim}
    SubElement(world, "geom", {"name": "floor", "type": "plane", "size": "0 0 1", **contact})
    bodies = {"": world}
    armatures = {hinge.name: hinge.motor.armature for hinge in scene.hinges if hinge.motor}
    for link in links_of(scene):
        origin = link.pivot if link.parent else [0.0, 0.0, scene.ball.radius]
        # All hinges are at angle 0 here; the keyframe sets their angles.
        body = SubElement(bodies[link.parent], "body", name=link.name, pos=_numbers(origin))
        mass = {"pos": _numbers(link.centre), "mass": repr(float(link.mass))}
        moments = " ".join(_moments(link.inertia).values())
        SubElement(body, "inertial", {**mass, "fullinertia": moments})
        if not link.parent:
            # Not `freejoint`, which DART and PyBullet do not support.
            SubElement(body, "joint", name=link.name, type="free")
            # Massless: the inertial above is the whole shell's.
            sphere = {"name": "sphere", "type": "sphere", "size": repr(float(scene.ball.radius))}
            SubElement(body, "geom", {**sphere, "mass": "0", **contact})
        else:
            joint = {"name": link.name, "type": "slide" if link.slides else "hinge"}
            if armature := armatures.get(link.name):
                joint["armature"] = repr(float(armature))
            SubElement(body, "joint", joint, axis=_numbers(link.axis))
        bodies[link.name] = body
    shell = poses(motion)["shell"]
    hinges = scene.hinges
    centre = [0.0, 0.0, scene.ball.radius]
    # A free joint has linear velocity in world axes and angular velocity in body axes.
    turning = rotation_matrix(shell.attitude[0]).T @ shell.angular_velocity[0]
    velocity = np.cross(shell.angular_velocity[0], centre)
    keyframe = SubElement(root, "keyframe")
    qpos = [*centre, *shell.attitude[0], *(hinge.angle for hinge in hinges)]
    qvel = [*velocity, *turning, *(hinge.rate for hinge in hinges)]
    SubElement(keyframe, "key", name="start", qpos=_numbers(qpos), qvel=_numbers(qvel))
    return _xml_text(root)


def _urdf(scene: Scene) -> str:
    """Return the URDF of a scene's ball, which has no plane, initial state, rates or friction."""
    root = Element("robot", name=scene.name)
    # Otherwise MuJoCo would weld the shell to the world and drop its mass; others ignore this.
    SubElement(SubElement(root, "mujoco"), "compiler", fusestatic="false")
    links = links_of(scene)
    for link in links:
        element = SubElement(root, "link", name=link.name)
        inertial = SubElement(element, "inertial")
        SubElement(inertial, "origin", xyz=_numbers(link.centre), rpy="0 0 0")
        SubElement(inertial, "mass", value=repr(float(link.mass)))
        SubElement(inertial, "inertia", _moments(link.inertia))
        if not link.parent:
            collision = SubElement(element, "collision")
            geometry = SubElement(collision, "geometry")
            SubElement(geometry, "sphere", radius=repr(float(scene.ball.radius)))
    for link in links:
        if link.parent:
            kind = "prismatic" if link.slides else "continuous"
            joint = SubElement(root, "joint", name=f"{link.name}_hinge", type=kind)
            SubElement(joint, "parent", link=link.parent)
            SubElement(joint, "child", link=link.name)
            SubElement(joint, "origin", xyz=_numbers(link.pivot), rpy="0 0 0")
            SubElement(joint, "axis", xyz=_numbers(link.axis))
            limits = {"velocity": _FASTEST, "effort": _STRONGEST}
            if link.slides:
                limits |= {"lower": f"-{_FARTHEST}", "upper": _FARTHEST}
            SubElement(joint, "limit", limits)
    return _xml_text(root)


def _sdf(motion: Motion) -> str:
    """Return the SDF world of a motion's scene with its initial pose.

    SDF has no velocities; hinges are at angle 0, and their rates are left to the user.
    """
    scene = motion.scene
    root = Element("sdf", version=_SDF_VERSION)
    world = SubElement(root, "world", name=scene.name)
    physics = SubElement(world, "physics", type="ode")
    _fill(physics, {"gravity": _numbers(scene.gravity_world)})
    surface = _surface(motion)
    plane = _fill(SubElement(world, "model", name="plane"), {"static": "true"})
    ground = SubElement(SubElement(plane, "link", name="plane"), "collision", name="plane")
    # The size is only for display, but PyBullet reads no plane without it.
    shape = {"plane": {"normal": "0 0 1", "size": "100 100"}}
    _fill(ground, {"geometry": shape, "surface": surface})
    ball = SubElement(world, "model", name="ball")
    shell = poses(motion)["shell"]
    angles = Rotation.from_quat(shell.attitude[0], scalar_first=True).as_euler("xyz")
    _fill(ball, {"pose": _numbers([0.0, 0.0, scene.ball.radius, *angles])})
    links = links_of(scene)
    # SDF gives a link's position in its model, not relative to its parent.
    places = {"": np.zeros(3)}
    for link in links:
        places[link.name] = place = places[link.parent] + link.pivot
        inertial = {
            "pose": _numbers([*link.centre, 0.0, 0.0, 0.0]),
            "mass": repr(float(link.mass)),
            "inertia": _moments(link.inertia),
        }
        element = SubElement(ball, "link", name=link.name)
        _fill(element, {"pose": _numbers([*place, 0.0, 0.0, 0.0]), "inertial": inertial})
        if not link.parent:
            sphere = {"sphere": {"radius": repr(float(scene.ball.radius))}}
            collision = SubElement(element, "collision", name="sphere")
            _fill(collision, {"geometry": sphere, "surface": surface})
    for link in links:
        if link.parent:
            kind = "prismatic" if link.slides else "revolute"
            joint = SubElement(ball, "joint", name=f"{link.name}_hinge", type=kind)
            limits = {"lower": f"-{_BOUNDLESS}", "upper": _BOUNDLESS}
            axis = {"xyz": _numbers(link.axis), "limit": limits}
            _fill(joint, {"parent": link.parent, "child": link.name, "axis": axis})
    return _xml_text(root)


def _surface(motion: Motion) -> dict[str, Any]:
    needed = _friction_needed(motion)
    sliding = repr(_MARGIN * needed["sliding"])
    friction: dict[str, Any] = {"ode": {"mu": sliding, "mu2": sliding}}
    if needed["torsional"]:
        # The torque is 3π/16 · coefficient · patch radius · normal force; the radius here is 1 m.
        coefficient = repr(_MARGIN * needed["torsional"] * 16 / (3 * np.pi))
        patch = {"use_patch_radius": "true", "patch_radius": "1.0"}
        friction["torsional"] = {**patch, "coefficient": coefficient}
    return {"friction": friction}


def _fill(parent: Element, contents: Mapping[str, Any]) -> Element:
    """Add elements to `parent`, each with a text or with nested contents, by name."""
    for name, content in contents.items():
        element = SubElement(parent, name)
        if isinstance(content, str):
            element.text = content
        else:
            _fill(element, content)
    return parent


def _moments(inertia: Array) -> dict[str, str]:
    """Return the six moments with the names of URDF and SDF, in the order of MJCF's fullinertia."""
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia.tolist()
    names = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    return dict(zip(names, map(repr, (xx, yy, zz, xy, xz, yz)), strict=True))


def _numbers(values: Array | list[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def _xml_text(root: Element) -> str:
    indent(root)
    return tostring(root, encoding="unicode")

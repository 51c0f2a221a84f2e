"""Export a scene for other simulators: a folder with MJCF, URDF, drives, reference, conventions.

The MJCF has bodies, hinges, contact and start, without settings for an engine; the URDF has bodies
and hinges.
"""

import contextlib
from importlib.resources import files
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import numpy as np

from robotball.engines.equations import integrate, scene_of
from robotball.engines.states import links_of
from robotball.errors import InputError
from robotball.files import as_path
from robotball.files.columns import Table, write_table
from robotball.files.replacing import replacing
from robotball.files.scene_writer import toml_of
from robotball.motion import Motion
from robotball.robot.scene import Scene, Times
from robotball.rotations import Array, from_matrix, multiply, rotation_matrix

_MARGIN = 1.5  # of the needed friction: contacts of other engines must not slip at the peak
# URDF requires joint limits; these are too large to have an effect.
_FASTEST, _STRONGEST, _FARTHEST = "1e6", "1e9", "1e6"


def scene_toml(scene: Scene | str | Path) -> str:
    """Write a scene as the text of a scene file.

    `load_scene` reads the same scene from this text, to the last bit. The text does not contain the
    scene's name, because the name of the file is used. Rotors come before pendulums.

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
        If the scene has links, actuators, a controller or a rate that is a function of time, which
        a scene file cannot contain, or if `load_scene` raises it.

    Examples
    --------
    >>> import robotball as rb
    >>> print(rb.scene_toml("fig12").splitlines()[0])
    title = "Drifting along a limit cycle, rubber (Fig. 12)"
    """
    return toml_of(scene_of(scene))


def export_scene(scene: Scene | str | Path, folder: str | Path, times: Times = None) -> list[Path]:
    """Write a scene for other simulators into a folder.

    Writes scene.toml if possible, drives.csv and reference.csv at the sample times, model.xml
    (MJCF), model.urdf and README.md.

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
    README.md drives.csv model.urdf model.xml reference.csv scene.toml
    """
    scene, folder = scene_of(scene), as_path("the folder", folder)
    scene.check_open("an export")
    motion = integrate(scene, times)
    conventions = files("robotball.view").joinpath("export_conventions.md")
    texts = {
        "model.xml": _mjcf(motion),
        "model.urdf": _urdf(scene),
        "README.md": conventions.read_text(encoding="utf-8").replace("SCENE", scene.name),
    }
    with contextlib.suppress(InputError):  # a function fits only drives.csv
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
    if motion.scene.plane_turns:
        columns["plane_rotation"] = np.asarray(motion.scene.plane_turn.rate(times))
    return Table(columns, {"t": "s"}, {"scene": motion.scene.name})


def _mjcf(motion: Motion) -> str:
    """Return the MJCF of a motion's scene; its initial state is the keyframe `start`."""
    scene = motion.scene
    root = Element("mujoco", model=scene.name)
    SubElement(root, "option", gravity=_numbers(scene.gravity_world))
    world = SubElement(root, "worldbody")
    loads, rubber = motion.loads, scene.rolling == "rubber"
    sliding, torsional = scene.friction.sliding, scene.friction.torsional
    if sliding is None:
        sliding = _MARGIN * float(loads.sliding_friction.max())
    if torsional is None:
        torsional = _MARGIN * float(loads.torsional_friction.max())
    # condim 4 resists spin about the normal, which only the rubber model excludes.
    friction, condim = [sliding, torsional * rubber, 0.0], "4" if rubber else "3"
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
            # Massless: the inertial above is that of the whole shell.
            sphere = {"name": "sphere", "type": "sphere", "size": repr(float(scene.ball.radius))}
            SubElement(body, "geom", {**sphere, "mass": "0", **contact})
        else:
            joint = {"name": link.name, "type": "slide" if link.slides else "hinge"}
            if armature := armatures.get(link.name):
                joint["armature"] = repr(float(armature))
            SubElement(body, "joint", joint, axis=_numbers(link.axis))
        bodies[link.name] = body
    first = [motion.hinge_angles[:1], motion.angular_velocity[:1], motion.hinge_rates[:1]]
    turn = scene.robot.moved(first[0])[0][0, 0]  # shell to frame
    turning = scene.robot.states(motion.gamma[:1], *first).turning[0, 0]  # of the shell
    omega = rotation_matrix(motion.attitude[0]) @ turning  # world axes
    attitude = multiply(motion.attitude[0], from_matrix(turn))
    centre = [0.0, 0.0, scene.ball.radius]
    # A free joint has linear velocity in world axes and angular velocity in body axes.
    velocity = np.cross(omega, centre)
    velocity[:2] += scene.start_slip[:2]
    spin = rotation_matrix(attitude).T @ omega
    keyframe = SubElement(root, "keyframe")
    qpos = [*centre, *attitude, *(hinge.angle for hinge in scene.hinges)]
    qvel = [*velocity, *spin, *(hinge.rate for hinge in scene.hinges)]
    SubElement(keyframe, "key", name="start", qpos=_numbers(qpos), qvel=_numbers(qvel))
    return _xml_text(root)


def _urdf(scene: Scene) -> str:
    """Return the URDF of a scene's ball, which has no plane, initial state, rates or friction."""
    root = Element("robot", name=scene.name)
    # Without this MuJoCo would weld the shell to the world and drop its mass. Other simulators
    # ignore this.
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


def _moments(inertia: Array) -> dict[str, str]:
    """Return the six moments with the names of URDF, in the order of MJCF's fullinertia."""
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia.tolist()
    names = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    return dict(zip(names, map(repr, (xx, yy, zz, xy, xz, yz)), strict=True))


def _numbers(values: Array | list[float]) -> str:
    return " ".join(repr(float(value)) for value in values)


def _xml_text(root: Element) -> str:
    indent(root)
    return tostring(root, encoding="unicode")

"""Make the scene of a user's robot file: its tree, actuators, controls and start.

This file has, in order: the table of a scene file that names a robot file, the scene, joints,
actuators.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any

import msgspec
import mujoco
import numpy as np

from robotball.errors import InputError, check_positive, named, unknown, warn
from robotball.files.scene_tables import Command, Table, rate_of
from robotball.robot.ball import Ball, Hinge, Link
from robotball.robot.drives import Rate, Samples, key
from robotball.robot.formulas import Rolling
from robotball.robot.motors import Activation, Actuator, Free, Law
from robotball.robot.scene import DOWN, Friction, Scene, Start
from robotball.rotations import from_matrix
from robotball.user_model.robot_file import (
    LEVEL,
    RobotFile,
    gears_of,
    open_robot,
    rolling_of,
    starts_off,
)

_STATELESS, _INTEGRATOR = int(mujoco.mjtDyn.mjDYN_NONE), int(mujoco.mjtDyn.mjDYN_INTEGRATOR)
_AFFINE = (int(mujoco.mjtBias.mjBIAS_NONE), int(mujoco.mjtBias.mjBIAS_AFFINE))
_FILTERS = (int(mujoco.mjtDyn.mjDYN_FILTER), int(mujoco.mjtDyn.mjDYN_FILTEREXACT))
_NO_LIMITS = (-np.inf, np.inf)
_Controls = Mapping[str, Rate]  # by the names of actuators
_NONE: _Controls = MappingProxyType({})
DURATION = 10.0  # s, of a scene from a file, unless its table or its samples end it


class RobotTable(Table, frozen=True, kw_only=True):
    """The table of a scene file that names a robot file."""

    robot: Annotated[str, key("MJCF or URDF file, relative to the folder of the scene")]
    title: Annotated[str | None, key("one line, for tables and plots")] = None
    rolling: Annotated[Rolling | None, key("`rubber` or `classical`; default: by condim")] = None
    shell: Annotated[str | None, key("body or geom that rolls, if several could")] = None
    keyframe: Annotated[str | None, key("initial keyframe; default: the first")] = None
    duration: Annotated[float | None, key("default: 10, or the duration of samples", "s")] = None
    controls: Annotated[
        dict[str, Command] | None, key("`[controls]`, by actuator; default: from the keyframe")
    ] = None


def scene_of_robot(path: Path, table: Mapping[str, Any], controls: _Controls = _NONE) -> Scene:
    """Return the scene of a robot file, with its start and controls.

    path: of the scene file. table: of a TOML file, or a table that has only the robot file.
    controls: by the names of actuators, in place of the controls in the table and the robot file.
    Without a duration in the table, the scene lasts as long as sampled controls, but at most 10 s.
    Warns of additions and omissions. Raises InputError for unknown keys, for a robot that cannot
    roll, and for features that the equations do not have.
    """
    if "robot" not in table:
        raise InputError("controls need a scene with a robot file")
    for name in table:
        if name not in RobotTable.__struct_fields__:
            raise unknown("key beside robot", name, RobotTable.__struct_fields__)
    keys = msgspec.convert(table, RobotTable)
    file, controls = path.parent / keys.robot, {**controls_of(keys, path.parent), **controls}
    robot = open_robot(file, keys.shell)
    data, duration = robot.start(keys.keyframe), keys.duration
    if duration is None:
        ends = [rate.times[-1] for rate in controls.values() if isinstance(rate, Samples)]
        duration = min([DURATION, *ends])
    with named(file):
        for note in (*robot.repairs.values(), *robot.notes, *starts_off(robot, data)):
            warn(f"{file.name}: {note}")
        scene = scene_of(robot, data, controls, keys.rolling, duration)
    return replace(scene, name=path.stem, title=keys.title or scene.title)


def controls_of(table: RobotTable, folder: Path) -> dict[str, Rate]:
    """Return the controls in a scene file's table. folder: of the files that the table names."""
    return {name: rate_of(command, folder) for name, command in (table.controls or {}).items()}


def scene_of(
    robot: RobotFile, data: Any, controls: _Controls, rolling: Rolling | None, duration: float
) -> Scene:
    """Return the scene of a robot that rolls on the plane from a start."""
    model, contact = robot.model, robot.contact(data)
    to_plane = robot.plane_axes(data)
    down = to_plane @ model.opt.gravity
    gravity = float(np.linalg.norm(down))
    check_positive("gravity", gravity, "m/s²")
    if down[2] >= 0:
        remedy = 'for a level plane give gravity="0 0 -9.81"'
        raise InputError(f"gravity does not press the sphere on the plane; {remedy}")
    level = down[2] < -LEVEL * gravity
    rolling = rolling or rolling_of(contact)
    to_world = to_plane @ data.geom_xmat[robot.sphere].reshape(3, 3)
    (shell, links), gears, hinges = robot.tree, gears_of(model), []
    for joint, link in links.items():
        angle = float(data.qpos[model.jnt_qposadr[joint]])
        rate = float(data.qvel[model.jnt_dofadr[joint]])
        name, low, high = link.range or ("", *_NO_LIMITS)
        if not low <= angle <= high:
            place = f"{angle:g} {'m' if link.slides else 'rad'}"
            raise InputError(f"{name} starts at {place}, outside its range of {low:g} to {high:g}")
        hinges.append(Hinge(link, motor=_passive(model, joint, gears), angle=angle, rate=rate))
    turning = to_plane @ robot.moving(data)[:3]
    if rolling == "rubber":  # no spin about the plane's normal
        turning = turning * [1.0, 1.0, 0.0]
    scene = Scene(
        name=robot.path.stem,
        title=f"The robot of {robot.path.name}",
        source=str(robot.path),
        ball=Ball(shell, tuple(hinges)),
        rolling=rolling,
        actuators=tuple(_actuators(model, links, data, controls)),
        gravity=gravity,
        gravity_direction=DOWN if level else tuple((down / gravity).tolist()),
        friction=Friction(rolling=float(contact.friction[3]) if contact.dim == 6 else 0.0),
        start=Start(from_matrix(to_world), np.zeros(3)),
        duration=duration,
    )
    momentum = scene.momentum_of(to_world.T @ turning)
    return replace(scene, start=replace(scene.start, momentum=momentum))


def slipping(scene: Scene, robot: RobotFile, data: Any) -> Scene:
    """Return the scene of a robot with the friction of its file, and with the slip of its start.

    The equations have no friction that depends on the direction, and no plane without friction.
    """
    contact, rubber = robot.contact(data), scene.rolling == "rubber"
    slide, across, spin, *_ = map(float, contact.friction)
    sliding = slide if contact.dim > 1 and slide == across else None
    torsional = spin if contact.dim > 3 and rubber else None
    limited = replace(scene.friction, sliding=sliding, torsional=torsional)
    scene = replace(scene, friction=limited)
    slip = np.where(np.isfinite(scene.slip_limits), robot.start_slip(data), 0.0)
    return replace(scene, start=replace(scene.start, slip=slip))


def _passive(model: Any, joint: int, gears: Mapping[str, Mapping[int, float]]) -> Free:
    """Return a joint's passive forces and armature, with the rotors of its actuators."""
    dof = int(model.jnt_dofadr[joint])
    if np.any(model.jnt_stiffnesspoly[joint]) or np.any(model.dof_dampingpoly[dof]):
        name = model.joint(joint).name
        raise InputError(f"{name}: only constant stiffness and damping are supported")
    squares = np.array([moved.get(joint, 0.0) ** 2 for moved in gears.values()])
    with named(model.joint(joint).name or f"joint {joint}"):
        return Free(
            damping=float(model.dof_damping[dof] + squares @ model.actuator_damping),
            stiffness=float(model.jnt_stiffness[joint]),
            rest=float(model.qpos_spring[model.jnt_qposadr[joint]]),
            armature=float(model.dof_armature[dof] + squares @ model.actuator_armature),
            friction=float(model.dof_frictionloss[dof]),
        )


def _actuators(
    model: Any, links: Mapping[int, Link], data: Any, controls: _Controls
) -> Iterator[Actuator]:
    """Yield the actuators that move links. Without a control, they keep their initial control."""
    gears = gears_of(model)
    for name in controls:
        if name not in gears:
            raise unknown("actuator", name, gears)
    moved_by = Counter(joint for moved in gears.values() for joint in moved)
    for i, (name, moved) in enumerate(gears.items()):
        if moved.keys().isdisjoint(links):
            continue
        if len(moved) > 1 and (model.actuator_armature[i] or model.actuator_damping[i]):
            raise InputError(f"the actuator {name} has armature or damping: it must move one joint")
        low, high = model.actuator_forcerange[i] if model.actuator_forcelimited[i] else _NO_LIMITS
        for joint, ratio in moved.items():
            if model.jnt_actfrclimited[joint]:
                if len(moved) > 1 or moved_by[joint] > 1 or not ratio:
                    line = "a joint with actuatorfrcrange needs an actuator for this joint alone"
                    raise InputError(f"{model.joint(joint).name}: {line}")
                ends = sorted(model.jnt_actfrcrange[joint] / ratio)
                low, high = max(low, ends[0]), min(high, ends[1])
        # A law has a symmetric limit, so the middle of the range becomes a constant torque.
        middle = float(low + high) / 2 if np.isfinite(high) else 0.0
        ratios = tuple((links[joint].name, ratio) for joint, ratio in moved.items())
        within = model.actuator_ctrlrange[i] if model.actuator_ctrllimited[i] else _NO_LIMITS
        law = _law(model, i, name)
        yield Actuator(
            name,
            ratios,
            law._replace(at_rest=law.at_rest - middle, limit=float(high) - middle),
            command=controls.get(name, float(data.ctrl[i])),
            activation=_activation(model, i, name, data),
            within=(float(within[0]), float(within[1])),
        )
        if middle:
            yield Actuator(f"{name}_offset", ratios, Law(0.0, 0.0, 0.0, at_rest=middle))


def _activation(model: Any, i: int, name: str, data: Any) -> Activation | None:
    """Return an actuator's activation at the start, if it has one."""
    kind, at = model.actuator_dyntype[i], int(model.actuator_actadr[i])
    if kind == _STATELESS:
        return None
    if kind not in (_INTEGRATOR, *_FILTERS) or model.actuator_actnum[i] != 1:
        raise InputError(f"{name}: muscle, PID and DC motor are unsupported; use dyntype filter")
    limited, limits = model.actuator_actlimited[i], model.actuator_actrange[i].tolist()
    settling = None if kind == _INTEGRATOR else float(model.actuator_dynprm[i, 0])
    if settling is not None:
        check_positive(f"{name}'s time constant", settling, "s")
    return Activation(float(data.act[at]), settling, *(limits if limited else ()))


def _law(model: Any, i: int, name: str) -> Law:
    """Return an actuator's law. Raises InputError if it is not affine."""
    gain, bias = model.actuator_gainprm[i], model.actuator_biasprm[i]
    fixed = model.actuator_gaintype[i] == int(mujoco.mjtGain.mjGAIN_FIXED)
    if not (fixed and model.actuator_biastype[i] in _AFFINE):
        raise InputError(f"{name}: the gain and bias must be affine, like a motor's or a servo's")
    b0, b1, b2 = bias[:3].tolist() if model.actuator_biastype[i] else (0.0, 0.0, 0.0)
    return Law(float(gain[0]), -b1, -b2, b0)

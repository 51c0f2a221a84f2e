"""Read a user's whole robot from an MJCF or URDF file, as it is: tree, actuators, plane and start.

MuJoCo reads and compiles the file, at first in a process of its own, which a hostile file may end.
The tree begins at the shell, the body with the sphere that touches the plane, wherever the file has
it: a joint above the shell is seen from its other side, by an axis of the opposite sign. Bodies are
taken where all joints are at 0, in the axes of the shell and from the centre of its sphere; all
that is welded together is one body.

In order: the scene, the model with what the file leaves out, the tree, the start and the contact,
the joints and actuators.
"""

from collections.abc import Iterator, Mapping
from copy import copy
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from robotball.equations import Rolling
from robotball.errors import InputError, check_positive, warn
from robotball.files.foreign_bodies import check_loads
from robotball.mechanics import momentum_at
from robotball.motors import Actuator, Free, Law
from robotball.robot import NO_FRAME, Ball, Link, Shell, Solid, composed
from robotball.rotations import Array, from_matrix
from robotball.scene import DOWN, Friction, Scene, Start
from robotball.shapes import shapes_of_geoms

# A model has plain numbers, which MuJoCo's enumerations do not equal.
_FREE, _BALL = int(mujoco.mjtJoint.mjJNT_FREE), int(mujoco.mjtJoint.mjJNT_BALL)
_SLIDE, _HINGE = int(mujoco.mjtJoint.mjJNT_SLIDE), int(mujoco.mjtJoint.mjJNT_HINGE)
_SPHERE, _PLANE = int(mujoco.mjtGeom.mjGEOM_SPHERE), int(mujoco.mjtGeom.mjGEOM_PLANE)
# What the scene's own model calls its parts; a user's body of such a name gets another.
_OURS = ("shell", "frame", "floor")
_LEVEL = 1 - 1e-12  # cosine: a plane or a gravity that is tilted by less is level
_DURATION = 10.0  # s, of a scene from a file, which has none
_HEIGHT = 1e-6  # of the radius, and of a velocity: a start that misses by less is on the plane
_TOUCH = 1e-3  # of the radius: how deep the sphere is put to see its contact


@dataclass(frozen=True)
class RobotFile:
    """A user's MjModel, and the numbers of the geom that rolls and of the plane.

    notes: a line for each thing that was added, that the file does in silence, or that the
    equations leave out.
    """

    path: Path
    model: Any
    sphere: int
    plane: int
    notes: tuple[str, ...]


def robot_scene(path: Path) -> Scene:
    """Return the scene of an MJCF or URDF file, as it starts and with the controls that it has.

    Warns of what is added or left out. Raises InputError for a file that cannot roll, or has what
    the equations do not describe.
    """
    robot = open_robot(path)
    data = _start_data(robot.model)
    for note in (*robot.notes, *_starts_off(robot, data)):
        warn(f"{path.name}: {note}")
    try:
        return _scene_of(robot, data)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _scene_of(robot: RobotFile, data: Any) -> Scene:
    """Return the scene of a file's robot, which rolls on the plane from its start."""
    model, contact = robot.model, _contact(robot, data)
    ball, joints = _tree_of(robot)
    links = dict(zip(joints, (link.name for link in ball.links), strict=True))
    to_plane = _plane_axes(robot, data)
    down = to_plane @ model.opt.gravity
    gravity = float(np.linalg.norm(down))
    check_positive("gravity", gravity, "m/s²")
    level = down[2] < -_LEVEL * gravity
    rolling: Rolling = "classical" if contact.dim == 3 else "rubber"
    to_world = to_plane @ data.geom_xmat[robot.sphere].reshape(3, 3)
    attitude = from_matrix(to_world)
    angles = np.array([data.qpos[model.jnt_qposadr[joint]] for joint in joints])
    rates = np.array([data.qvel[model.jnt_dofadr[joint]] for joint in joints])
    turning = to_plane @ _moving(robot, data)[:3]
    if rolling == "rubber":  # whose shell does not spin
        turning = turning * [1.0, 1.0, 0.0]
    momentum = momentum_at(ball, rolling, attitude, to_world.T @ turning, angles, rates)
    return Scene(
        name=robot.path.stem,
        title=f"The robot of {robot.path.name}",
        source=str(robot.path),
        ball=ball,
        rolling=rolling,
        frame_rate=0.0,
        rotor_rates=(),
        link_rates=(0.0,) * len(joints),
        motors=tuple(_passive(model, joint) for joint in joints),
        actuators=tuple(_actuators(model, links, data)),
        gravity=gravity,
        gravity_direction=DOWN if level else tuple((down / gravity).tolist()),
        friction=Friction(rolling=float(contact.friction[3]) if contact.dim == 6 else 0.0),
        start=Start(attitude, momentum, angles, rates),
        duration=_DURATION,
    )


def open_robot(path: Path) -> RobotFile:
    """Return a file's model, with a plane and a free joint where it has none.

    Raises InputError where MuJoCo refuses the file or takes too long or too much memory, or nothing
    in it can roll.
    """
    check_loads(path)
    try:
        spec = mujoco.MjSpec.from_file(str(path))
        # A URDF's root has no joint: it would become a part of the world, without its mass.
        spec.compiler.fusestatic = False
        model = spec.compile()
        notes = [*_plane_added(spec, model), *_free_joint_added(spec, model, _sphere(model))]
        if notes:
            model = spec.compile()
        _check_supported(model)
        sphere, plane = _sphere(model), _plane(model)
    except (ValueError, mujoco.FatalError) as error:
        raise InputError(f"{path}: {error}") from None
    notes += [*_inferred(spec), *_ignored(model, sphere)]
    return RobotFile(path, model, sphere, plane, tuple(notes))


def _sphere(model: Any) -> int:
    """Return the number of the geom that rolls: the only sphere, or the largest."""
    spheres = [
        i
        for i in range(model.ngeom)
        if model.geom_type[i] == _SPHERE and (model.geom_contype[i] or model.geom_conaffinity[i])
    ]
    if not spheres:
        raise InputError(
            "no sphere can touch the plane; a shell has a geom of type sphere with contype or "
            "conaffinity, where a mesh would roll on its corners"
        )
    largest = max(model.geom_size[i, 0] for i in spheres)
    outermost = [i for i in spheres if model.geom_size[i, 0] == largest]
    if len(outermost) > 1:
        names = ", ".join(model.body(model.geom_bodyid[i]).name for i in outermost)
        raise InputError(
            f"several spheres of {largest:g} m could roll: {names}; give all but one contype and "
            "conaffinity 0"
        )
    return outermost[0]


def _plane(model: Any) -> int:
    planes = np.flatnonzero(model.geom_type == _PLANE)
    if len(planes) != 1:
        raise InputError(f"the file has {len(planes)} planes, of which the ball can roll on one")
    return int(planes[0])


def _plane_added(spec: Any, model: Any) -> Iterator[str]:
    if not np.any(model.geom_type == _PLANE):
        spec.worldbody.add_geom(type=_PLANE, size=[0, 0, 1])
        yield "the file has no plane; one is added at height 0"


def _free_joint_added(spec: Any, model: Any, sphere: int) -> Iterator[str]:
    root = model.body_rootid[model.geom_bodyid[sphere]]
    joints = [int(model.jnt_type[j]) for j in range(model.njnt) if model.jnt_bodyid[j] == root]
    name = model.body(root).name
    if root == 0:
        raise InputError("the sphere belongs to the world; give its body a freejoint")
    if not joints:
        spec.bodies[root].add_freejoint()
        yield f"{name} hangs on the world, where it cannot roll; it gets a free joint"
    elif joints != [_FREE]:
        raise InputError(
            f"{name} hangs on the world by joints that are no free one, and cannot roll; give it a "
            "freejoint instead"
        )


def _check_supported(model: Any) -> None:
    """Raise InputError for what the equations do not have, and would be silently other without."""
    tendons = ("stiffness", "damping", "frictionloss", "limited")
    unsupported = {
        "an equality constraint": model.eq_active0,
        "the drag of a medium (density or viscosity)": [model.opt.density, model.opt.viscosity],
        "gravcomp": model.body_gravcomp,
        "a tendon with a spring, a damper, friction or limits": np.concatenate(
            [np.ravel(getattr(model, f"tendon_{each}")) for each in tendons]
        ),
        "an actuatorfrcrange": model.jnt_actfrclimited,
        "an actuator's own armature or damping": [
            *model.actuator_armature,
            *model.actuator_damping,
        ],
    }
    for what, values in unsupported.items():
        if np.any(values):
            raise InputError(f"{what} is not supported; take it out of the file")


def _inferred(spec: Any) -> Iterator[str]:
    """Yield the bodies whose masses follow from geoms while others have theirs stated."""
    bodies = spec.bodies[1:]
    if any(each.explicitinertial for each in bodies):
        for each in bodies:
            if not each.explicitinertial and any(geom.mass != geom.mass for geom in each.geoms):
                yield f"{each.name} has no inertial; its geoms give it a mass by their density"


def _ignored(model: Any, sphere: int) -> Iterator[str]:
    """Yield the moving bodies that are no part of the robot, and the ranges of its joints."""
    root = model.body_rootid[model.geom_bodyid[sphere]]
    for i in range(1, model.nbody):
        if model.body_dofnum[i] and model.body_rootid[i] != root and model.body_rootid[i] == i:
            yield f"{_name(model, i)} moves apart from the robot; the equations leave it out"
    for j in range(model.njnt):
        if model.jnt_limited[j]:
            yield f"{model.joint(j).name}: the equations have no range, and let the joint go on"


@dataclass
class _Node:
    """A body of the tree, with all that is welded to it, or what is between two joints of one.

    joints: (number, the other node, the sign by which the joint turns that one from here).
    """

    name: str
    solid: Solid
    joints: list[tuple[int, int, float]] = field(default_factory=list)


def _tree_of(robot: RobotFile) -> tuple[Ball, list[int]]:
    """Return the ball of a file, and the number of the joint of each of its links."""
    model, data = robot.model, mujoco.MjData(robot.model)
    for j in range(model.njnt):
        if model.jnt_type[j] in (_SLIDE, _HINGE):
            data.qpos[model.jnt_qposadr[j]] = 0.0
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    nodes, of_shell = _nodes(robot, data)
    to_shell = data.geom_xmat[robot.sphere].reshape(3, 3).T
    centre, radius = data.geom_xpos[robot.sphere], float(model.geom_size[robot.sphere, 0])

    def local(solid: Solid) -> Solid:
        inertia = to_shell @ solid.inertia @ to_shell.T
        turn, shift = from_matrix(to_shell), -to_shell @ centre
        return Solid(
            solid.mass, to_shell @ solid.centre + shift, (inertia + inertia.T) / 2,
            shapes=tuple(each.moved(turn, shift) for each in solid.shapes),
        )  # fmt: skip

    shell = local(nodes[of_shell].solid)
    links, joints = [], []
    reached, waiting = {of_shell}, [(of_shell, "shell")]
    while waiting:
        at, parent = waiting.pop()
        for joint, other, sign in nodes[at].joints:
            if other in reached:
                continue
            reached.add(other)
            solid, name = local(nodes[other].solid), nodes[other].name
            links.append(
                Link(
                    name, parent, solid.mass, solid.inertia, solid.centre,
                    axis=sign * to_shell @ data.xaxis[joint],
                    pivot=to_shell @ (data.xanchor[joint] - centre),
                    slides=bool(model.jnt_type[joint] == _SLIDE),
                    shapes=solid.shapes,
                )
            )  # fmt: skip
            joints.append(joint)
            waiting.append((other, name))
    return Ball(_shell_of(radius, shell), NO_FRAME, (), (), tuple(links)), joints


def _shell_of(radius: float, solid: Solid) -> Shell:
    """Return a shell of any inertia (3, 3) and centre of mass (3,), as those of z and the rest."""
    z, inertia = np.array([0.0, 0.0, 1.0]), solid.inertia
    axial, across = float(inertia[2, 2]), float(inertia[0, 0] + inertia[1, 1]) / 2
    return Shell(
        radius, solid.mass, axial, across, z,
        offset=float(solid.centre[2]),
        asymmetry=inertia - np.diag([across, across, axial]),
        aside=solid.centre * [1.0, 1.0, 0.0],
        shapes=solid.shapes,
    )  # fmt: skip


def _nodes(robot: RobotFile, data: Any) -> tuple[list[_Node], int]:
    """Return the nodes of the robot's tree, joined both ways, and the place of the shell."""
    model = robot.model
    root = model.body_rootid[model.geom_bodyid[robot.sphere]]
    nodes: list[_Node] = []
    place: dict[int, int] = {}  # of a body's own node
    for head in range(1, model.nbody):
        if model.body_rootid[head] != root or model.body_weldid[head] != head:
            continue
        welded = [i for i in range(1, model.nbody) if model.body_weldid[i] == head]
        solid = _solid_of(model, data, welded)
        name = _name(model, head)
        joints = [j for j in range(model.njnt) if model.jnt_bodyid[j] == head]
        if head == root:
            joints = []
        above = place.get(model.body_weldid[model.body_parentid[head]])
        for i, joint in enumerate(joints):
            if model.jnt_type[joint] == _BALL:
                raise InputError(f"{name} has a ball joint; take three hinges")
            assert above is not None
            last = i == len(joints) - 1
            between = Solid(0.0, data.xipos[head].copy(), np.zeros((3, 3)))
            label = name if last else f"{name}_{model.joint(joint).name or i}"
            nodes.append(_Node(label, solid if last else between))
            nodes[-1].joints.append((joint, above, -1.0))
            nodes[above].joints.append((joint, len(nodes) - 1, 1.0))
            above = len(nodes) - 1
        if head == root:
            nodes.append(_Node(name, solid))
            above = len(nodes) - 1
        assert above is not None
        place[head] = above
    return nodes, place[model.body_weldid[model.geom_bodyid[robot.sphere]]]


def _name(model: Any, body: int) -> str:
    """Return a body's name as a link's; a model of ours has names without / and some of its own."""
    name = (model.body(body).name or f"body{body}").replace("/", "_")
    return f"{name}_" if name in _OURS else name


def _solid_of(model: Any, data: Any, bodies: list[int]) -> Solid:
    solids = []
    for i in bodies:
        axes = data.ximat[i].reshape(3, 3)
        inertia = axes @ np.diag(model.body_inertia[i]) @ axes.T
        solids.append(Solid(float(model.body_mass[i]), data.xipos[i].copy(), inertia))
    solid = composed(each for each in solids if each.mass > 0)
    return replace(solid, shapes=tuple(shapes_of_geoms(model, data, bodies)))


def _starts_off(robot: RobotFile, data: Any) -> Iterator[str]:
    """Yield how a start misses the plane or the rolling, from which the equations begin."""
    radius, (normal, gap) = float(robot.model.geom_size[robot.sphere, 0]), _above(robot, data)
    if abs(gap) > _HEIGHT * radius:
        way = "above" if gap > 0 else "in"
        yield f"it starts {abs(gap):.3g} m {way} the plane; the equations start on it"
    moving = _moving(robot, data)
    slip = float(np.linalg.norm(moving[3:] - radius * np.cross(moving[:3], normal)))
    if slip > _HEIGHT * max(1.0, float(np.linalg.norm(moving[3:]))):
        yield f"its contact point starts at {slip:.3g} m/s; the equations start without slipping"


def _above(robot: RobotFile, data: Any) -> tuple[Array, float]:
    """Return the plane's normal (3,), world, and how far the sphere is above the plane [m]."""
    normal = data.geom_xmat[robot.plane][2::3]
    away = data.geom_xpos[robot.sphere] - data.geom_xpos[robot.plane]
    return normal, float(away @ normal) - float(robot.model.geom_size[robot.sphere, 0])


def _plane_axes(robot: RobotFile, data: Any) -> Array:
    """Return the rotation (3, 3) from world axes to the plane's; the same where it is level."""
    plane = data.geom_xmat[robot.plane].reshape(3, 3)
    return np.eye(3) if plane[2, 2] > _LEVEL else plane.T


def _moving(robot: RobotFile, data: Any) -> Array:
    """Return the shell's angular velocity and its centre's velocity (6,), world axes."""
    moving = np.zeros(6)
    kind = mujoco.mjtObj.mjOBJ_GEOM
    mujoco.mj_objectVelocity(robot.model, data, kind, robot.sphere, moving, 0)
    return moving


def _start_data(model: Any) -> Any:
    """Return MjData at the first keyframe, or at the file's own start where it has none."""
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    return data


def _contact(robot: RobotFile, start: Any) -> Any:
    """Return MuJoCo's contact of the sphere with the plane, as it mixes their parameters."""
    # There may be none at the start, so the robot is moved until the sphere is in the plane.
    model, plane, data = robot.model, robot.plane, copy(start)
    depth = _TOUCH * model.geom_size[robot.sphere, 0]
    root = model.body_rootid[model.geom_bodyid[robot.sphere]]
    free = int(model.jnt_qposadr[model.body_jntadr[root]])
    normal, gap = _above(robot, data)
    data.qpos[free : free + 3] -= (gap + depth) * normal
    mujoco.mj_forward(model, data)
    for contact in data.contact:
        if {int(contact.geom1), int(contact.geom2)} == {plane, robot.sphere}:
            return contact
    raise InputError(
        "the sphere passes through the plane: their contype and conaffinity exclude each other"
    )


def _passive(model: Any, joint: int) -> Free:
    dof = int(model.jnt_dofadr[joint])
    if np.any(model.jnt_stiffnesspoly[joint]) or np.any(model.dof_dampingpoly[dof]):
        name = model.joint(joint).name
        raise InputError(f"{name}: a stiffness or damping that is no constant is not supported")
    return Free(
        damping=float(model.dof_damping[dof]),
        stiffness=float(model.jnt_stiffness[joint]),
        rest=float(model.qpos_spring[model.jnt_qposadr[joint]]),
        armature=float(model.dof_armature[dof]),
        friction=float(model.dof_frictionloss[dof]),
    )


def _actuators(model: Any, links: Mapping[int, str], data: Any) -> Iterator[Actuator]:
    """Yield the actuators of a file, whose joints move links by name, at the start's controls."""
    for i in range(model.nu):
        name, command = model.actuator(i).name or f"actuator{i}", float(data.ctrl[i])
        if model.actuator_ctrllimited[i]:
            command = float(np.clip(command, *model.actuator_ctrlrange[i]))
        gears = tuple((links[j], ratio) for j, ratio in _gears(model, i, name))
        yield Actuator(name, gears, _law(model, i, name), command)


def _gears(model: Any, i: int, name: str) -> Iterator[tuple[int, float]]:
    """Yield the joints that an actuator moves, with the ratio of each."""
    gear, kind = float(model.actuator_gear[i, 0]), model.actuator_trntype[i]
    on = int(model.actuator_trnid[i, 0])
    if kind in (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)):
        yield on, gear
        return
    if kind != int(mujoco.mjtTrn.mjTRN_TENDON):
        raise InputError(f"{name} moves no joint and no fixed tendon, which alone are supported")
    first = int(model.tendon_adr[on])
    for wrap in range(first, first + int(model.tendon_num[on])):
        if model.wrap_type[wrap] != int(mujoco.mjtWrap.mjWRAP_JOINT):
            raise InputError(
                f"{name} pulls a tendon over sites or geoms; fixed tendons alone are supported"
            )
        yield int(model.wrap_objid[wrap]), gear * float(model.wrap_prm[wrap])


def _law(model: Any, i: int, name: str) -> Law:
    """Return an actuator's law. Raises InputError unless it is affine, without a state."""
    gain, bias = model.actuator_gainprm[i], model.actuator_biasprm[i]
    affine = model.actuator_biastype[i] in (
        int(mujoco.mjtBias.mjBIAS_NONE),
        int(mujoco.mjtBias.mjBIAS_AFFINE),
    )
    if model.actuator_gaintype[i] != int(mujoco.mjtGain.mjGAIN_FIXED) or not affine:
        raise InputError(f"{name}: a gain or bias that is not affine is not supported")
    if model.actuator_dyntype[i] != int(mujoco.mjtDyn.mjDYN_NONE):
        raise InputError(f"{name}: an actuator with a state of its own is not supported")
    b0, b1, b2 = bias[:3].tolist() if model.actuator_biastype[i] else (0.0, 0.0, 0.0)
    limit = np.inf
    if model.actuator_forcelimited[i]:
        low, high = model.actuator_forcerange[i].tolist()
        if low != -high:
            raise InputError(f"{name}: forcerange {low:g} {high:g} is not the same both ways")
        limit = high
    return Law(float(gain[0]), -b1, -b2, b0, float(limit))

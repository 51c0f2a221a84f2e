"""Read a user's whole robot from an MJCF or URDF file: its tree, plane and start.

MuJoCo reads and compiles the file, first in a separate process (`sandbox`). The root of the tree is
the shell, the body with the sphere that touches the plane. A joint above the shell is reversed, so
its axis changes sign. Bodies are described with all joints at 0, in the axes of the shell, from the
centre of the shell's sphere. Bodies that are welded together become one body.

This file has, in order: the model, additions to the file, notes, the tree, the start, actuators,
single bodies. `robot_scene` makes the scene.
"""

import re
from collections.abc import Iterable, Iterator, Mapping
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from operator import attrgetter
from pathlib import Path
from typing import Any

import mujoco
import numpy as np

from robotball.errors import InputError, check_positive, check_size, mujoco_silent, named, unknown
from robotball.robot.ball import Link, Shell, Solid, composed
from robotball.robot.formulas import Rolling
from robotball.robot.scene import Scene
from robotball.robot.shapes import shapes_of_geoms
from robotball.rotations import Array, Z, from_matrix, multiply, rotation_matrix, symmetric
from robotball.user_model.sandbox import COMMENT, check_format, check_loads, in_words, opened_spec

# The flags that disable forces: all flags up to the one for clamped controls, and the one for
# actuation.
_FORCES = 2 * int(mujoco.mjtDisableBit.mjDSBL_CLAMPCTRL) - 1
_FORCES |= int(mujoco.mjtDisableBit.mjDSBL_ACTUATION)
# Plain numbers, because a model has plain numbers, which do not equal MuJoCo's enumerations.
_FREE, _BALL, _SLIDE, _HINGE = map(int, mujoco.mjtJoint.__members__.values())
_GEOMS = mujoco.mjtGeom
_PLANE, _SPHERE = int(_GEOMS.mjGEOM_PLANE), int(_GEOMS.mjGEOM_SPHERE)
_BOX, _MESH = int(_GEOMS.mjGEOM_BOX), int(_GEOMS.mjGEOM_MESH)
# Names of robotball's own parts. A user's body with such a name is renamed.
_OURS = ("shell", "frame", "floor")
_FACES = 0.1  # cosine of the angle to gravity; with a smaller cosine, a plane is a wall
LEVEL = 1 - 1e-12  # cosine of the angle to gravity; with a larger cosine, a plane is level
_HEIGHT = 1e-6  # times the radius or a velocity; a start with a smaller error is on the plane
_TOUCH = 1e-6  # times the radius: the depth at which the contact is read
_MOST_MOVES = 50  # moves of a robot down to its plane
_WITHIN = 1.02  # times the radius: a geom that reaches no farther is inside the shell
_RIM = 0.95  # times the radius: a wheel that reaches this far touches the shell's wall


@dataclass(frozen=True)
class RobotFile:
    """A user's robot file.

    Attributes
    ----------
    path : Path
    spec, model : MjSpec and MjModel
    sphere, plane : int
        The number of the geom that rolls, and the number of its plane or of a level box in place of
        a plane.
    notes : tuple of str
        Notes on additions to a URDF, on values that the file sets implicitly, and on parts that the
        equations omit.
    repairs : dict of str
        Additions and changes without which the robot of an MJCF file cannot roll, with reasons.
    """

    path: Path
    spec: Any
    model: Any
    sphere: int
    plane: int
    notes: tuple[str, ...]
    repairs: Mapping[str, str] = field(default_factory=dict)

    def start(self, key: str | None = None) -> Any:
        """Return MjData at the keyframe `key`; if None, at the first keyframe or else at qpos0.

        Raises InputError for an unknown name.
        """
        # MuJoCo must not reset the robot to the start when a state diverges.
        self.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        data, number = mujoco.MjData(self.model), self.keyframe(key)
        if number is not None:
            mujoco.mj_resetDataKeyframe(self.model, data, number)
        with mujoco_silent():
            mujoco.mj_forward(self.model, data)
        return data

    def keyframe(self, key: str | None) -> int | None:
        """Return the number of a keyframe, by default 0; None if the file has no keyframe."""
        names = [self.model.key(i).name for i in range(self.model.nkey)]
        if key is not None and key not in names:
            raise InputError(f"{self.path}: {unknown('keyframe', key, filter(None, names))}")
        return None if not names else names.index(key) if key else 0

    @cached_property
    def tree(self) -> tuple[Shell, dict[int, Link]]:
        """The shell, and the links by the numbers of their joints."""
        return _tree_of(self)

    @property
    def hinges(self) -> tuple[Array, Array]:
        """The indices of the scene's hinges in qpos and in qvel."""
        joints = [*self.tree[1]]
        return self.model.jnt_qposadr[joints], self.model.jnt_dofadr[joints]

    @property
    def root(self) -> int:
        """The number of the body with the free joint."""
        return int(self.model.body_rootid[self.model.geom_bodyid[self.sphere]])

    @property
    def free(self) -> slice:
        """The indices of the root's position in qpos."""
        at = int(self.model.jnt_qposadr[self.model.body_jntadr[self.root]])
        return slice(at, at + 3)

    @property
    def drift(self) -> slice:
        """The indices of the root's velocity in qvel."""
        at = int(self.model.body_dofadr[self.root])
        return slice(at, at + 3)

    @property
    def radius(self) -> float:
        """The radius of the sphere [m]."""
        return float(self.model.geom_size[self.sphere, 0])

    def above_plane(self, data: Any) -> tuple[Array, float]:
        """Return the plane's normal (3,), world, and the height of the sphere above it [m]."""
        normal = data.geom_xmat[self.plane][2::3]
        away = data.geom_xpos[self.sphere] - self.floor(data)
        return normal, float(away @ normal) - self.radius

    def floor(self, data: Any) -> Array:
        """Return a point (3,) of the plane, world axes; for a box, a point of its top."""
        top = data.geom_xmat[self.plane][2::3] * _half_heights(self.model)[self.plane]
        return np.asarray(data.geom_xpos[self.plane] + top)

    def moving(self, data: Any) -> Array:
        """Return the shell's angular velocity and its centre's velocity (6,), world axes."""
        moving, kind = np.zeros(6), mujoco.mjtObj.mjOBJ_GEOM
        mujoco.mj_objectVelocity(self.model, data, kind, self.sphere, moving, 0)
        return moving

    def slip(self, data: Any, kept: Array | None = None) -> Array:
        """Return the velocity (3,) of the sphere's lowest point [m/s], world axes.

        kept (3,): slip of a scene's start in plane axes, which is subtracted.
        """
        moving, (normal, _) = self.moving(data), self.above_plane(data)
        slip = np.asarray(moving[3:] - self.radius * np.cross(moving[:3], normal))
        return slip if kept is None else slip - self.plane_axes(data).T @ (kept * [1.0, 1.0, 0.0])

    def start_slip(self, data: Any) -> Array:
        """Return the slip along the plane [m/s] and the spin about its normal [rad/s], (3,).

        In plane axes, with 0 in place of rounding errors.
        """
        moving, to_plane = self.moving(data), self.plane_axes(data)
        slip = np.array([*(to_plane @ self.slip(data))[:2], to_plane[2] @ moving[:3]])
        return np.where(np.abs(slip) > _rounding(moving), slip, 0.0)

    def roll(self, data: Any, turning: Array) -> None:
        """Let the whole robot also roll with an angular velocity (3,) [rad/s], world axes."""
        normal, _ = self.above_plane(data)
        at, arm = self.drift.start, data.xpos[self.root] - data.geom_xpos[self.sphere]
        data.qvel[self.drift] += np.cross(turning, arm + self.radius * normal)
        to_root = data.xmat[self.root].reshape(3, 3).T
        data.qvel[at + 3 : at + 6] += to_root @ turning
        mujoco.mj_forward(self.model, data)

    def start_as(self, scene: Scene, key: str | None) -> Any:
        """Return MjData at the start of a scene of the robot, with the controls of a keyframe.

        The sphere just touches the plane.
        """
        model, data, (angles, rates) = self.model, self.start(key), self.hinges
        data.qpos[angles] = [hinge.angle for hinge in scene.hinges]
        data.qvel[:] = 0.0
        data.qvel[rates] = [hinge.rate for hinge in scene.hinges]
        to_world = self.plane_axes(data).T @ scene.start.to_world
        mujoco.mj_kinematics(model, data)
        turn = to_world @ data.geom_xmat[self.sphere].reshape(3, 3).T
        turning = slice(self.free.stop, self.free.stop + 4)
        data.qpos[turning] = multiply(from_matrix(turn), data.qpos[turning])
        mujoco.mj_kinematics(model, data)
        normal, gap = self.above_plane(data)
        data.qpos[self.free] -= gap * normal
        mujoco.mj_forward(model, data)
        # Remove the motion that the hinge rates give to the sphere.
        moving = self.moving(data)
        data.qvel[self.drift] -= self.slip(data)
        mujoco.mj_forward(model, data)
        self.roll(data, to_world @ scene.angular_velocity_at(scene.start) - moving[:3])
        return data

    def plane_axes(self, data: Any) -> Array:
        """Return the rotation (3, 3) from world to plane axes; the identity if it is level."""
        plane = data.geom_xmat[self.plane].reshape(3, 3)
        return np.eye(3) if plane[2, 2] > LEVEL else plane.T

    def contact(self, start: Any) -> Any:
        """Return the contact of sphere and plane, with the parameters that MuJoCo computes for it.

        Raises InputError if they do not collide, or if another contact carries the robot.
        """
        # There may be no contact at the start, so move the robot down into the plane. Each move is
        # shorter than the sphere, so that the sphere cannot miss a ledge.
        model, data, touching = self.model, copy(start), None
        normal, gap = self.above_plane(data)
        count = min(_MOST_MOVES, 1 + int(max(gap, 0.0) / self.radius))
        way = gap + _TOUCH * self.radius
        for part in range(count + 1):
            data.qpos[self.free] = start.qpos[self.free] - part / count * way * normal
            mujoco.mj_forward(model, data)
            for contact in data.contact:
                # A contact with the plane counts only in the last position.
                if part < count and self.plane in (contact.geom1, contact.geom2):
                    continue
                if self.rolls(contact.geom.tolist()):
                    touching = contact
                if words := self.real_contact(data, contact):
                    raise InputError(f"{words}: {self._rule(contact.geom.tolist(), gap)}")
        if touching is None:
            raise InputError("the sphere passes through the plane: check contype and conaffinity")
        return touching

    def _rule(self, pair: Iterable[int], gap: float) -> str:
        """Return which rule is broken by a contact of two geoms, `gap` [m] above the plane."""
        model, bodies = self.model, [self.model.geom_bodyid[i] for i in pair if not self.is_own(i)]
        if not bodies:
            rule = "only the sphere may touch the plane, and only joints hold bodies"
            return f"{rule}; give geoms for drawing contype and conaffinity 0"
        if model.body_weldid[bodies[0]]:
            other = body_name(model, model.body_rootid[bodies[0]])
            return f"{other} moves on its own, but the equations have one robot: remove {other}"
        if gap > _HEIGHT * self.radius:
            return f"the robot starts {gap:.3g} m above the plane and would fall: start lower"
        return "only the plane may touch the robot at its start"

    def rolls(self, pair: Iterable[int]) -> bool:
        """Return whether two geoms are the sphere and the plane."""
        return {*pair} == {self.sphere, self.plane}

    def real_contact(self, data: Any, contact: Any, late: bool = False) -> str:
        """Return which geoms touch, or "" if the contact is only an overlap of solids.

        Parts inside the shell overlap the shell's sphere, which is solid in MuJoCo. late: whether
        the contact began during the motion; an overlap exists from the start.
        """
        pair = contact.geom.tolist()
        if self.rolls(pair) or contact.exclude:
            return ""
        # Name the robot's geoms first.
        part, other = sorted(pair, key=self.is_own, reverse=True)
        if self.is_own(other):
            real = late or self._is_wheel(data, part) or self._is_wheel(data, other)
        else:
            geom, shell = (self.model.geom_bodyid[i] for i in (part, self.sphere))
            welded = self.model.body_weldid[geom] == self.model.body_weldid[shell]
            inside = part != self.sphere and welded and self._reach(data, part) < _WITHIN
            real = self.is_own(part) and not inside
        return " touches ".join(geom_name(self.model, i) for i in (part, other)) if real else ""

    def is_own(self, geom: int) -> bool:
        """Return whether a geom is a part of the robot."""
        return bool(self.model.body_rootid[self.model.geom_bodyid[geom]] == self.root)

    def _reach(self, data: Any, geom: int) -> float:
        """Return the largest distance of a geom from the sphere's centre, divided by the radius."""
        model, place = self.model, data.geom_xpos[geom] - data.geom_xpos[self.sphere]
        reach = np.linalg.norm(place) + model.geom_rbound[geom]
        if model.geom_type[geom] == _MESH:  # a mesh is bounded by the box around it
            first, mesh = model.mesh_vertadr, model.geom_dataid[geom]
            corners = model.mesh_vert[first[mesh] :][: model.mesh_vertnum[mesh]]
            rotated = corners @ data.geom_xmat[geom].reshape(3, 3).T
            reach = np.linalg.norm(place + rotated, axis=1).max()
        return float(reach / self.radius)

    def _is_wheel(self, data: Any, geom: int) -> bool:
        """Return whether a round geom turns about its own centre and touches the shell's wall."""
        model, body = self.model, int(self.model.geom_bodyid[geom])
        joint, size = int(model.body_jntadr[body]), float(model.geom_size[geom, 0])
        if geom == self.sphere or joint < 0 or model.jnt_type[joint] != _HINGE:
            return False
        middle, axis = data.geom_xpos[geom], data.xaxis[joint]
        off = float(np.linalg.norm(np.cross(middle - data.xanchor[joint], axis)))
        # The rim of a wheel is orthogonal to its axis. The axis of a flywheel, which is not a
        # wheel, passes through the sphere's centre.
        place = middle - data.geom_xpos[self.sphere]
        along = place @ axis
        out = float(np.linalg.norm(place - along * axis))
        return off < 0.1 * size < 0.1 * out and np.hypot(out + size, along) > _RIM * self.radius


def geom_name(model: Any, geom: int) -> str:
    """Return a geom's name, or a name made of the name of the geom's body."""
    return model.geom(geom).name or f"a geom of {body_name(model, model.geom_bodyid[geom])}"


def body_name(model: Any, body: int) -> str:
    """Return a body's name, or a name made of its number."""
    return model.body(body).name or unused_name(model, "body", f"body{body}")


def unused_name(model: Any, kind: str, name: str) -> str:
    """Return a name, with underscores if the model has an object of this kind with that name."""
    names = {getattr(model, kind)(i).name for i in range(getattr(model, f"n{kind}"))}
    while name in names:
        name += "_"
    return name


def open_robot(path: Path, shell: str | None = None) -> RobotFile:
    """Return the robot of a file. A missing plane or free joint is added.

    shell: the name of the body or geom that rolls, if there are several candidates. Raises
    InputError if MuJoCo refuses the file or needs too much time or memory, or if nothing can roll.
    """
    check_format(path)
    check_loads(path)
    try:
        spec, notes = opened_spec(path)
        model = spec.compile()
        repairs = dict([*_plane_added(spec, model, shell), *_free_joint_added(spec, model, shell)])
        if repairs:
            model = spec.compile()
        _check_supported(model)
        sphere = _sphere(model, shell)
        plane = _floor(model, sphere)
    except (ValueError, mujoco.FatalError) as error:
        raise InputError(f"{path}: {in_words(str(error))}") from None
    notes += [*_inferred(spec), *_ignored(model, sphere, plane)]
    if _root_tag(path) == "robot":
        notes = [f"{words}, because a URDF has none" for words in repairs.values()] + notes
        repairs = {}
    return RobotFile(path, spec, model, sphere, plane, tuple(notes), repairs)


def _root_tag(path: Path) -> str:
    root = re.search(r"<(\w+)", COMMENT.sub("", path.read_text(errors="replace")))
    return root[1] if root else ""


def _sphere(model: Any, shell: str | None) -> int:
    """Return the number of the geom that rolls: the one named by `shell`, or the largest sphere."""
    spheres = np.flatnonzero(_solid(model) & (model.geom_type == _SPHERE)).tolist()
    if not spheres:
        needed = "the shell needs a geom of type sphere with a nonzero contype or conaffinity"
        raise InputError(f"no sphere can touch the plane: {needed} (a mesh rolls on its corners)")
    # If there is another sphere, a sphere of the world body is only a marker.
    spheres = [i for i in spheres if model.geom_bodyid[i]] or spheres
    names = {i: (model.geom(i).name, model.body(model.geom_bodyid[i]).name) for i in spheres}
    if shell is not None:
        spheres = [i for i, either in names.items() if shell in either]
        if not spheres:
            known = [name for either in names.values() for name in either if name]
            raise unknown("sphere that can roll, or its body,", shell, known)
    largest = max(model.geom_size[i, 0] for i in spheres)
    outermost = [i for i in spheres if model.geom_size[i, 0] == largest]
    if len(outermost) > 1:
        several = ", ".join(" of ".join(filter(None, names[i])) for i in outermost)
        line = f"several spheres of {largest:g} m could roll: {several}; choose one with `--shell`"
        raise InputError(f"{line} or `shell`, or set contype and conaffinity of the others to 0")
    return outermost[0]


def _solid(model: Any) -> Any:
    """Return for each geom whether it can touch other geoms."""
    paired = np.isin(np.arange(model.ngeom), (model.pair_geom1, model.pair_geom2))
    return paired | ((model.geom_contype | model.geom_conaffinity) != 0)


def _standing(model: Any, sphere: int) -> list[int]:
    """Return the solid geoms that are fixed to the world and do not belong to the robot."""
    fixed, root = (it[model.geom_bodyid] for it in (model.body_weldid == 0, model.body_rootid))
    # A robot without a joint at its root is fixed to the world until a free joint is added.
    return np.flatnonzero(_solid(model) & fixed & (root != root[sphere])).tolist()


def _half_heights(model: Any) -> Array:
    """Return half the height of each geom that is a box, and 0 for other geoms."""
    return np.where(model.geom_type == _BOX, model.geom_size[:, 2], 0.0)


def _kind(model: Any, geom: int) -> str:
    kind = _GEOMS(model.geom_type[geom]).name.removeprefix("mjGEOM_").lower()
    return f"{geom_name(model, geom)} is a {kind}"


def _plane_added(spec: Any, model: Any, shell: str | None) -> Iterator[tuple[str, str]]:
    sphere = _sphere(model, shell)
    if len(_floors(model, sphere)):
        return
    if others := _standing(model, sphere):
        floor = f"{_kind(model, others[0])}, but the ball must roll on a plane or a box"
        raise InputError(f'{floor}: put <geom type="plane" size="1 1 .1"/> there')
    roots = model.body_rootid[model.geom_bodyid]
    if len(moving := np.flatnonzero(_solid(model) & (roots != roots[sphere]))):
        floor = f"{_kind(model, moving[0])} that moves, but the ball must roll on a fixed floor"
        raise InputError(f"{floor}: fix the geom to the world, or add a plane")
    height = round(float(_placed(model).geom_xpos[sphere, 2] - model.geom_size[sphere, 0]), 9)
    spec.worldbody.add_geom(type=_PLANE, size=[0, 0, 1], pos=[0, 0, height])
    yield "floor", f"there is no floor; a plane is added under the sphere, at height {height:g} m"


def _placed(model: Any) -> Any:
    """Return MjData of a model at its start."""
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_kinematics(model, data)
    return data


def _floors(model: Any, sphere: int) -> Any:
    """Return the numbers of the planes, or else of the boxes, whose upper side faces gravity."""
    if len(planes := np.flatnonzero(model.geom_type == _PLANE)):
        return planes
    boxes = [i for i in _standing(model, sphere) if model.geom_type[i] == _BOX]
    data, down = _placed(model), model.opt.gravity / (np.linalg.norm(model.opt.gravity) or 1.0)
    faces = data.geom_xmat[boxes][:, 2::3] @ down < -_FACES
    return np.array(boxes, dtype=int)[faces]


def _floor(model: Any, sphere: int) -> int:
    """Return the plane under the sphere: the nearest solid plane that faces gravity."""
    data, planes = _placed(model), _floors(model, sphere)
    normals = data.geom_xmat[planes][:, 2::3]
    away = np.einsum("ij,ij->i", data.geom_xpos[sphere] - data.geom_xpos[planes], normals)
    away -= _half_heights(model)[planes]
    faces = normals @ model.opt.gravity < -_FACES * np.linalg.norm(model.opt.gravity)
    unlikely = np.where(_solid(model)[planes], 0.0, 2.0) + ~faces
    order = np.lexsort([np.abs(away - model.geom_size[sphere, 0]), unlikely])
    return int(planes[order[0]])


def _free_joint_added(spec: Any, model: Any, shell: str | None) -> Iterator[tuple[str, str]]:
    """Add a free joint, or remove damping, armature and friction from the robot's free joint."""
    root = model.body_rootid[model.geom_bodyid[_sphere(model, shell)]]
    joints = model.jnt_type[model.jnt_bodyid == root].tolist()
    name = body_name(model, root)
    if root == 0:
        raise InputError("the sphere belongs to the world: put it in a body with a <freejoint/>")
    if not joints:
        _add_free_joint(spec, model, root)
        yield "freejoint", f"{name} has no joint and is fixed to the world; <freejoint/> is added"
    elif joints != [_FREE]:
        own = np.flatnonzero(model.jnt_bodyid == root).tolist()
        others = ", ".join(model.joint(i).name or f"joint {i}" for i in own)
        raise InputError(f"{name} must be free: put a <freejoint/> in place of {others}")
    else:
        joint, found = spec.bodies[root].joints[0], dict[str, str]()
        for kind in ("damping", "armature", "frictionloss", "stiffness"):
            value, default = getattr(joint, kind), getattr(joint.classname.joint, kind)
            if np.any(value):
                inherited = np.all(value == default)
                source = f", of the default class {joint.classname.name}," if inherited else ""
                found[f"{kind} {np.ravel(value)[0]:g}"] = source
                setattr(joint, kind, 0.0 * value)
        if found:
            acts = f"{' and '.join(found)}{max(found.values())} act{'s' * (len(found) == 1)}"
            words = f"{acts} on the free joint of {name}, and so on the whole robot"
            yield "freejoint", f"{words}; a <freejoint/>, which takes no defaults, replaces it"


def _add_free_joint(spec: Any, model: Any, root: int) -> None:
    """Add a free joint to a body, with the body's position in each keyframe."""
    spec.bodies[root].add_freejoint()
    after = model.jnt_bodyid > root
    at = min(model.jnt_qposadr[after], default=model.nq)
    dof = min(model.jnt_dofadr[after], default=model.nv)
    for key in spec.keys:
        if len(key.qpos):
            key.qpos = np.insert(key.qpos, at, [*model.body_pos[root], *model.body_quat[root]])
        if len(key.qvel):
            key.qvel = np.insert(key.qvel, dof, np.zeros(6))


# Features that the equations do not have, each with a number of the model that is 0 without it.
_UNSUPPORTED = {
    "an equality constraint": "eq_active0",
    "the drag of a medium (density or viscosity)": "opt.density opt.viscosity",
    "gravcomp, which takes weight off the plane,": "body_gravcomp",
    "a tendon with a spring, a damper, friction or limits":
        "tendon_stiffness tendon_damping tendon_frictionloss tendon_limited",
    "a tendon with actuatorfrcrange or armature": "tendon_actfrclimited tendon_armature",
    "an actuator's delay": "actuator_delay",
    "an actuator with damping that is not constant": "actuator_dampingpoly",
    "a plugin": "nplugin",
    "a joint that yields (springyield)": "jnt_springyield",
    "a surface that moves (surfacevel)": "geom_surfacevel",
    "a group of disabled actuators": "opt.disableactuator",
}  # fmt: skip


def _check_supported(model: Any) -> None:
    """Raise InputError for features that the equations do not have."""
    unsupported = {
        **{feature: attrgetter(*names.split())(model) for feature, names in _UNSUPPORTED.items()},
        "an actuator with several controls": model.actuator_ctrlnum != 1,
        "a flag that disables gravity, contacts or other forces": model.opt.disableflags & _FORCES,
    }
    for feature, values in unsupported.items():
        if any(map(np.any, values if isinstance(values, tuple) else (values,))):
            raise InputError(f"{feature} is not supported; remove it from the file")
    check_positive("timestep", model.opt.timestep, "s")
    check_size("gravity", float(np.abs(model.opt.gravity).max()), "m/s²")
    gears_of(model)  # refuses gears that are too large, and unsupported actuators


def _inferred(spec: Any) -> Iterator[str]:
    """Yield bodies with a mass from the density of geoms, if other bodies have an inertial."""
    bodies = spec.bodies[1:]
    if any(body.explicitinertial for body in bodies):
        for body in bodies:
            if not body.explicitinertial and any(geom.mass != geom.mass for geom in body.geoms):
                yield f"{body.name} has no inertial; its mass is computed from its geoms' density"


def _ignored(model: Any, sphere: int, plane: int) -> Iterator[str]:
    """Yield bodies and fixed geoms that the robot may touch, but that the equations omit."""
    root = model.body_rootid[model.geom_bodyid[sphere]]
    for i in range(1, model.nbody):
        if model.body_dofnum[i] and model.body_rootid[i] != root and model.body_rootid[i] == i:
            yield f"{_name(model, i)} is not part of the robot; the equations leave it out"
    names = (geom_name(model, i) for i in _standing(model, sphere) if i != plane)
    if beside := ", ".join(dict.fromkeys(names)):
        yield f"the equations leave out {beside}; `robotball check` says when the robot touches it"


def _tree_of(robot: RobotFile) -> tuple[Shell, dict[int, Link]]:
    """Return the shell of a file, and the links by the numbers of their joints."""
    model, data = robot.model, mujoco.MjData(robot.model)
    data.qpos[model.jnt_qposadr[np.isin(model.jnt_type, (_SLIDE, _HINGE))]] = 0.0
    mujoco.mj_kinematics(model, data)
    # Place the robot so that the axes of the sphere are the world axes.
    to_shell = data.geom_xmat[robot.sphere].reshape(3, 3).T.copy()
    turning = slice(robot.free.stop, robot.free.stop + 4)
    data.qpos[turning] = multiply(from_matrix(to_shell), data.qpos[turning])
    data.qpos[robot.free] = to_shell @ (data.qpos[robot.free] - data.geom_xpos[robot.sphere])
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    nodes, joints, of_shell = _nodes(robot, data)
    links: dict[int, Link] = {}
    waiting = [(of_shell, "shell")]
    while waiting:
        at, parent = waiting.pop()
        for joint, above, below in joints:
            if at not in (above, below) or joint in links:  # this joint is already in the tree
                continue
            other, sign = (below, 1.0) if at == above else (above, -1.0)
            name, solid = nodes[other]
            limits = model.joint(joint).name or f"joint{joint}", *model.jnt_range[joint].tolist()
            body = name, parent, solid.mass, solid.inertia, solid.centre
            axis, pivot = sign * data.xaxis[joint], data.xanchor[joint].copy()
            slides = bool(model.jnt_type[joint] == _SLIDE)
            limited = limits if model.jnt_limited[joint] else None
            links[joint] = Link(*body, axis, pivot, slides, limited, shapes=solid.shapes)
            waiting.append((other, name))
    return _shell_of(robot.radius, nodes[of_shell][1]), links


def _shell_of(radius: float, solid: Solid) -> Shell:
    """Return a solid as a shell: its symmetric part about z, and its asymmetry and offset."""
    inertia = solid.inertia
    axial, across = float(inertia[2, 2]), float(inertia[0, 0] + inertia[1, 1]) / 2
    asymmetry, aside = inertia - np.diag([across, across, axial]), solid.centre * [1.0, 1.0, 0.0]
    moments, offset = (axial, across), float(solid.centre[2])
    return Shell(radius, solid.mass, *moments, Z, offset, asymmetry, aside, shapes=solid.shapes)


def _nodes(
    robot: RobotFile, data: Any
) -> tuple[list[tuple[str, Solid]], list[tuple[int, int, int]], int]:
    """Return the nodes of the robot's tree, its joints, and the number of the shell's node.

    A node has the name of a body, and that body with all bodies that are welded to it. A body with
    several joints has massless nodes between the joints. A joint is (number, node above, node
    below).
    """
    model = robot.model
    nodes: list[tuple[str, Solid]] = []
    edges: list[tuple[int, int, int]] = []
    place: dict[int, int] = {}  # the node of a body
    heads = model.body_weldid == np.arange(model.nbody)
    for head in np.flatnonzero(heads & (model.body_rootid == robot.root)).tolist():
        welded = np.flatnonzero(model.body_weldid == head).tolist()
        shapes = tuple(shapes_of_geoms(model, data, welded))
        solid, name = replace(_solid_of(model, data, welded), shapes=shapes), _name(model, head)
        # The free joint of the root is not in the tree.
        joints = [None] if head == robot.root else np.flatnonzero(model.jnt_bodyid == head).tolist()
        above = place.get(model.body_weldid[model.body_parentid[head]], 0)
        for i, joint in enumerate(joints):
            if joint == joints[-1]:
                nodes.append((name, solid))
            else:
                between = Solid(0.0, data.xipos[head].copy(), np.zeros((3, 3)))
                nodes.append((f"{name}_{model.joint(joint).name or i}", between))
            if joint is not None:
                if model.jnt_type[joint] == _BALL:
                    raise InputError(f"{name} has a ball joint; use three hinges")
                edges.append((joint, above, len(nodes) - 1))
            above = len(nodes) - 1
        place[head] = above
    return nodes, edges, place[model.body_weldid[model.geom_bodyid[robot.sphere]]]


def _name(model: Any, body: int) -> str:
    """Return the name of a body's link, without "/" and unlike the names of robotball's parts."""
    name = body_name(model, body).replace("/", "_")
    return f"{name}_" if name in _OURS else name


def _solid_of(model: Any, data: Any, bodies: Iterable[int]) -> Solid:
    """Return bodies of a model as one solid, at the positions in `data`, world axes."""
    solids = []
    for i in bodies:
        axes = data.ximat[i].reshape(3, 3)
        inertia = axes @ np.diag(model.body_inertia[i]) @ axes.T
        symmetric = (inertia + inertia.T) / 2
        solids.append(Solid(float(model.body_mass[i]), data.xipos[i].copy(), symmetric))
    return composed(solid for solid in solids if solid.mass > 0)


def _rounding(moving: Array) -> float:
    """Return the speed [m/s] up to which a slip is a rounding error, for a sphere's motion (6,)."""
    return _HEIGHT * max(1.0, float(np.linalg.norm(moving[3:])))


def start_misses(
    robot: RobotFile, data: Any, kept: Array | None = None
) -> Iterator[tuple[str, str]]:
    """Yield how a start differs from the start of the equations, and how the equations start.

    kept (3,): the slip with which the equations start; None for no slip.
    """
    gap = robot.above_plane(data)[1]
    if abs(gap) > _HEIGHT * robot.radius:
        yield f"it starts {abs(gap):.3g} m {'above' if gap > 0 else 'in'} the plane", "on it"
    slip = float(np.linalg.norm(robot.slip(data, kept)))
    if slip > _rounding(robot.moving(data)):
        yield f"its contact point slips at {slip:.3g} m/s at the start", "without slip"


def starts_off(robot: RobotFile, data: Any, kept: Array | None = None) -> Iterator[str]:
    """Yield how a start differs from the start of the equations; kept as in `start_misses`."""
    for miss, instead in start_misses(robot, data, kept):
        yield f"{miss}; the equations start {instead}"
    if robot.contact(data).dim == 1:
        yield "its contact has no friction (condim 1); in the equations the ball rolls"
    # Parts inside the shell may touch the shell.
    model, pairs = robot.model, data.contact.geom
    near = pairs[(pairs == robot.sphere)[:, ::-1]]
    for name in sorted({body_name(model, model.geom_bodyid[i]) for i in near if i != robot.plane}):
        yield f"{name} touches the shell, but passes through it in the equations"


def default_class(robot: RobotFile, kind: str) -> str:
    """Return a text that names the default class of the sphere's or plane's attributes, if any."""
    builtin = getattr(mujoco.MjSpec().default.geom, kind)
    for geom in robot.spec.geoms:
        default = getattr(geom.classname.geom, kind)
        inherited = np.all(getattr(geom, kind) == default) and np.any(default != builtin)
        if geom.id in (robot.sphere, robot.plane) and inherited and not _is_paired(robot):
            return f" ({kind} of the default class {geom.classname.name})"
    return ""


def _is_paired(robot: RobotFile) -> bool:
    model = robot.model
    return any(map(robot.rolls, zip(model.pair_geom1, model.pair_geom2, strict=True)))


def friction_source(robot: RobotFile) -> str:
    """Return where MuJoCo takes the friction of sphere and plane from."""
    model, geoms = robot.model, [robot.plane, robot.sphere]
    if model.opt.enableflags & int(mujoco.mjtEnableBit.mjENBL_OVERRIDE):
        return "o_friction, as the option has the flag override"
    if _is_paired(robot):
        return "the file's <pair>"
    plane, sphere = (f"{geom_name(model, i)} ({model.geom_friction[i, 0]:g})" for i in geoms)
    first, second = model.geom_priority[geoms]
    if first == second:
        return f"the larger of {plane} and {sphere}{default_class(robot, 'friction')}"
    return f"{plane if first > second else sphere}, which has the higher priority"


def rolling_of(contact: Any) -> Rolling:
    """Return the rolling model of a contact: rubber if it resists spinning."""
    return "rubber" if contact.dim > 3 else "classical"


def gears_of(model: Any) -> dict[str, dict[int, float]]:
    """Return for each actuator's name the joints that the actuator moves, with their gears.

    Raises InputError for an unsupported actuator.
    """
    gears: dict[str, dict[int, float]] = {}
    for i in range(model.nactuator):
        name = model.actuator(i).name or f"actuator{i}"
        moved = gears.setdefault(name, {})
        for joint, ratio in _moved(model, i, name):
            if model.jnt_type[joint] not in (_SLIDE, _HINGE):
                raise InputError(f"{name} moves a free or a ball joint; use hinges or slides")
            check_size(f"the gear of {name}", ratio)
            moved[joint] = moved.get(joint, 0.0) + ratio
    return gears


def _moved(model: Any, i: int, name: str) -> Iterator[tuple[int, float]]:
    """Yield the joints that an actuator moves, with their gears."""
    gear, kind = float(model.actuator_gear[i, 0]), model.actuator_trntype[i]
    on = int(model.actuator_trnid[i, 0])
    if kind in (int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)):
        yield on, gear
        return
    if kind != int(mujoco.mjtTrn.mjTRN_TENDON):
        raise InputError(f"{name} moves no joint; only joints and fixed tendons are supported")
    first = int(model.tendon_adr[on])
    for wrap in range(first, first + int(model.tendon_num[on])):
        if model.wrap_type[wrap] != int(mujoco.mjtWrap.mjWRAP_JOINT):
            raise InputError(f"{name} pulls a spatial tendon; only fixed tendons are supported")
        yield int(model.wrap_objid[wrap]), gear * float(model.wrap_prm[wrap])


def solid_of_file(path: Path, kind: str, name: str) -> Solid:
    """Return a "body" of an MJCF file or a "link" of a URDF file, with all bodies fixed to it.

    The solid is in the axes of the body. Raises InputError if the file cannot be loaded or has no
    such body, or if the body has no inertia or has moving children.
    """
    # An MJCF file is compiled, because masses may follow from geoms. A URDF file is not compiled,
    # because compiling could fail for another link or for a mesh.
    check_loads(path, "compiled" if kind == "body" else "parsed")
    with named(path):
        if kind == "link" and (root := _root_tag(path)) not in ("", "robot"):
            # MuJoCo would also read MJCF.
            raise InputError(f"not a URDF: its root is <{root}>, not <robot>")
        spec = opened_spec(path)[0] if kind == "body" else mujoco.MjSpec.from_file(str(path))
        if (body := spec.body(name)) is None:
            raise unknown(kind, name, [body.name for body in spec.bodies[1:]])
        fixed = [*_fixed_to(body, f"{kind} {name!r}", np.zeros(3), np.eye(3))]
        if kind == "body":
            return _of_model(spec.compile(), [part.id for part, _, _ in fixed], name)
        if not (weighed := [part for part in fixed if part[0].explicitinertial]):
            raise InputError(f"link {name!r} has no inertial")
        return composed(_inertial(*part) for part in weighed)


def _fixed_to(
    body: Any, root: str, origin: Array, axes: Array
) -> Iterator[tuple[Any, Array, Array]]:
    """Yield a body of a spec and all bodies fixed to it, with their origins and axes (3, 3)."""
    yield body, origin, axes
    for child in body.bodies:
        if child.joints:
            raise InputError(f"{root} carries {child.name!r}, which moves: give each its own table")
        turned = axes @ rotation_matrix(child.quat)
        yield from _fixed_to(child, root, origin + axes @ child.pos, turned)


def _of_model(model: Any, bodies: list[int], name: str) -> Solid:
    """Return bodies of a model as one solid, in the axes of the first."""
    if not model.body_mass[bodies].any():
        raise InputError(f"body {name!r} has no mass")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    solid, to_body = _solid_of(model, data, bodies), data.xmat[bodies[0]].reshape(3, 3).T
    centre = to_body @ (solid.centre - data.xpos[bodies[0]])
    return Solid(solid.mass, centre, to_body @ solid.inertia @ to_body.T)


def _inertial(link: Any, origin: Array, axes: Array) -> Solid:
    if not link.mass > 0:
        raise InputError(f"link {link.name!r}'s inertial has no mass: {link.mass:g} kg")
    turned = axes @ rotation_matrix(link.iquat)
    return Solid(
        link.mass, origin + axes @ link.ipos, turned @ symmetric(*link.fullinertia) @ turned.T
    )

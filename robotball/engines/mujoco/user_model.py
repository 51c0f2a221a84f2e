"""A user's own model, stepped by plain mj_step as its file says, and observed as any engine's run.

Its controls are set before every step, as a loop around mj_step would. What only a user's file has,
geoms that touch inside, joints with a range and servos that lag, is seen in the same loop.
"""

import time
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import mujoco
import numpy as np

from robotball.drives import Constant, Drive
from robotball.engines.mujoco import LABEL
from robotball.engines.observe import Readings, Recording
from robotball.engines.states import lifting
from robotball.equations import Rolling
from robotball.errors import InputError, unknown
from robotball.files.robot_file import RobotFile, gears_of, hinged, scene_of
from robotball.loads import Loads
from robotball.motion import DIVERGED, ContactMotion, EngineSettings
from robotball.rotations import Array, from_matrix, rotation_matrix
from robotball.scene import Scene


@dataclass(frozen=True)
class UserModel:
    """A user's model, how it is controlled, and where it starts.

    controls: of actuators by name; the others keep those of the keyframe. push: of the robot as a
    whole at the start, the speed along X at which it rolls [m/s].
    """

    robot: RobotFile
    controls: Mapping[str, Drive]
    key: str | None
    push: float = 0.0

    def __post_init__(self) -> None:
        for name in self.controls:
            if name not in self.actuators:
                raise unknown("actuator", name, self.actuators)

    @cached_property
    def actuators(self) -> dict[str, int]:
        """The numbers of the actuators by name."""
        return {name: i for i, name in enumerate(gears_of(self.robot.model))}

    @cached_property
    def hinges(self) -> tuple[list[int], list[int]]:
        """The places of the scene's hinges among qpos and among qvel."""
        model, joints = self.robot.model, hinged(self.robot)
        return [int(model.jnt_qposadr[j]) for j in joints], [
            int(model.jnt_dofadr[j]) for j in joints
        ]

    @property
    def steady(self) -> bool:
        """True if no control changes, so that many steps are one call."""
        return all(isinstance(value, Constant) for value in self.controls.values())

    @property
    def radius(self) -> float:
        """The radius of the sphere that rolls [m]."""
        return float(self.robot.model.geom_size[self.robot.sphere, 0])

    def begin(self) -> mujoco.MjData:
        """Return MjData at the start."""
        robot, data = self.robot, self.robot.start(self.key)
        self.control(data)
        if self.push:
            root, first = robot.root, int(robot.model.body_dofadr[robot.root])
            turning = np.array([0.0, self.push / self.radius, 0.0])
            arm = data.xpos[root] - data.geom_xpos[robot.sphere]
            data.qvel[first : first + 3] = np.cross(turning, arm)
            data.qvel[first] += self.push
            data.qvel[first + 3 : first + 6] = data.xmat[root].reshape(3, 3).T @ turning
            mujoco.mj_forward(robot.model, data)
        return data

    def control(self, data: mujoco.MjData) -> None:
        """Set the controls at the data's time."""
        for name, value in self.controls.items():
            data.ctrl[self.actuators[name]] = value.rate(data.time)

    def scene(self, rolling: Rolling, duration: float) -> Scene:
        """Return the scene that the reference rolls. Raises InputError for what it has not."""
        try:
            return scene_of(self.robot, self.begin(), self.controls, rolling, duration)
        except InputError as error:
            raise InputError(f"{self.robot.path}: {error}") from None

    def meets(self, duration: float) -> tuple[float, str] | None:
        """Return when [s] a part first touches another or a fixed body, if any does, and which.

        The model is stepped as its file says, up to a duration [s].
        """
        robot, data = self.robot, self.begin()
        if np.sum(robot.model.geom_contype | robot.model.geom_conaffinity > 0) <= 2:
            return None  # sphere and plane
        while data.time < duration and np.all(np.isfinite(data.qpos)):
            self.control(data)
            mujoco.mj_step(robot.model, data)
            for contact in data.contact:
                if words := robot.meeting(data, contact, late=True):
                    return float(data.time), words
        return None

    def path(self, times: Array) -> Array:
        """Return the contact points (n, 2) [m] at equal times (n,) [s]; NaN where it diverged.

        It takes as many steps at once as it can, and reads nothing else.
        """
        model, data = self.robot.model, self.begin()
        # A state that diverged would go on from the start.
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        count = round((times[1] - times[0]) / model.opt.timestep)
        at_once = count if self.steady else 1
        centres = np.full((len(times), 3), np.nan)
        mujoco.mj_kinematics(model, data)
        centres[0] = data.geom_xpos[self.robot.sphere]
        for i in range(1, len(times)):
            for _ in range(count // at_once):
                self.control(data)
                mujoco.mj_step(model, data, at_once)
            if not np.all(np.isfinite(data.qpos)):
                break
            mujoco.mj_kinematics(model, data)
            centres[i] = data.geom_xpos[self.robot.sphere]
        return np.asarray((centres - centres[0]) @ self.robot.plane_axes(data).T)[:, :2]


@dataclass
class Seen:
    """What only a user's model shows, over all steps of a run.

    inside: by two geoms that overlap from the start, the part of the steps in which they do;
    limits: joints that reach their range, and when [s]; delivered: the part of the declared
    resistance to rolling; lag: of servos by name, root mean square over the command's.
    """

    inside: Counter[tuple[int, int]] = field(default_factory=Counter)
    limits: dict[str, float] = field(default_factory=dict)
    delivered: float | None = None
    lag: dict[str, float] = field(default_factory=dict)


def observed(
    user: UserModel, scene: Scene, tolerance: float, name: str = "as it is"
) -> tuple[ContactMotion, Seen]:
    """Step a model as it is over the scene's duration; return its motion and what else it shows.

    The motion has every step, up to one that diverges, and no momentum.
    tolerance: the slip over the path beyond which it is a fault; name: of its settings.
    """
    model, data = user.robot.model, user.begin()
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    tally, rows, began = _Tally(user), list[Array](), time.process_time()
    while data.time < scene.duration and np.all(np.isfinite(data.qpos)):
        user.control(data)
        # A step by RK4 leaves the contacts of its last stage, so those of the state are made first.
        mujoco.mj_forward(model, data)
        rows.append(_row(user, data))
        tally.add(data)
        mujoco.mj_step(model, data)
    settings = EngineSettings(name=name, error_tolerance=tolerance, stop_at_fault=False)
    recording = Recording(LABEL, scene, settings, np.array(rows)[:, 0])
    recording.add(_readings_of(user, scene, np.array(rows)))
    seconds = time.process_time() - began
    return recording.motion(model.opt.timestep, len(rows), seconds), tally.seen()


def _row(user: UserModel, data: mujoco.MjData) -> Array:
    """Return the numbers of a state: time, place and velocity of the sphere's centre, attitude,
    turning, the contact's force, depth and coefficient of friction (NaN without a contact), and
    the hinges' angles and rates.
    """
    robot, moving = user.robot, np.zeros(6)
    kind = mujoco.mjtObj.mjOBJ_GEOM
    mujoco.mj_objectVelocity(robot.model, data, kind, robot.sphere, moving, 0)
    to_plane, force, depth, friction = robot.plane_axes(data), np.full(3, np.nan), np.nan, np.nan
    for i, contact in enumerate(data.contact):
        if robot.rolls(contact):
            wrench = np.zeros(6)
            mujoco.mj_contactForce(robot.model, data, i, wrench)
            force = lifting([to_plane @ (wrench[:3] @ contact.frame.reshape(3, 3))])
            depth, friction = -contact.dist, contact.friction[0]
    place = to_plane @ (data.geom_xpos[robot.sphere] - data.geom_xpos[robot.plane])
    attitude = from_matrix(to_plane @ data.geom_xmat[robot.sphere].reshape(3, 3))
    velocity, turning = to_plane @ moving[3:], to_plane @ moving[:3]
    hinges = [*data.qpos[user.hinges[0]], *data.qvel[user.hinges[1]]]
    loads = [*force, depth, friction]
    return np.array([data.time, *place, *velocity, *attitude, *turning, *loads, *hinges])


def _readings_of(user: UserModel, scene: Scene, rows: Array) -> Readings:
    """Return the readings of rows."""
    count = len(scene.hinges)
    times, place, velocity, attitude, turning, force, depth, friction, angles, rates = np.split(
        rows, np.cumsum([1, 3, 3, 4, 3, 3, 1, 1, count]), axis=1
    )
    sound = np.asarray((np.abs(rows[:, :14]) < DIVERGED).all(axis=1))
    slip = velocity - user.radius * np.cross(turning, [0.0, 0.0, 1.0])
    unknown_loads = Loads.unknown(len(rows), count)
    loads = replace(unknown_loads, contact_force=np.nan_to_num(force))
    return Readings(
        time=times[:, 0],
        centre=np.column_stack([place[:, :2] - place[0, :2], user.radius - depth]),
        attitude=attitude,
        angular_velocity=np.einsum("nji,nj->ni", rotation_matrix(attitude), turning),
        momentum=np.full_like(place, np.nan),
        hinge_angles=angles,
        hinge_rates=rates,
        loads=loads,
        slip=np.linalg.norm(slip[:, :2], axis=1),
        spin=turning[:, 2],
        friction_used=loads.sliding_friction / friction[:, 0],
        touching=np.isfinite(depth[:, 0]),
        sound=sound,
    )


class _Tally:
    """What only a user's model shows, counted over the steps so far."""

    def __init__(self, user: UserModel) -> None:
        self.user, model = user, user.robot.model
        self.limited = np.flatnonzero(model.jnt_limited)
        self.inside: Counter[tuple[int, int]] = Counter()
        self.limits: dict[str, float] = {}
        self.resistance, self.steps = np.zeros(2), 0  # given and declared
        self.asked, self.missed = np.zeros(model.nu), np.zeros(model.nu)

    def add(self, data: mujoco.MjData) -> None:
        """Count a state, whose contacts are up to date."""
        robot, model, force = self.user.robot, self.user.robot.model, np.zeros(6)
        self.steps += 1
        others = set()
        for i, contact in enumerate(data.contact):
            pair = int(contact.geom1), int(contact.geom2)
            late = self.steps > 1
            if not robot.rolls(contact):
                if pair in self.inside or not robot.meeting(data, contact, late):
                    others.add(pair)
            elif contact.dim == 6:
                mujoco.mj_contactForce(model, data, i, force)
                self.resistance += np.linalg.norm(force[4:]), force[0] * contact.friction[3]
        self.inside.update(others)
        at, (low, high) = model.jnt_qposadr[self.limited], model.jnt_range[self.limited].T
        for j in self.limited[(data.qpos[at] < low) | (data.qpos[at] > high)]:
            self.limits.setdefault(model.joint(j).name or f"joint {j}", data.time)
        # A position servo follows its length, any other its velocity.
        follows = np.where(
            model.actuator_biasprm[:, 1], data.actuator_length, data.actuator_velocity
        )
        self.asked += data.ctrl**2
        self.missed += (data.ctrl - follows) ** 2

    def seen(self) -> Seen:
        """Return the counts over the number of steps."""
        model, (given, declared) = self.user.robot.model, self.resistance
        lag = {
            name: float(np.sqrt(self.missed[i] / self.asked[i]))
            for name, i in self.user.actuators.items()
            if model.actuator_biastype[i] and self.asked[i]
        }
        inside = Counter({pair: count / self.steps for pair, count in self.inside.items()})
        return Seen(inside, self.limits, float(given / declared) if declared else None, lag)

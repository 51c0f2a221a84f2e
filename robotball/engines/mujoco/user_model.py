"""A user's own model, stepped by plain mj_step as its file says, and observed as any engine's run.

Its controls are set before every step, as a loop around mj_step would. What only a user's file has,
geoms that touch inside, joints with a range and servos that lag, is seen in the same loop.
"""

import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import mujoco
import numpy as np

from robotball.drives import Constant, Drive
from robotball.engines.mujoco import LABEL
from robotball.engines.observe import Readings, Recording
from robotball.engines.states import lifting
from robotball.equations import Rolling
from robotball.errors import mujoco_silent, unknown
from robotball.files import named
from robotball.files.robot_file import RobotFile, gears_of, hinged, scene_of
from robotball.loads import Loads
from robotball.motion import DIVERGED, ContactMotion, EngineSettings
from robotball.rotations import Array, Mask, from_matrix, rotation_matrix
from robotball.scene import Scene

_PATIENCE = 15.0  # s of processor time that a run as it is may take
# Of the time, and of the radius: a sphere that is off the plane so long or so far is aloft.
_ALOFT_TIME, _ALOFT_HEIGHT = 0.05, 0.01


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
    def hinges(self) -> tuple[Any, Any]:
        """The places of the scene's hinges among qpos and among qvel."""
        model, joints = self.robot.model, hinged(self.robot)
        return model.jnt_qposadr[joints], model.jnt_dofadr[joints]

    @cached_property
    def steady(self) -> bool:
        """Whether no control changes."""
        return all(isinstance(value, Constant) for value in self.controls.values())

    @property
    def radius(self) -> float:
        """The radius of the sphere that rolls [m]."""
        return self.robot.radius

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

    def step(self, data: mujoco.MjData, count: int = 1) -> None:
        """Take steps, each by the controls of its time: in one call where none changes."""
        at_once = count if self.steady else 1
        for _ in range(count // at_once):
            self.control(data)
            mujoco.mj_step(self.robot.model, data, at_once)

    def scene(self, rolling: Rolling, duration: float) -> Scene:
        """Return the scene that the reference rolls. Raises InputError for what it has not."""
        with named(self.robot.path):
            return scene_of(self.robot, self.begin(), self.controls, rolling, duration)

    def meets(self, duration: float) -> tuple[float, str] | None:
        """Return when [s] a part first touches another or a fixed body, if any does, and which.

        The model is stepped as its file says, up to a duration [s].
        """
        robot, data, began = self.robot, self.begin(), time.process_time()
        if np.sum(robot.model.geom_contype | robot.model.geom_conaffinity > 0) <= 2:
            return None  # sphere and plane
        while data.time < duration and _sound(data):
            if time.process_time() - began > _PATIENCE:
                return float(data.time), "it takes too long to step it further"
            self.step(data)
            for contact in _contacts(data):
                if words := robot.meeting(data, contact, late=True):
                    return float(data.time), words
        return None

    def path(self, times: Array) -> Array:
        """Return the contact points and heights above the plane (n, 3) [m] at equal times (n,) [s].

        They are NaN from where the state diverged. It takes as many steps at once as it can, and
        reads nothing else.
        """
        model, data = self.robot.model, self.begin()
        # A state that diverged would go on from the start.
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        count = round((times[1] - times[0]) / model.opt.timestep)
        centres = np.full((len(times), 3), np.nan)
        for i in range(len(times)):
            if i:
                self.step(data, count)
            if not _sound(data):
                break
            mujoco.mj_kinematics(model, data)
            centres[i] = data.geom_xpos[self.robot.sphere]
        places = (centres - data.geom_xpos[self.robot.plane]) @ self.robot.plane_axes(data).T
        return self.points(places)

    def points(self, places: Array) -> Array:
        """Return the contact points and heights (n, 3) of the sphere's centre, in plane axes."""
        return np.column_stack([places[:, :2] - places[0, :2], places[:, 2] - self.radius])


def _sound(data: mujoco.MjData) -> bool:
    # A comparison with NaN is false.
    return bool((np.abs(data.qpos) < DIVERGED).all() and (np.abs(data.qvel) < DIVERGED).all())


@dataclass(frozen=True)
class Seen:
    """What only a user's model shows, over all steps of a run.

    path (n, 3): contact point and height above the plane at every row [m]; fails: what ends its
    rolling, in words; until: when it does, or the end [s]; inside: by two geoms that overlap from
    the start, the part of the steps in which they do; limits: joints that reach their range, and
    when [s]; delivered: the part of the declared resistance to rolling; lag: of servos by name,
    root mean square over the command's.
    """

    path: Array
    fails: str | None
    until: float
    inside: Counter[tuple[int, int]]
    limits: dict[str, float]
    delivered: float | None
    lag: dict[str, float]


@mujoco_silent()  # a state that diverges is said in words
def observed(
    user: UserModel,
    scene: Scene,
    tolerance: float,
    every: int = 1,
    show: Callable[[float], None] = lambda _: None,
    name: str = "as it is",
) -> tuple[ContactMotion, Seen]:
    """Step a model as it is over the scene's duration; return its motion and what else it shows.

    The motion has each step of so many, up to one that diverges or as far as patience goes, and no
    momentum. tolerance: the slip over the path beyond which it is a fault; show: called with the
    part that is done; name: of the motion's settings.
    """
    model, data = user.robot.model, user.begin()
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    tally, rows, began = _Tally(user), list[Array](), time.process_time()
    count = round(scene.duration / model.opt.timestep / every)
    for i in range(count + 1):
        user.control(data)
        # A step by RK4 leaves the contacts of its last stage, so those of the state are made first,
        # and leave the next step's first guess as plain steps have it.
        guess = data.qacc_warmstart.copy()
        mujoco.mj_forward(model, data)
        data.qacc_warmstart[:] = guess
        rows.append(_row(user, data))
        if not _sound(data) or not np.isfinite(rows[-1][:_CONTACT]).all():
            rows.pop()
            break
        tally.add(data)
        user.step(data, every)
        if i % _LOOK == 0:
            show(i / count)
            if time.process_time() - began > _PATIENCE:
                break
    diverged = None if _sound(data) else float(data.time)
    seconds = time.process_time() - began
    settings = EngineSettings(name=name, error_tolerance=tolerance, stop_at_fault=False)
    table = np.array(rows)
    recording = Recording(LABEL, scene, settings, table[:, 0])
    recording.add(_readings_of(user, scene, table))
    motion = recording.motion(model.opt.timestep, len(rows), seconds)
    path = user.points(table[:, 1:4])
    lost = np.isnan(table[:, _CONTACT])
    return motion, tally.seen(path, *_failure(table[:, 0], lost, path[:, 2], user.radius, diverged))


def _failure(
    times: Array, lost: Mask, heights: Array, radius: float, diverged: float | None
) -> tuple[str | None, float]:
    """Return what ends the rolling, in words, and when [s]: a state that diverged, or a flight."""
    words, until = None, float(times[-1])
    part, top = float(lost.mean()), float(heights[lost].max(initial=0.0))
    if diverged is not None:
        words, until = f"it diverges at t = {diverged:.3g} s", diverged
    if part > _ALOFT_TIME or top > _ALOFT_HEIGHT * radius:
        # The longest flight: a sphere that just touches may be off the plane for a step at first.
        ends = np.flatnonzero(np.diff(lost, prepend=False, append=False)).reshape(-1, 2)
        until = float(times[ends[np.argmax(ends[:, 1] - ends[:, 0]), 0]])
        flight = (
            f"it leaves the plane at t = {until:.3g} s: it has no contact for {part:.1%} of the "
            f"time, and is {top:.3g} m above the plane at most"
        )
        words = f"{flight}; {words}" if words else flight
    return words, until


_CONTACT = 19  # numbers of a row before those of the contact
_LOOK = 100  # rows from one look at the clock to the next


def _contacts(data: mujoco.MjData) -> list[mujoco.MjContact]:
    # One by one: the end of MuJoCo's own iterator takes as long as ten steps.
    return [data.contact[i] for i in range(data.ncon)]


def wrenches(robot: RobotFile, data: mujoco.MjData) -> Iterator[tuple[mujoco.MjContact, Array]]:
    """Yield the contacts of sphere and plane, each with its force and torque (6,) in its frame."""
    for i, contact in enumerate(_contacts(data)):
        if robot.rolls(contact):
            wrench = np.zeros(6)
            mujoco.mj_contactForce(robot.model, data, i, wrench)
            yield contact, wrench


def _row(user: UserModel, data: mujoco.MjData) -> Array:
    """Return the numbers of a state: time, place and velocity of the sphere's centre, its axes,
    turning, the contact's force, depth and coefficient of friction (NaN without a contact), and
    the hinges' angles and rates.
    """
    robot, moving = user.robot, np.zeros(6)
    mujoco.mj_objectVelocity(robot.model, data, mujoco.mjtObj.mjOBJ_GEOM, robot.sphere, moving, 0)
    to_plane, force, depth, friction = robot.plane_axes(data), np.full(3, np.nan), np.nan, np.nan
    for contact, wrench in wrenches(robot, data):
        force = lifting([to_plane @ (wrench[:3] @ contact.frame.reshape(3, 3))])
        depth, friction = -contact.dist, contact.friction[0]
    place = to_plane @ (data.geom_xpos[robot.sphere] - data.geom_xpos[robot.plane])
    axes = (to_plane @ data.geom_xmat[robot.sphere].reshape(3, 3)).ravel()
    velocity, turning = to_plane @ moving[3:], to_plane @ moving[:3]
    hinges = [*data.qpos[user.hinges[0]], *data.qvel[user.hinges[1]]]
    loads = [*force, depth, friction]
    return np.array([data.time, *place, *velocity, *axes, *turning, *loads, *hinges])


def _readings_of(user: UserModel, scene: Scene, rows: Array) -> Readings:
    """Return the readings of rows."""
    count = len(scene.hinges)
    times, place, velocity, axes, turning, force, depth, friction, angles, rates = np.split(
        rows, np.cumsum([1, 3, 3, 9, 3, 3, 1, 1, count]), axis=1
    )
    attitude = from_matrix(axes.reshape(-1, 3, 3))  # at once: SciPy takes 0.1 ms a call
    slip = velocity - user.radius * np.cross(turning, [0.0, 0.0, 1.0])
    loads = replace(Loads.unknown(len(rows), count), contact_force=np.nan_to_num(force))
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
        sound=np.asarray((np.abs(rows[:, :_CONTACT]) < DIVERGED).all(axis=1)),
    )


class _Tally:
    """What only a user's model shows, counted over the steps so far."""

    def __init__(self, user: UserModel) -> None:
        self.user, model = user, user.robot.model
        self.limited = np.flatnonzero(model.jnt_limited)
        self.inside: Counter[tuple[int, int]] = Counter()
        self.limits: dict[str, float] = {}
        self.resistance, self.steps = np.zeros(2), 0  # given and declared
        # A servo's torque is by how far it is off its command, of which its gain is the factor.
        gain, bias = model.actuator_gainprm[:, 0], model.actuator_biasprm
        by = np.where(bias[:, 1], bias[:, 1], bias[:, 2])
        servos = np.flatnonzero((model.actuator_biastype != 0) & (by == -gain)).tolist()
        self.squares = {i: np.zeros(2) for i in servos}  # of what is asked, and of what is missed

    def add(self, data: mujoco.MjData) -> None:
        """Count a state, whose contacts are up to date."""
        robot, model = self.user.robot, self.user.robot.model
        self.steps += 1
        others = set()
        for contact in _contacts(data):
            pair, late = (int(contact.geom1), int(contact.geom2)), self.steps > 1
            met = pair not in self.inside and robot.meeting(data, contact, late)
            if not met and not robot.rolls(contact):
                others.add(pair)
        for contact, wrench in wrenches(robot, data):
            if contact.dim == 6:
                self.resistance += np.linalg.norm(wrench[4:]), wrench[0] * contact.friction[3]
        self.inside.update(others)
        at, (low, high) = model.jnt_qposadr[self.limited], model.jnt_range[self.limited].T
        for j in self.limited[(data.qpos[at] < low) | (data.qpos[at] > high)]:
            self.limits.setdefault(model.joint(j).name or f"joint {j}", data.time)
        for i, squares in self.squares.items():
            asked = data.ctrl[i]
            if model.actuator_ctrllimited[i]:
                asked = np.clip(asked, *model.actuator_ctrlrange[i])
            # An integrated velocity is followed as an angle, which is the actuator's own state.
            if model.actuator_dyntype[i] == int(mujoco.mjtDyn.mjDYN_INTEGRATOR):
                asked = data.act[model.actuator_actadr[i]]
            by_angle = model.actuator_biasprm[i, 1] != 0
            follows = data.actuator_length[i] if by_angle else data.actuator_velocity[i]
            squares += asked**2, (asked - follows) ** 2

    def seen(self, path: Array, fails: str | None, until: float) -> Seen:
        """Return the counts over the number of steps."""
        given, declared = self.resistance
        names, squares = [*self.user.actuators], self.squares.items()
        lag = {names[i]: float(np.sqrt(missed / asked)) for i, (asked, missed) in squares if asked}
        inside = Counter({pair: count / self.steps for pair, count in self.inside.items()})
        delivered = float(given / declared) if declared else None
        return Seen(path, fails, until, inside, self.limits, delivered, lag)

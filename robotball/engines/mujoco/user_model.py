"""Step a user's own model with plain mj_step and the options of its file, and read its motion.

Controls are set before every step, like in a loop around mj_step. The run also shows faults that
only a user's file can have: overlapping geoms, joints at the end of their range, servos that lag.
"""

import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import mujoco
import numpy as np

from robotball.engines.mujoco import LABEL
from robotball.engines.observe import Readings, Recording
from robotball.errors import InputError, mujoco_silent, named, unknown
from robotball.motion import DIVERGED, ContactMotion, EngineSettings
from robotball.robot.drives import Constant, Drive
from robotball.robot.formulas import Rolling
from robotball.robot.loads import Loads
from robotball.robot.scene import Scene
from robotball.rotations import Array, Mask, from_matrix, rotation_matrix
from robotball.user_model.mended_file import compiled
from robotball.user_model.robot_file import RobotFile, gears_of, geom_name
from robotball.user_model.robot_scene import scene_of, slipping

_PATIENCE = 12.0  # s of processor time for one run
_CLOCK_STEPS = 100  # steps between two readings of the clock
# The sphere has left the plane if it has no contact for this fraction of the time, or is this high.
_ALOFT_TIME = 0.05
ALOFT_HEIGHT = 0.01  # of the radius


class Obstacle(NamedTuple):
    """The first contact that the equations leave out: its time [s], and the two geoms."""

    time: float
    words: str


@dataclass(frozen=True)
class UserModel:
    """A user's model with its controls and its start.

    Attributes
    ----------
    robot : RobotFile
    controls : dict of Drive
        The controls by actuator name. Other actuators keep the controls of the keyframe.
    key : str or None
        The keyframe to start at; the first one if None.
    push : float, m/s
        The speed along X at which the whole robot starts to roll.
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
        """The number of each actuator."""
        return {name: i for i, name in enumerate(gears_of(self.robot.model))}

    @cached_property
    def steady(self) -> bool:
        """Whether every control is constant."""
        return all(isinstance(drive, Constant) for drive in self.controls.values())

    def with_text(self, text: str) -> "UserModel":
        """Return the model of another text of the file, with the same controls and start."""
        return replace(self, robot=replace(self.robot, model=compiled(text)))

    def begin(self) -> mujoco.MjData:
        """Return MjData at the start. Raises InputError if the start counts as diverged."""
        robot, data = self.robot, self.robot.start(self.key)
        self.control(data)
        data.time = 0.0  # controls begin at 0, whatever the time of the keyframe
        if self.push:
            robot.roll(data, np.array([0.0, self.push / self.robot.radius, 0.0]))
        if not _sound(data):
            largest = float(np.abs([*data.qpos, *data.qvel]).max())
            line = f"the start has a position or velocity of {largest:.3g}, above {DIVERGED:g}"
            raise InputError(f"{robot.path}: {line}")
        return data

    def control(self, data: mujoco.MjData) -> None:
        """Set the controls at the data's time."""
        for name, drive in self.controls.items():
            data.ctrl[self.actuators[name]] = drive.rate(data.time)

    def step(self, data: mujoco.MjData, count: int = 1) -> None:
        """Take steps with the controls at their times; in one call if controls are constant."""
        at_once = count if self.steady else 1
        for _ in range(count // at_once):
            self.control(data)
            mujoco.mj_step(self.robot.model, data, at_once)

    def scene(self, rolling: Rolling, duration: float) -> Scene:
        """Return the scene of the reference. Raises InputError for unsupported features."""
        with named(self.robot.path):
            data = self.begin()
            scene = scene_of(self.robot, data, self.controls, rolling, duration)
            return slipping(scene, self.robot, data)

    def path(self, times: Array) -> Array:
        """Return the path (n, 4) as in `points` at equally spaced times [s].

        Rows are NaN after the state has diverged.
        """
        return self.path_to_obstacle(times, watch=False)[0]

    def path_to_obstacle(self, times: Array, watch: bool = True) -> tuple[Array, Obstacle | None]:
        """Return `path` up to the first obstacle, and the obstacle. Slower than `path`.

        A run that takes too long ends in the same way.
        """
        robot, data, deadline = self.robot, self.begin(), time.process_time() + _PATIENCE
        count = round((times[1] - times[0]) / robot.model.opt.timestep)
        at_once = 1 if watch else count
        centres, spins = np.full((len(times), 3), np.nan), np.full(len(times), np.nan)
        normal, obstacle, taken = robot.above_plane(data)[0], None, 0
        for i in range(len(times)):
            while taken < i * count and obstacle is None:
                self.step(data, at_once)
                taken += at_once
                obstacle = self._obstacle(data, deadline) if watch else None
            if obstacle or not _sound(data):
                break
            for update in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_comVel):
                update(robot.model, data)
            centres[i] = data.geom_xpos[robot.sphere]
            spins[i] = robot.moving(data)[:3] @ normal
        in_plane = (centres - robot.floor(data)) @ robot.plane_axes(data).T
        return self.points(in_plane, turned(spins, times)), obstacle

    def _obstacle(self, data: mujoco.MjData, deadline: float) -> Obstacle | None:
        message = "the run takes too long" if time.process_time() > deadline else ""
        if data.ncon > 1:  # more than the contact of sphere and plane
            contacts = (contact for _, contact in _others(self.robot, data))
            real = (self.robot.real_contact(data, contact, late=True) for contact in contacts)
            message = next(filter(None, real), message)
        return Obstacle(float(data.time), message) if message else None

    def points(self, centres: Array, turns: Array) -> Array:
        """Return the contact point, the height and the turn of the sphere's surface (n, 4) [m].

        centres: of the sphere, in plane axes. turns: angles about the plane's normal [rad].
        """
        radius, moved = self.robot.radius, centres[:, :2] - centres[0, :2]
        return np.column_stack([moved, centres[:, 2] - radius, radius * turns])


def turned(spins: Array, times: Array) -> Array:
    """Return the rotation angles (n,) [rad] since the first time, for spins (n,) [rad/s]."""
    return np.append(0.0, np.cumsum(np.diff(times) * (spins[1:] + spins[:-1]) / 2))


def _sound(data: mujoco.MjData) -> bool:
    with np.errstate(over="ignore", invalid="ignore"):
        # A comparison with NaN is false.
        return bool(data.qpos @ data.qpos + data.qvel @ data.qvel < DIVERGED**2)


@dataclass(frozen=True)
class Symptoms:
    """Facts of a run that only a user's model can show.

    Attributes
    ----------
    path : (n, 4), m
        The path as in `UserModel.points` at every row.
    failure : str or None
        What ends the rolling.
    until : float, s
        The time at which rolling ends, or the end of the run.
    hops : bool
        Whether the sphere leaves the plane by less than a hundredth of the radius.
    diverged : bool
        Whether the state diverged.
    inside : Counter
        For two geoms that overlap from the start, the fraction of the steps with overlap.
    limits : dict
        The joints that reach their range, with the times [s].
    delivered : float or None
        The fraction of the declared rolling resistance that the contact exerts.
    lag : dict
        The tracking error of each servo divided by its command, as root mean squares.
    obstacle : Obstacle or None
    """

    path: Array
    failure: str | None
    until: float
    hops: bool
    diverged: bool
    inside: Counter[tuple[int, int]]
    limits: dict[str, float]
    delivered: float | None
    lag: dict[str, float]
    obstacle: Obstacle | None


@mujoco_silent()  # a diverged state is reported in the symptoms
def observed(
    user: UserModel,
    scene: Scene,
    tolerance: float,
    every: int = 1,
    show: Callable[[float], None] = lambda _: None,
    name: str = "unmodified",
) -> tuple[ContactMotion, Symptoms]:
    """Run a model over the scene's duration. Return its motion, without momentum, and its symptoms.

    The motion ends early if the state diverges or the run takes too long.

    scene: the scene of the reference, for the duration and the shell. tolerance: slip divided by
    the path; above, slip is a fault. every: steps from one row of the motion to the next. show:
    called with the finished fraction. name: name of the motion's settings, for labels.
    """
    robot, model, data = user.robot, user.robot.model, user.begin()
    rows, inside = list[_State](), Counter[tuple[int, int]]()
    obstacle, began = None, time.process_time()
    count = round(scene.duration / model.opt.timestep / every)
    for i in range(count + 1):
        if not _sound(data):
            break
        user.control(data)
        # RK4 leaves the contacts of its last stage, so compute the contacts of this state. Restore
        # the warm start, so that the next step is the same as in a plain loop.
        guess = data.qacc_warmstart.copy()
        mujoco.mj_forward(model, data)
        data.qacc_warmstart[:] = guess
        rows.append(_row_of(robot, data))
        overlapping = set()
        for pair, contact in _others(robot, data):
            message = "" if pair in inside else robot.real_contact(data, contact, late=i > 0)
            if not message:
                overlapping.add(pair)
            elif i and obstacle is None:
                obstacle = Obstacle(float(data.time), message)
        inside.update(overlapping)
        user.step(data, every)
        if i % max(1, _CLOCK_STEPS // every) == 0:
            spent = time.process_time() - began
            show(max(i / count, spent / _PATIENCE))
            if spent > _PATIENCE:
                break
    diverged = None if _sound(data) else float(data.time)
    seconds = time.process_time() - began
    settings = EngineSettings(name=name, error_tolerance=tolerance, stop_at_fault=False)
    table = _table_of(user, data, rows)
    recording = Recording(LABEL, scene, settings, table.time)
    recording.add(_readings_of(user, scene, table))
    motion = recording.motion(model.opt.timestep, len(rows), seconds)
    path = user.points(table.centre, turned(table.angular_velocity[:, 2], table.time))
    obstacle = min(filter(None, (obstacle, _edge(robot, data, rows))), default=None)
    lost, radius = np.isnan(table.depth), user.robot.radius
    failure, until, hops = _failure(table.time, lost, path[:, 2], radius, diverged)
    exerted, declared = np.nansum(table.resistance, axis=0)
    return motion, Symptoms(
        path,
        failure,
        until,
        hops,
        diverged=diverged is not None,
        inside=Counter({pair: times / len(rows) for pair, times in inside.items()}),
        limits=_limits(model, table),
        delivered=float(exerted / declared) if declared else None,
        lag=_lags(user, table),
        obstacle=obstacle if obstacle and obstacle.time <= until else None,
    )


def _edge(robot: RobotFile, data: mujoco.MjData, rows: Sequence["_State"]) -> Obstacle | None:
    """Return the time at which the sphere rolls off the edge of its box, if it does."""
    model, plane = robot.model, robot.plane
    away = np.array([row.centre for row in rows]) - data.geom_xpos[plane]
    across = np.abs(away @ data.geom_xmat[plane].reshape(3, 3))[:, :2]
    off = (across > model.geom_size[plane, :2]).any(axis=1)
    if model.geom_type[plane] != int(mujoco.mjtGeom.mjGEOM_BOX) or not off.any():
        return None
    sphere, floor = (geom_name(model, geom) for geom in (robot.sphere, plane))
    return Obstacle(float(rows[off.argmax()].time), f"{sphere} rolls off the edge of {floor}")


def _failure(
    times: Array, lost: Mask, heights: Array, radius: float, diverged: float | None
) -> tuple[str | None, float, bool]:
    """Return the end of rolling (flight or divergence), its time [s], and whether the ball hops."""
    failures, until = [], float(times[-1]) if diverged is None else diverged
    part, top = float(lost.mean()), float(heights[lost].max(initial=0.0))
    if part > _ALOFT_TIME or top > ALOFT_HEIGHT * radius:
        # The start of the longest flight: a sphere that just touches may lose contact at first.
        ends = np.flatnonzero(np.diff(lost, prepend=False, append=False)).reshape(-1, 2)
        until = float(times[ends[np.argmax(ends[:, 1] - ends[:, 0]), 0]])
        flight = f"No contact for {part:.1%} of the time; at most {top:.3g} m above the plane"
        failures.append(f"leaves the plane at t = {until:.3g} s. {flight}")
    if diverged is not None:
        # States after the first bad state are meaningless: the sphere may be thrown into the plane.
        off = times[(heights > ALOFT_HEIGHT * radius) | (heights < -radius)]
        until = min([until, *off[:1].tolist()])
        left = f"; it leaves the plane at t = {until:.3g} s" if until < diverged else ""
        failures = [f"diverges at t = {diverged:.3g} s{left}"]
    hops = diverged is None and top <= ALOFT_HEIGHT * radius
    return "; ".join(failures) or None, until, hops


def _others(robot: RobotFile, data: mujoco.MjData) -> Iterator[tuple[tuple[int, int], Any]]:
    """Yield the geoms and the contact of the robot's contacts, except sphere and plane."""
    # By index: the end of MuJoCo's iterator over contacts costs as much as ten steps.
    for i, (a, b) in enumerate(data.contact.geom.tolist()):
        if not robot.rolls((a, b)) and (robot.is_own(a) or robot.is_own(b)):
            yield (a, b), data.contact[i]


def wrenches(robot: RobotFile, data: mujoco.MjData) -> Iterator[tuple[mujoco.MjContact, Array]]:
    """Yield the contacts of sphere and plane, each with its force and torque (6,) in its frame."""
    for i, pair in enumerate(data.contact.geom.tolist()):
        if robot.rolls(pair):
            wrench = np.zeros(6)
            mujoco.mj_contactForce(robot.model, data, i, wrench)
            yield data.contact[i], wrench


class _State(NamedTuple):
    """A state in world axes, or a run's states in plane axes; contact values may be NaN.

    resistance (2,): exerted and declared rolling resistance [N m].
    """

    time: Any
    centre: Array
    axes: Array
    angular_velocity: Array
    velocity: Array
    force: Array
    depth: Any
    friction: Any
    resistance: Array
    qpos: Array
    qvel: Array
    ctrl: Array
    act: Array
    length: Array
    speed: Array


def _row_of(robot: RobotFile, data: mujoco.MjData) -> _State:
    """Return a copy of a state's values; they are evaluated together after the run."""
    force, depth, friction, resistance = np.full(3, np.nan), np.nan, np.nan, np.full(2, np.nan)
    for contact, wrench in wrenches(robot, data):
        force, depth = wrench[:3] @ contact.frame.reshape(3, 3), -contact.dist
        friction, resistance = contact.friction[0], np.full(2, np.nan)
        if contact.dim == 6:
            resistance[:] = float(np.linalg.norm(wrench[4:])), wrench[0] * contact.friction[3]
    velocity = robot.moving(data)
    sphere = data.geom_xpos[robot.sphere], data.geom_xmat[robot.sphere], velocity[:3], velocity[3:]
    rest = data.qpos, data.qvel, data.ctrl, data.act, data.actuator_length, data.actuator_velocity
    return _State(*map(np.copy, (data.time, *sphere, force, depth, friction, resistance, *rest)))


def _table_of(user: UserModel, data: mujoco.MjData, rows: Sequence[_State]) -> _State:
    """Return the states of a run; data: any state, for the plane, which does not move."""
    robot, table = user.robot, _State(*map(np.array, zip(*rows, strict=True)))
    to_plane = robot.plane_axes(data)
    force = table.force @ to_plane.T
    return table._replace(
        centre=(table.centre - robot.floor(data)) @ to_plane.T,
        axes=to_plane @ table.axes.reshape(-1, 3, 3),
        angular_velocity=table.angular_velocity @ to_plane.T,
        velocity=table.velocity @ to_plane.T,
        # MuJoCo's sign depends on the order of the two geoms; the ball is always pushed up.
        force=force * np.copysign(1.0, force[:, 2:]),
    )


def _readings_of(user: UserModel, scene: Scene, table: _State) -> Readings:
    """Return the readings of the states of a run."""
    centre, turning, depth = table.centre, table.angular_velocity, table.depth
    attitude = from_matrix(table.axes)  # all in one call: SciPy takes 0.1 ms a call
    slip = table.velocity - user.robot.radius * np.cross(turning, [0.0, 0.0, 1.0])
    loads = Loads.unknown(len(centre), len(scene.hinges))
    loads = replace(loads, contact_force=np.nan_to_num(table.force))
    return Readings(
        time=table.time,
        centre=np.column_stack([centre[:, :2] - centre[0, :2], user.robot.radius - depth]),
        attitude=attitude,
        angular_velocity=np.einsum("nji,nj->ni", rotation_matrix(attitude), turning),
        momentum=np.full_like(centre, np.nan),
        hinge_angles=table.qpos[:, user.robot.hinges[0]],
        hinge_rates=table.qvel[:, user.robot.hinges[1]],
        loads=loads,
        slip=np.linalg.norm(slip[:, :2], axis=1),
        spin=turning[:, 2],
        friction_used=loads.sliding_friction / table.friction,
        touching=np.isfinite(depth),
        sound=np.ones(len(centre), dtype=bool),  # a run ends before an unsound state
    )


def _limits(model: mujoco.MjModel, table: _State) -> dict[str, float]:
    """Return the joints that reach their range, with the times [s], the earliest first."""
    reached = {}
    for j in np.flatnonzero(model.jnt_limited):
        angle, (low, high) = table.qpos[:, model.jnt_qposadr[j]], model.jnt_range[j]
        if (beyond := (angle < low) | (angle > high)).any():
            reached[model.joint(j).name or f"joint {j}"] = float(table.time[beyond.argmax()])
    return dict(sorted(reached.items(), key=lambda limit: limit[1]))


def _lags(user: UserModel, table: _State) -> dict[str, float]:
    """Return tracking errors of servos divided by their commands, as root mean squares."""
    model, lags = user.robot.model, {}
    # The torque of a servo is its gain times the tracking error.
    gain, bias = model.actuator_gainprm[:, 0], model.actuator_biasprm
    feedback = np.where(bias[:, 1], bias[:, 1], bias[:, 2])
    servos = (model.actuator_biastype != 0) & (feedback == -gain)
    for name, i in user.actuators.items():
        if not servos[i]:
            continue
        command = table.ctrl[:, i]
        if model.actuator_ctrllimited[i]:
            command = np.clip(command, *model.actuator_ctrlrange[i])
        # An integrated velocity is followed as an angle, which is the actuator's activation.
        if model.actuator_dyntype[i] == int(mujoco.mjtDyn.mjDYN_INTEGRATOR):
            command = table.act[:, model.actuator_actadr[i]]
        missed = command - (table.length if bias[i, 1] else table.speed)[:, i]
        if command.any():
            lags[name] = float(np.linalg.norm(missed) / np.linalg.norm(command))
    return lags

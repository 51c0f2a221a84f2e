"""A user's own model, stepped by plain mj_step as its file says, and observed as any engine's run.

Its controls are set before every step, as a loop around mj_step would. What only a user's file has,
geoms that touch inside, joints with a range and servos that lag, is seen in the same loop.
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
from robotball.user_model.robot_file import RobotFile, gears_of
from robotball.user_model.robot_scene import scene_of

_PATIENCE = 12.0  # s of processor time that a run as it is may take
# Of the time, and of the radius: a sphere that is off the plane so long or so far is aloft.
_ALOFT_TIME, _ALOFT_HEIGHT = 0.05, 0.01


Met = tuple[float, str]  # when [s] a part touches what it should not, and which


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
        data.time = 0.0  # a keyframe may have another, at which no control begins
        if self.push:
            robot.roll(data, np.array([0.0, self.push / self.radius, 0.0]))
        if not _sound(data):
            largest = float(np.abs([*data.qpos, *data.qvel]).max())
            raise InputError(
                f"{robot.path}: its start has a position or velocity of {largest:.3g}, and a state "
                f"beyond {DIVERGED:g} counts as diverged"
            )
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

    def path(self, times: Array, met: list[Met] | None = None) -> Array:
        """Return the contact points and heights above the plane (n, 3) [m] at equal times (n,) [s].

        They are NaN from where the state diverged. It takes as many steps at once as it can, and
        reads nothing else; where `met` is given it looks at every step, ends where a part touches
        another or a fixed body, or where patience does, and appends that.
        """
        robot, data, began = self.robot, self.begin(), time.process_time()
        model = robot.model
        # A state that diverged would go on from the start.
        model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
        count = round((times[1] - times[0]) / model.opt.timestep)
        at_once = count if met is None else 1
        centres = np.full((len(times), 3), np.nan)
        for i in range(len(times)):
            for _ in range(count // at_once if i else 0):
                self.step(data, at_once)
                if met is not None and (words := self._meeting(data, began)):
                    met.append((float(data.time), words))
            if met or not _sound(data):
                break
            mujoco.mj_kinematics(model, data)
            centres[i] = data.geom_xpos[robot.sphere]
        places = (centres - data.geom_xpos[robot.plane]) @ robot.plane_axes(data).T
        return self.points(places)

    def _meeting(self, data: mujoco.MjData, began: float) -> str:
        """Return what touches that did not at the start, or that patience is at its end."""
        if data.ncon > 1:  # the sphere's own
            for _, contact in _others(self.robot, data):
                if words := self.robot.meeting(data, contact, late=True):
                    return words
        late = time.process_time() - began > _PATIENCE
        return "it takes too long to step it further" if late else ""

    def points(self, places: Array) -> Array:
        """Return the contact points and heights (n, 3) of the sphere's centre, in plane axes."""
        return np.column_stack([places[:, :2] - places[0, :2], places[:, 2] - self.radius])


def _sound(data: mujoco.MjData) -> bool:
    with np.errstate(over="ignore", invalid="ignore"):
        # A comparison with NaN is false.
        return bool(data.qpos @ data.qpos + data.qvel @ data.qvel < DIVERGED**2)


# The largest dt·λ at which a step of v' = -λ v is stable.
_STABLE = {
    int(mujoco.mjtIntegrator.mjINT_EULER): ("Euler", 2.0),
    int(mujoco.mjtIntegrator.mjINT_RK4): ("RK4", 2.785),
}


class Gain(NamedTuple):
    """A velocity gain of an actuator that is too high for an explicit step.

    Attributes
    ----------
    name : str
        The actuator.
    kv, gear : float
        The gain, and the ratio of the actuator to its joint or tendon.
    timestep : float, s
        The length of a step.
    inertia : float
        The inertia that the joint or tendon moves, at the start.
    number : float
        kv·gear²·dt/I.
    integrator : str
        The explicit integrator.
    most : float
        The largest number at which it is stable.
    """

    name: str
    kv: float
    gear: float
    timestep: float
    inertia: float
    number: float
    integrator: str
    most: float


def too_high_gain(user: UserModel) -> Gain | None:
    """Return the largest velocity gain beyond what the integrator is stable under, if any."""
    model, data = user.robot.model, user.begin()
    if model.opt.integrator not in _STABLE:
        return None
    integrator, most = _STABLE[model.opt.integrator]
    moments = np.zeros((model.nu, model.nv))
    mujoco.mju_sparse2dense(
        moments, data.actuator_moment, data.moment_rownnz, data.moment_rowadr, data.moment_colind
    )
    found = []
    for name, i in user.actuators.items():
        kv, gear = -float(model.actuator_biasprm[i, 2]), float(model.actuator_gear[i, 0])
        accelerations = np.zeros((1, model.nv))
        mujoco.mj_solveM(model, data, accelerations, moments[i : i + 1])
        mobility = float(moments[i] @ accelerations[0])
        if (number := kv * mobility * model.opt.timestep) > most:
            inertia = gear**2 / mobility
            found.append(
                Gain(name, kv, gear, model.opt.timestep, inertia, number, integrator, most)
            )
    return max(found, key=lambda gain: gain.number, default=None)


@dataclass(frozen=True)
class Seen:
    """What only a user's model shows, over all steps of a run.

    Attributes
    ----------
    path : (n, 3), m
        The contact point and the height above the plane at every row.
    fails : str or None
        What ends the rolling.
    until : float, s
        When it ends, or the end of the run.
    diverged : bool
        Whether the state diverged.
    inside : Counter
        For two geoms that overlap from the start, the part of the steps in which they do.
    limits : dict
        The joints that reach their range, and when [s].
    delivered : float or None
        The part of the declared resistance to rolling.
    lag : dict
        The tracking error of each servo, root mean square over that of its command.
    met : sequence of Met
        The first contact that was not there at the start.
    """

    path: Array
    fails: str | None
    until: float
    diverged: bool
    inside: Counter[tuple[int, int]]
    limits: dict[str, float]
    delivered: float | None
    lag: dict[str, float]
    met: Sequence[Met]


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
    robot, model, data = user.robot, user.robot.model, user.begin()
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_AUTORESET)
    rows, inside, began = list[_Row](), Counter[tuple[int, int]](), time.process_time()
    met = list[Met]()
    count = round(scene.duration / model.opt.timestep / every)
    for i in range(count + 1):
        if not _sound(data):
            break
        user.control(data)
        # A step by RK4 leaves the contacts of its last stage, so those of the state are made first,
        # and leave the next step's first guess as plain steps have it.
        guess = data.qacc_warmstart.copy()
        mujoco.mj_forward(model, data)
        data.qacc_warmstart[:] = guess
        rows.append(row_of(robot, data))
        overlap = set()
        for pair, contact in _others(robot, data):
            words = pair not in inside and robot.meeting(data, contact, late=i > 0)
            if not words:
                overlap.add(pair)
            elif i and not met:
                met.append((float(data.time), words))
        inside.update(overlap)
        user.step(data, every)
        if i % max(1, _LOOK // every) == 0:
            show(i / count)
            if time.process_time() - began > _PATIENCE:
                break
    diverged = None if _sound(data) else float(data.time)
    seconds = time.process_time() - began
    settings = EngineSettings(name=name, error_tolerance=tolerance, stop_at_fault=False)
    table = table_of(user, data, rows)
    recording = Recording(LABEL, scene, settings, table.time)
    recording.add(readings_of(user, scene, table))
    motion = recording.motion(model.opt.timestep, len(rows), seconds)
    path, lost = user.points(table.place), np.isnan(table.depth)
    given, declared = np.nansum(table.resistance, axis=0)
    return motion, Seen(
        path,
        *_failure(table.time, lost, path[:, 2], user.radius, diverged),
        diverged=diverged is not None,
        inside=Counter({pair: times / len(rows) for pair, times in inside.items()}),
        limits=_limits(model, table),
        delivered=float(given / declared) if declared else None,
        lag=_lags(user, table),
        met=met,
    )


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


_LOOK = 100  # steps from one look at the clock to the next


def _others(robot: RobotFile, data: mujoco.MjData) -> Iterator[tuple[tuple[int, int], Any]]:
    """Yield the geoms of every contact of the robot but that with its plane, and the contact."""
    # By numbers, as the end of MuJoCo's own iterator takes as long as ten steps.
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


class _Row(NamedTuple):
    """A state, or those of a run, a row each; NaN of the contact where there is none.

    The sphere's numbers are in world axes, in a run's table in plane axes. resistance (2,): of the
    contact to rolling, given and declared [N m]; the last six: as in MjData.
    """

    time: Any
    place: Array
    axes: Array
    turning: Array
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


def row_of(robot: RobotFile, data: mujoco.MjData) -> _Row:
    """Return the numbers of a state as they are; they are read at once, after the run."""
    force, depth, friction, resistance = np.full(3, np.nan), np.nan, np.nan, np.full(2, np.nan)
    for each, wrench in wrenches(robot, data):
        force, depth, friction = wrench[:3] @ each.frame.reshape(3, 3), -each.dist, each.friction[0]
        resistance = np.full(2, np.nan)
        if each.dim == 6:
            resistance[:] = float(np.linalg.norm(wrench[4:])), wrench[0] * each.friction[3]
    place, axes, moving = (
        data.geom_xpos[robot.sphere],
        data.geom_xmat[robot.sphere],
        robot.moving(data),
    )
    sphere = data.time, place, axes, moving[:3], moving[3:]
    contact = force, depth, friction, resistance
    own = data.qpos, data.qvel, data.ctrl, data.act, data.actuator_length, data.actuator_velocity
    return _Row(*map(np.copy, (*sphere, *contact, *own)))


def table_of(user: UserModel, data: mujoco.MjData, rows: Sequence[_Row]) -> _Row:
    """Return the states of rows; data: any of the run, as the plane does not move."""
    robot, of_rows = user.robot, _Row(*map(np.array, zip(*rows, strict=True)))
    to_plane = robot.plane_axes(data)
    force = of_rows.force @ to_plane.T
    return of_rows._replace(
        place=(of_rows.place - data.geom_xpos[robot.plane]) @ to_plane.T,
        axes=to_plane @ of_rows.axes.reshape(-1, 3, 3),
        turning=of_rows.turning @ to_plane.T,
        velocity=of_rows.velocity @ to_plane.T,
        force=force * np.copysign(1.0, force[:, 2:]),  # on either body, as that on the ball
    )


def readings_of(user: UserModel, scene: Scene, table: _Row) -> Readings:
    """Return the readings of the states."""
    place, turning, depth = table.place, table.turning, table.depth
    attitude = from_matrix(table.axes)  # at once: SciPy takes 0.1 ms a call
    slip = table.velocity - user.radius * np.cross(turning, [0.0, 0.0, 1.0])
    loads = Loads.unknown(len(place), len(scene.hinges))
    loads = replace(loads, contact_force=np.nan_to_num(table.force))
    return Readings(
        time=table.time,
        centre=np.column_stack([place[:, :2] - place[0, :2], user.radius - depth]),
        attitude=attitude,
        angular_velocity=np.einsum("nji,nj->ni", rotation_matrix(attitude), turning),
        momentum=np.full_like(place, np.nan),
        hinge_angles=table.qpos[:, user.robot.hinges[0]],
        hinge_rates=table.qvel[:, user.robot.hinges[1]],
        loads=loads,
        slip=np.linalg.norm(slip[:, :2], axis=1),
        spin=turning[:, 2],
        friction_used=loads.sliding_friction / table.friction,
        touching=np.isfinite(depth),
        sound=np.ones(len(place), dtype=bool),  # all of them are
    )


def _limits(model: mujoco.MjModel, table: _Row) -> dict[str, float]:
    """Return when the joints that reach their range do [s], the first one first."""
    reached = {}
    for j in np.flatnonzero(model.jnt_limited):
        angle, (low, high) = table.qpos[:, model.jnt_qposadr[j]], model.jnt_range[j]
        if (beyond := (angle < low) | (angle > high)).any():
            reached[model.joint(j).name or f"joint {j}"] = float(table.time[beyond.argmax()])
    return dict(sorted(reached.items(), key=lambda it: it[1]))


def _lags(user: UserModel, table: _Row) -> dict[str, float]:
    """Return how far servos are off their commands, root mean square over the command's."""
    model, found = user.robot.model, {}
    # A servo's torque is by how far it is off its command, of which its gain is the factor.
    gain, bias = model.actuator_gainprm[:, 0], model.actuator_biasprm
    by = np.where(bias[:, 1], bias[:, 1], bias[:, 2])
    servos = (model.actuator_biastype != 0) & (by == -gain)
    for name, i in user.actuators.items():
        if not servos[i]:
            continue
        asked = table.ctrl[:, i]
        if model.actuator_ctrllimited[i]:
            asked = np.clip(asked, *model.actuator_ctrlrange[i])
        # An integrated velocity is followed as an angle, which is the actuator's own state.
        if model.actuator_dyntype[i] == int(mujoco.mjtDyn.mjDYN_INTEGRATOR):
            asked = table.act[:, model.actuator_actadr[i]]
        missed = asked - (table.length if bias[i, 1] else table.speed)[:, i]
        if asked.any():
            found[name] = float(np.linalg.norm(missed) / np.linalg.norm(asked))
    return found

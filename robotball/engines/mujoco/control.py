"""The control of a run: what is set at every evaluation of the forces, and how steps are taken.

Controls are computed at every evaluation, so that RK4 keeps its order; held over a step they would
cost it two. MuJoCo's callbacks only write controls and gravity: if a function of MuJoCo that is
called inside one raises a warning, MuJoCo 4.0 never returns (docs/findings).
"""

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from robotball.engines.mujoco.model import Model, controls_at
from robotball.robot import formulas as eq
from robotball.rotations import Array

if TYPE_CHECKING:
    from robotball.robot.loop import Loop, TrueReading

FREE_QPOS, FREE_QVEL = 7, 6  # coordinates and velocities of the free joint; hinges follow
STATE = mujoco.mjtState.mjSTATE_INTEGRATION
_QUATERNION = slice(3, 7)
_NO_STAGE = int(mujoco.mjtStage.mjSTAGE_NONE)


def read_row(data: mujoco.MjData) -> Array:
    """Return the sensors of a state, which are up to date, followed by the warning counters."""
    return np.concatenate([data.sensordata, data.warning.number])


def state_of(data: mujoco.MjData) -> Array:
    """Return all that a step depends on (n,)."""
    state = np.empty(mujoco.mj_stateSize(data.model, STATE))
    mujoco.mj_getState(data.model, data, state, STATE)
    return state


def senses(model: Model) -> Callable[[mujoco.MjData], "TrueReading"]:
    """Return what reads a robot's sensors in a state, without its forces, which take longest."""
    from robotball.robot.loop import TrueReading

    compiled, columns, count = model.compiled, model.sensor_columns, len(model.scene.hinges)
    places = [(each.index, columns[f"{each.name}_angle"].start, columns[f"{each.name}_rate"].start)
              for each in model.hinges]  # fmt: skip

    def sensed(data: mujoco.MjData) -> TrueReading:
        mujoco.mj_kinematics(compiled, data)
        mujoco.mj_comPos(compiled, data)
        mujoco.mj_sensorPos(compiled, data)
        mujoco.mj_comVel(compiled, data)
        mujoco.mj_sensorVel(compiled, data)
        # By numbers: to have one of an array, or its rotation matrix, takes as long as all sensors.
        read = data.sensordata.tolist()
        angles, rates = [0.0] * count, [0.0] * count
        for i, angle, rate in places:
            angles[i], rates[i] = read[angle], read[rate]
        attitude, turning = read[columns["attitude"]], read[columns["angular_velocity"]]
        gyro = eq.seen_from_frame(tuple(turning), eq.unit_space_axes(tuple(attitude)))
        point = np.array(read[columns["centre"]][:2])
        return TrueReading(np.array(gyro), np.array(attitude), angles, rates, point)

    return sensed


Step = Callable[[mujoco.MjData, float], None]
"""Takes one step of a length [s]. Leaves the sensors of the state before the step."""
Steps = Callable[[mujoco.MjData, float], Iterator[float]]
"""Takes one step of a length [s], in parts where it has to. Yields the length of each part."""
Forward = Callable[[mujoco.MjData, bool], None]
"""Evaluates the forces at the state of MjData, with the sensors if the second argument is true."""


def mujoco_step(data: mujoco.MjData, length: float) -> None:
    """Take one step of a length [s] with MuJoCo's integrator."""
    data.model.opt.timestep = length
    mujoco.mj_step(data.model, data)


def mujoco_forward(data: mujoco.MjData, sensors: bool) -> None:
    """Evaluate MuJoCo's forces."""
    mujoco.mj_forwardSkip(data.model, data, _NO_STAGE, not sensors)


def put(data: mujoco.MjData, t: float, state: Array) -> None:
    """Set time [s] and state (qpos, qvel)."""
    data.time = t
    data.qpos, data.qvel = state[: len(data.qpos)], state[len(data.qpos) :]


def right_hand_side(forward: Forward, data: mujoco.MjData) -> Callable[..., Array]:
    """Return the function for d/dt of (qpos, qvel) at time t [s].

    The root's quaternion may have any length, because Runge-Kutta stages do not normalise it.
    """
    nq, nv = data.model.nq, data.model.nv
    qpos, qvel, qacc = data.qpos, data.qvel, data.qacc

    def rate(t: float, state: Array, sensors: bool = False) -> Array:
        data.time = t
        qpos[:], qvel[:] = state[:nq], state[nq:]
        forward(data, sensors)
        derivative = np.empty(nq + nv)
        derivative[:3] = qvel[:3]
        derivative[_QUATERNION] = eq.attitude_rate(
            tuple(state[_QUATERNION].tolist()), tuple(qvel[3:FREE_QVEL].tolist())
        )
        derivative[FREE_QPOS:nq] = qvel[FREE_QVEL:]
        derivative[nq:] = qacc
        return derivative

    return rate


# s: a drive's value at the end of a span is taken this long before it, where a breakpoint's other
# side begins.
_INSIDE = 1e-9


# Steps that a run may take for each planned one, and besides. A robot that leans over slowly leaves
# its standstill in up to 11 578 parts of one step, and in 53 000 of 10 500.
_PARTS, _MOST_PARTS = 60, 10_000


class TooManyPartsError(Exception):
    """The parts of a run's steps are so short that it would hardly go on; says why."""


class Control:
    """The control of a run: what is set at every evaluation of the forces, and how steps are taken.

    span: the smooth span of time that the run is in [s], as `begin` sets it; loop: of the scene's
    controller, whose commands so far are in the model's scene; steady: True if the controls of the
    keyframe hold from here on; forward: evaluates the forces; step: takes one step; steps: of a run
    whose steps have parts, else None; stops: stops a ball that is at rest, and returns whether it
    did, where a run can stop; planned, taken: steps of the timestep so far, and steps taken for
    them, with those of a search for a switch.
    """

    def __init__(self, model: Model) -> None:
        self.model, self.steady = model, model.scene.steady
        self.loop: Loop | None = None
        if model.scene.controller is not None:
            from robotball.robot import loop  # which few scenes need

            self.loop = loop.Loop(model.scene, model.scene.controller)
            self.model, self.steady = model.of(self.loop.scene), self.loop.holds
            self.sensed = senses(self.model)
        self.span: Sequence[float] = (0.0, 0.0)
        self.forward: Forward = mujoco_forward
        self.step: Step = mujoco_step
        self.planned = self.taken = 0
        self.steps: Steps | None = None
        self.stops: Callable[[mujoco.MjData], bool] | None = None

    @property
    def is_plain(self) -> bool:
        """True if a run is nothing but MuJoCo's steps."""
        return self.steady and self.steps is None and self.loop is None

    def begin(self, data: mujoco.MjData, span: Sequence[float]) -> None:
        """Begin a smooth span of time [s] from the state of `data`, with the controls of its begin.

        A span that is repeated has the commands of the first time.
        """
        self.span = span
        if self.loop is not None:
            self.loop.reach(span[0], lambda: self.sensed(data))
            scene = self.model.scene
            data.ctrl[:] = controls_at(scene, self.model.hinges, span[0])
            if self.loop.holds and not self.steady:
                self.steady = True
                mujoco.set_mjcb_control(None)

    def whole(self, data: mujoco.MjData, length: float) -> Iterator[float]:
        """Take one step in one part."""
        self.take(data, length)
        yield length

    def take(self, data: mujoco.MjData, length: float) -> None:
        """Take one step of a length [s]. Raises TooManyPartsError if too many were taken."""
        self.taken += 1
        if self.taken > _MOST_PARTS + _PARTS * self.planned:
            raise TooManyPartsError(
                f"{self.taken} parts of {self.planned} steps, near a standstill or at torque "
                "limits: choose another timestep, a lower gain, or no friction.rolling"
            )
        self.step(data, length)

    def inside(self, t: float) -> float:
        """Return the time [s] of the span that is nearest to t."""
        begin, end = self.span
        return max(begin, min(t, end - _INSIDE))

    def set(self, _: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Set the controls of the hinges at the time of `data`."""
        data.ctrl[:] = controls_at(self.model.scene, self.model.hinges, self.inside(data.time))

    def fall(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Set gravity, as the moving plane has it, at the time of `data`."""
        model.opt.gravity = self.model.scene.gravity_at(self.inside(data.time))

"""The plane's resistance to rolling: a torque against the shell's rolling, and its standstill.

The torque is computed at every evaluation of the forces. This computation needs functions of MuJoCo
that a callback must not call, so the steps are built here from these evaluations. MuJoCo's rolling
friction (condim 6) has another law: it shares a cone with the friction that holds the ball, and
opposes an acceleration, not the rolling. Near a standstill the direction of the torque changes ever
faster, so steps are taken in parts, and a shell that the plane can hold is stopped.
"""

from collections.abc import Iterator
from functools import cached_property
from math import hypot

import mujoco
import numpy as np

from robotball.engines.mujoco.control import Control, Steps, mujoco_step
from robotball.engines.mujoco.order8 import RungeKutta
from robotball.rotations import Array, rotation_matrix

_STANDING = 1e-8  # rad/s: a shell that is not faster is at rest, if the plane can hold it
_RESTING = 1e-13  # rad/s: below this there is no rolling to remove
_APPROACH = 0.5  # longest step near a standstill, as a fraction of the time until it
_TURNED = 2.0  # longest step times the rate of the direction of rolling; RK4 is stable to 2.8
_SHORTEST = 1e-6  # of a step: a shorter part is joined to the previous part
# The stages of RK4.
_WEIGHTS = [*map(np.array, ([], [0.5], [0.0, 0.5], [0.0, 0.0, 1.0], [1 / 6, 1 / 3, 1 / 3, 1 / 6]))]
_VELOCITY = int(mujoco.mjtStage.mjSTAGE_VEL)
# A diverging state overflows before the monitor ends the run.
_overflowing = np.errstate(all="ignore")


class Resistance:
    """Steps of a model with the plane's resistance.

    The shell's acceleration and the load are affine in the torque, so two or three trials determine
    the torque.
    """

    def __init__(self, control: Control) -> None:
        model, scene = control.model, control.model.scene
        self.compiled = model.compiled
        self.arm = scene.friction.rolling  # m
        self.weight = float(-scene.ball.mass * scene.gravity_world[2])  # N, of a ball at rest
        self.load_varies, self.plane_velocity = scene.load_varies, scene.plane_velocity
        self.shell = model.compiled.body("shell").id
        self.rk4 = RungeKutta(control, 4, _WEIGHTS, (0.0, 0.5, 0.5, 1.0, 1.0)).step

    @_overflowing
    def forward(self, data: mujoco.MjData, sensors: bool) -> None:
        """Evaluate the forces, including the plane's torque."""
        trials = _Trials(self, data, sensors)
        trials.take(self._torque(trials), sensors)

    def first_order(self, data: mujoco.MjData, length: float) -> None:
        """Take one step with MuJoCo's integrator, under the torque at its begin."""
        guess = data.qacc_warmstart.copy()
        self.forward(data, False)
        data.qacc_warmstart = guess
        mujoco_step(data, length)

    def steps(self, take: Steps) -> Steps:
        """Return a function that takes steps with `take`, in short parts near a standstill."""

        def parts(data: mujoco.MjData, length: float) -> Iterator[float]:
            remaining = length
            while remaining > 0:
                self.stop(data)
                part = self._longest(data, remaining)
                part = remaining if remaining - part < _SHORTEST * length else part
                yield from take(data, part)
                remaining -= part

        return parts

    @_overflowing
    def stop(self, data: mujoco.MjData) -> None:
        """Stop a shell that the plane holds from now on."""
        rolling = self._rolling(data)
        if not _RESTING < hypot(*rolling) <= _STANDING:
            return
        if not self._holding(_Trials(self, data))[1]:
            return
        to_world = rotation_matrix(data.qpos[3:7])
        data.qvel[:2] = self.plane_velocity(data.time, data.qpos[:2])[:2]
        data.qvel[3:6] -= rolling @ to_world[:2]

    @_overflowing
    def _longest(self, data: mujoco.MjData, length: float) -> float:
        """Return a step's length [s], shorter near a standstill, where the direction turns fast."""
        trials = _Trials(self, data)
        speed = trials.speed
        if speed <= _STANDING and self._holding(trials)[1]:
            return length
        now, free = trials.under(self._torque(trials))[:2], trials.free[:2]
        turning = hypot(*(now - free)) / max(speed, _STANDING)
        slowing = hypot(*now) / speed if speed > _STANDING else 0.0
        return 1 / max(1 / length, turning / _TURNED, slowing / _APPROACH)

    def _torque(self, trials: "_Trials") -> Array:
        """Return the torque (2,) [N m] against rolling; near rest, the holding torque."""
        along, speed = trials.rolling, trials.speed
        if speed <= _STANDING:
            holding, holds = self._holding(trials)
            if holds:
                return holding
            along = along - (_STANDING - speed) / float(np.linalg.norm(holding)) * holding
            speed = float(np.linalg.norm(along))
        along = along / speed
        return -self._resisting(trials, along) * along

    def _resisting(self, trials: "_Trials", along: Array) -> float:
        """Return the size of the plane's torque [N m] against rolling along a unit vector (2,)."""
        usual = self.arm * self.weight
        if not self.load_varies:
            return usual
        free, braked = trials.free[2], trials.under(-usual * along)[2]
        return float(self.arm * free / (1 - (braked - free) / self.weight))

    def _holding(self, trials: "_Trials") -> tuple[Array, bool]:
        """Return the torque (2,) [N m] that keeps rolling constant; can the plane exert it?"""
        usual, free = self.arm * self.weight, trials.free
        x, y = (trials.under(usual * axis) - free for axis in np.eye(2))
        # Cramer's rule gives NaN if a diverging state has no solution.
        across = np.array([y[0] * free[1] - y[1] * free[0], x[1] * free[0] - x[0] * free[1]])
        parts = across / (x[0] * y[1] - x[1] * y[0])
        load = float(free[2] + parts @ [x[2], y[2]])
        torque = np.asarray(usual * parts, dtype=np.float64)
        return torque, bool(hypot(*torque) <= self.arm * load)

    def _rolling(self, data: mujoco.MjData) -> Array:
        """Return the horizontal part (2,) of the shell's angular velocity [rad/s]."""
        mujoco.mj_kinematics(self.compiled, data)
        mujoco.mj_comPos(self.compiled, data)
        mujoco.mj_comVel(self.compiled, data)
        return data.cvel[self.shell, :2].copy()


class _Trials:
    """Trials of torques at one state; rolling (2,), speed: the shell's horizontal ω [rad/s]."""

    def __init__(self, resistance: Resistance, data: mujoco.MjData, sensors: bool = False) -> None:
        compiled, self.data, self.shell = data.model, data, resistance.shell
        mujoco.mj_fwdPosition(compiled, data)
        mujoco.mj_fwdVelocity(compiled, data)
        if sensors:
            mujoco.mj_sensorPos(compiled, data)
            mujoco.mj_sensorVel(compiled, data)
        self.rolling = data.cvel[self.shell, :2].copy()
        self.speed = hypot(*self.rolling.tolist())

    @cached_property
    def free(self) -> Array:
        """The result of `under` without a torque."""
        return self.under(np.zeros(2))

    def under(self, torque: Array) -> Array:
        """Return the rolling's acceleration (2,) [rad/s²] and the load [N] under a torque (2,)."""
        compiled, data, guess = self.data.model, self.data, self.data.qacc_warmstart.copy()
        self.take(torque)
        data.qacc_warmstart = guess
        mujoco.mj_rnePostConstraint(compiled, data)
        force = np.zeros(6)
        if data.ncon:
            mujoco.mj_contactForce(compiled, data, 0, force)
        return np.append(data.cacc[self.shell, :2], force[0])

    def take(self, torque: Array, sensors: bool = False) -> None:
        """Evaluate the forces under a torque (2,)."""
        self.data.xfrc_applied[self.shell, 3:5] = torque
        mujoco.mj_forwardSkip(self.data.model, self.data, _VELOCITY, not sensors)

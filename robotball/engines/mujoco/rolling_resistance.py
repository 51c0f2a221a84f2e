"""The plane's resistance to rolling: a torque against the shell's rolling, and its standstill.

The torque is applied at every evaluation of the forces. MuJoCo's own rolling friction (condim 6) is
another law: it shares one cone with the friction that holds the ball, and acts against an
acceleration, not the rolling. Near a standstill the torque's direction turns over ever faster, so
that steps are taken in parts, and a shell that the plane can hold is stopped.
"""

from collections.abc import Callable, Iterator

import mujoco
import numpy as np

from robotball.engines.mujoco.control import Control, Steps
from robotball.rotations import Array, rotation_matrix

# rad/s: a shell that rolls no faster than _STANDING stands, if the plane can hold it; one that is
# below _RESTING has nothing left to take away.
_STANDING, _RESTING = 1e-8, 1e-13
# Near a standstill a step is at most this part of the time to it, and this over the rate at which
# the rolling's direction turns over; RK4 is stable up to 2.8.
_APPROACH, _TURNED = 0.5, 2.0
_SHORTEST = 1e-6  # of a step: a part so short is taken with the one before it


class Resistance:
    """The resistance of the plane in a model, with data of its own in which torques are tried.

    Both the shell's acceleration and the load are affine in the torque, so that two or three trials
    determine it.
    """

    def __init__(self, control: Control) -> None:
        model, scene = control.model, control.model.scene
        self.control, self.compiled = control, model.compiled
        self.arm = scene.friction.rolling  # m
        self.weight = float(-scene.ball.mass * scene.gravity_world[2])  # N, of a ball that stands
        self.load_varies = scene.load_varies
        self.shell = model.compiled.body("shell").id
        self.trial = mujoco.MjData(model.compiled)

    def apply(self, data: mujoco.MjData) -> None:
        """Apply the torque at the state of `data`, whose velocities are up to date."""
        data.xfrc_applied[self.shell, 3:5] = self._torque(data)

    def steps(self, take: Steps) -> Steps:
        """Return steps in parts that are short enough near a standstill, each taken by `take`."""

        def parts(data: mujoco.MjData, length: float) -> Iterator[float]:
            left = length
            while left > 0:
                self.stop(data)
                part = self._longest(data, left)
                part = left if left - part < _SHORTEST * length else part
                yield from take(data, part)
                left -= part

        return parts

    def stop(self, data: mujoco.MjData) -> bool:
        """Stop a shell in `data` that the plane has come to hold; return whether it did."""
        rolling = self._rolling(data)
        if not _RESTING < np.linalg.norm(rolling) <= _STANDING:
            return False
        if not self._holding(data)[1]:
            return False
        to_world = rotation_matrix(data.qpos[3:7])
        data.qvel[:2] = 0.0
        data.qvel[3:6] -= rolling @ to_world[:2]
        return True

    def _longest(self, data: mujoco.MjData, length: float) -> float:
        """Return a step's length [s], shorter where the shell comes to a standstill or leaves one.

        Near it the rolling's direction turns at a rate of the resistance over the speed.
        """
        speed = float(np.linalg.norm(self._rolling(data)))
        if speed <= _STANDING and self._holding(data)[1]:
            return length
        tried = self._trials(data)
        now, free = (tried(torque)[:2] for torque in (self._torque(data), np.zeros(2)))
        turning = float(np.linalg.norm(now - free)) / max(speed, _STANDING)
        slowing = float(np.linalg.norm(now)) / speed if speed > _STANDING else 0.0
        return 1 / max(1 / length, turning / _TURNED, slowing / _APPROACH)

    def _torque(self, data: mujoco.MjData) -> Array:
        """Return the plane's torque (2,) [N m] against rolling, or what holds a standing shell.

        Below _STANDING the direction turns over to that of the holding torque, without a jump.
        """
        rolling: Array = data.cvel[self.shell, :2]
        speed = float(np.linalg.norm(rolling))
        along = rolling
        if speed <= _STANDING:
            holding, holds = self._holding(data)
            if holds:
                return holding
            along = rolling - (_STANDING - speed) / float(np.linalg.norm(holding)) * holding
        along = along / float(np.linalg.norm(along))
        return -self._resisting(data, along) * along

    def _resisting(self, data: mujoco.MjData, along: Array) -> float:
        """Return the size of the plane's torque [N m] against rolling along a unit vector (2,)."""
        usual = self.arm * self.weight
        if not self.load_varies:
            return usual
        tried = self._trials(data)
        free, braked = (tried(torque)[2] for torque in (np.zeros(2), -usual * along))
        return float(self.arm * free / (1 - (braked - free) / self.weight))

    def _holding(self, data: mujoco.MjData) -> tuple[Array, bool]:
        """Return the torque (2,) [N m] under which the shell's rolling does not change.

        Returns also whether the plane can give it.
        """
        usual, tried = self.arm * self.weight, self._trials(data)
        free, *turned = (tried(usual * each) for each in np.eye(3, 2, -1))
        change = np.array(turned) - free
        parts = np.linalg.solve(change[:, :2].T, -free[:2])
        load = float(free[2] + parts @ change[:, 2])
        torque = np.asarray(usual * parts, dtype=np.float64)
        return torque, bool(np.linalg.norm(torque) <= self.arm * load)

    def _trials(self, data: mujoco.MjData) -> Callable[[Array], Array]:
        """Return a function of a torque (2,): the rolling's acceleration [rad/s²] and the load [N].

        It takes the stages of mj_forward one by one, for that would call the controls again.
        """
        compiled, trial = self.compiled, self.trial
        trial.time, trial.qpos, trial.qvel = data.time, data.qpos, data.qvel
        mujoco.mj_fwdPosition(compiled, trial)
        mujoco.mj_fwdVelocity(compiled, trial)
        self.control.set(trial)
        guess = data.qacc_warmstart.copy()

        def tried(torque: Array) -> Array:
            trial.qacc_warmstart = guess
            trial.xfrc_applied[self.shell, 3:5] = torque
            mujoco.mj_fwdActuation(compiled, trial)
            mujoco.mj_fwdAcceleration(compiled, trial)
            mujoco.mj_fwdConstraint(compiled, trial)
            mujoco.mj_sensorAcc(compiled, trial)
            mujoco.mj_rnePostConstraint(compiled, trial)
            return np.append(trial.cacc[self.shell, :2], trial.sensor("contact").data[1])

        return tried

    def _rolling(self, data: mujoco.MjData) -> Array:
        """Return the horizontal part (2,) of the shell's angular velocity [rad/s]."""
        mujoco.mj_kinematics(self.compiled, data)
        mujoco.mj_comPos(self.compiled, data)
        mujoco.mj_comVel(self.compiled, data)
        return data.cvel[self.shell, :2].copy()

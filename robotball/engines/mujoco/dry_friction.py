"""Dry friction of hinges as the torque of the equations, in place of MuJoCo's soft row.

`frictionloss` does not stop a rate at once, but with the time constant of its row: for about 10 ms
before a load reverses the rate, the row already pushes along the rate, at any timestep. The torque
of the equations changes its sign within SLOW [rad/s], so steps are taken in parts at such low
rates.
"""

import mujoco
import numpy as np

from robotball.engines.mujoco.control import FREE_QVEL, STATE, Control, TooManyPartsError, state_of
from robotball.engines.mujoco.model import DryFriction
from robotball.engines.mujoco.motor_rates import fastest_rate
from robotball.robot.motors import SLOW
from robotball.rotations import Array

_HIGH = 12.0 * SLOW  # rad/s: at a higher rate the torque is constant to a relative 1e-10
_CHANGE = 0.25 * SLOW  # rad/s: the largest change in a part of a rate below _HIGH
STABLE = 2.0  # longest part times the rate at which friction stops a hinge; RK4 is stable to 2.785
_AIM = 0.9  # of the allowed change
_LEAST, _MOST = 0.1, 5.0  # of the last part


class Parts:
    """Steps in parts, in which low rates of motors with dry friction change little.

    At rates that are not low, a part is as long as the step.
    """

    def __init__(self, control: Control, friction: DryFriction) -> None:
        model = control.model
        self.take, self.friction, self.taken = control.step, friction, 0
        self.seen: list[Array] = []  # the motors' rates (m,) at the evaluations of a part
        self.most = model.settings.max_steps
        self.fastest = fastest_rate(model.scene, model.hinges, model.settings.slips, dry=True)

    @np.errstate(all="ignore")  # a diverging state overflows before the monitor ends the run
    def step(self, data: mujoco.MjData, length: float) -> None:
        """Take one step of a length [s]. Leaves the sensors of the state before the step."""
        remaining = part = length
        rates, sensors = self._rates(data), None
        while remaining > 0:
            slope = 1 / np.cosh(np.abs(rates).min() / SLOW) ** 2
            part = min(part, remaining, STABLE / (self.fastest * slope))
            before = state_of(data)
            self._take(data, part)
            sensors = data.sensordata.copy() if sensors is None else sensors
            used = self._used(rates)
            if used > 1:
                mujoco.mj_setState(data.model, data, before, STATE)
            else:  # a NaN ends here too
                remaining, rates = remaining - part, self.seen[-1]
            part *= float(np.clip(_AIM / used, _LEAST, _MOST))
        data.sensordata[:] = sensors

    def _take(self, data: mujoco.MjData, part: float) -> None:
        self.taken += 1
        if self.taken > self.most:
            raise TooManyPartsError(
                f"dry friction divides the steps into more than {self.most} parts: raise max_steps"
            )
        self.seen.clear()
        self.take(data, part)
        self.seen.append(self._rates(data))

    def torques(self, rates: Array) -> Array:
        """Return the torques (h,) on the hinges at their rates (h,) [rad/s]."""
        self.seen.append(self.friction.gears @ rates)
        return self.friction.torques(rates)

    def _rates(self, data: mujoco.MjData) -> Array:
        """Return the rates (m,) of the motors with friction [rad/s]."""
        return np.asarray(self.friction.gears @ data.qvel[FREE_QVEL:])

    def _used(self, before: Array) -> np.float64:
        """Return the largest change of a rate in the last part, divided by the allowed change."""
        seen = np.array(self.seen)
        high = (np.sign(before) * seen >= _HIGH).all(axis=0) & (np.abs(before) >= _HIGH)
        allowed = np.maximum(np.abs(before) - _HIGH, _CHANGE)
        return np.float64(np.where(high, 0.0, np.abs(seen - before).max(axis=0) / allowed).max())

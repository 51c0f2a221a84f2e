"""Torque limits of a model's motors: steps that end where a motor reaches or leaves its limit.

RK4 is of second order across such a switch. Each motor therefore stays on its side of the limit
within a step, and a step that should have switched is repeated, as far as the switch.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from scipy.optimize import brentq

from robotball.engines.mujoco.control import FREE_QPOS, FREE_QVEL, STATE, Control, Steps, state_of
from robotball.engines.mujoco.model import Model
from robotball.robot.drives import Drive
from robotball.robot.motors import Law
from robotball.rotations import Array

# The part of a limit by which a motor's law may be beyond it on the wrong side. A switch found so
# late changes the motion by the square of that.
_LATE = 1e-9
_SHARP = 1e-10  # of a step: the precision of a switch's time
_SHORTEST = 1e-6  # of a step: a switch nearer to its begin or end is taken to be there
_MOST_SWITCHES = 8  # switches in a step; one with more is taken with MuJoCo's own limits
_OWN = 2  # in place of a side: MuJoCo limits the torque itself


@dataclass(frozen=True)
class _Limited:
    """A motor with a torque limit: its law, and its index and numbers in MjModel.

    gears (h,): the ratios of its hinges among the model's.
    """

    law: Law
    command: Drive
    gears: Array
    actuator: int
    gain: Array
    bias: Array

    def wanted(self, angles: Array, rates: Array, t: float) -> float:
        """Return the torque at t [s] that its law alone would give, over the limit.

        angles, rates (h,): of the model's hinges.
        """
        angle, rate = float(angles @ self.gears), float(rates @ self.gears)
        return float(self.law.unlimited(self.command.rate(t), angle, rate)) / self.law.limit


class _Switches:
    """The motors of a model that have a torque limit, and the side of each.

    A side is 0 between the limits, where the law acts alone, -1 or 1 at a limit, where the torque
    is constant, or _OWN.
    """

    def __init__(self, control: Control, motors: tuple[_Limited, ...]) -> None:
        self.control, self.motors = control, motors
        self.known: tuple[Any, float] = (None, 0.0)
        self.set([0] * len(motors))

    def set(self, sides: list[int]) -> None:
        """Set the compiled model to each motor's side: its law alone, or a constant torque."""
        compiled, self.sides = self.control.model.compiled, list(sides)
        for motor, side in zip(self.motors, sides, strict=True):
            i, at_limit = motor.actuator, side in (-1, 1)
            compiled.actuator_forcelimited[i] = side == _OWN
            compiled.actuator_gainprm[i] = 0.0 if at_limit else motor.gain
            compiled.actuator_biasprm[i] = 0.0 if at_limit else motor.bias
            if at_limit:
                compiled.actuator_biasprm[i, 0] = side * motor.law.limit

    def steps(self, data: mujoco.MjData, length: float) -> Iterator[float]:
        """Take one step, in parts that end at its switches. Yields the length of each part [s]."""
        left = length
        for _ in range(_MOST_SWITCHES):
            # A command that has jumped leaves a motor beyond its side before the step.
            if self._late(data) > 0:
                self._settle(data)
            before = state_of(data)
            if not self._after(data, left) > 0:  # a NaN ends here too
                yield left
                return
            taken = self._until_switch(data, before, left)
            if taken > left - _SHORTEST * length:
                taken = left
            mujoco.mj_setState(data.model, data, before, STATE)
            if taken > _SHORTEST * length:
                self._after(data, taken)
                yield taken
                left -= taken
            self._switch(data)
            if left == 0:
                return
        self.set([_OWN] * len(self.motors))
        self._after(data, left)
        yield left
        self._settle(data)

    def _settle(self, data: mujoco.MjData) -> None:
        """Put every motor on the side where its law is."""
        self.set([_sign(wanted, 1.0) for wanted in self._wanted(data)])

    def _wanted(self, data: mujoco.MjData) -> list[float]:
        """Return each motor's torque by its law alone, over the limit."""
        t = self.control.inside(data.time)
        angles, rates = data.qpos[FREE_QPOS:], data.qvel[FREE_QVEL:]
        return [motor.wanted(angles, rates, t) for motor in self.motors]

    def _beyond(self, data: mujoco.MjData) -> list[float]:
        """Return how far each motor's law is beyond its own side of the limit, over the limit."""
        sided = zip(self._wanted(data), self.sides, strict=True)
        return [1 - side * wanted if side else abs(wanted) - 1 for wanted, side in sided]

    def _late(self, data: mujoco.MjData) -> float:
        """Return a number that is positive where a motor should have switched."""
        # A step mostly begins where the last one ended, with the same commands.
        at = (data.time, self.control.span, self.sides)
        if self.known[0] != at:
            self.known = at, max(self._beyond(data), default=0.0) - _LATE
        return self.known[1]

    def _after(self, data: mujoco.MjData, length: float) -> float:
        """Take a step, and return `_late` after it."""
        self.control.take(data, length)
        return self._late(data)

    def _until_switch(self, data: mujoco.MjData, before: Array, left: float) -> float:
        """Return the length of a step [s] up to the first switch; one of `left` goes beyond it."""

        # Each trial begins from the same state, so that `late` is continuous in the step's length.
        # One that diverges is beyond the switch.
        def late(length: float) -> float:
            mujoco.mj_setState(data.model, data, before, STATE)
            found = self._after(data, length) if length else self._late(data)
            return found if np.isfinite(found) else 1.0

        return float(brentq(late, 0.0, left, xtol=_SHARP * left, rtol=_SHARP))

    def _switch(self, data: mujoco.MjData) -> None:
        """Put the motor that has just reached or left its limit on its other side."""
        beyond, wanted = self._beyond(data), self._wanted(data)
        i, sides = int(np.argmax(beyond)), list(self.sides)
        sides[i] = 0 if sides[i] else _sign(wanted[i], 0.0)
        self.set(sides)


def _sign(number: float, beyond: float) -> int:
    """Return the sign of a number whose size is over `beyond`, else 0, as of NaN."""
    return int(number > beyond) - int(number < -beyond)


@contextmanager
def at_limits(control: Control) -> Iterator[Steps]:
    """Yield steps that end at the switches of a model's motors; restore the model afterwards."""
    motors = tuple(_limited(control.model))
    switches = _Switches(control, motors)
    try:
        yield switches.steps
    finally:
        switches.set([_OWN] * len(motors))


def _limited(model: Model) -> Iterator[_Limited]:
    """Yield the motors with a limit, with a copy of the numbers that their switches overwrite."""
    scene, compiled = model.scene, model.compiled
    places = dict(zip([h.name for h in model.hinges], np.eye(len(model.hinges)), strict=True))
    motors = [(h.name, h.law, h.command, places[h.name]) for h in model.hinges if h.law]
    for each, command in zip(scene.actuators, scene.controls, strict=True):
        gears = np.sum([ratio * places[name] for name, ratio in each.gears], axis=0)
        motors.append((each.name, each.law, command, gears))
    for name, law, command, gears in motors:
        if law.limit < np.inf:
            i = compiled.actuator(name).id
            gain, bias = compiled.actuator_gainprm[i].copy(), compiled.actuator_biasprm[i].copy()
            yield _Limited(law, command, gears, i, gain, bias)

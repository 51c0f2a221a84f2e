"""Torque limits of servos: a step ends where one is reached or left, so that RK4 keeps its order.

Across a switch of its forces RK4 is of second order. Within one step each servo therefore stays on
its side of the limit, by its law or at the limit whatever the law says, and where it should not
have stayed, the step is taken once more, as far as the switch.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import mujoco
import numpy as np
from scipy.optimize import brentq

from robotball.engines.mujoco.control import Control
from robotball.engines.mujoco.hinges import Hinge
from robotball.engines.mujoco.integrators import INTEGRATORS, MUJOCOS_DEFAULT
from robotball.engines.mujoco.states import STATE, state_of
from robotball.motors import Motor, PositionServo, Servo
from robotball.rotations import Array

# Of the limit: how far a servo's law may be beyond it on the wrong side. A switch found so late
# changes the motion by the square of that.
LATE = 1e-9
SHARP = 1e-10  # of a step: how sharply a switch is found
SHORTEST = 1e-6  # of a step: a switch as near as that is at its begin or its end
MOST = 8  # switches in a step; one with more is taken with MuJoCo's own limits
OWN = 2  # in place of a side: MuJoCo limits the torque itself


@dataclass(frozen=True)
class Limited:
    """A servo with a torque limit: its law without it, and the places of its numbers in MjModel."""

    hinge: Hinge
    law: Motor
    limit: float
    actuator: int
    position: int
    velocity: int
    gain: Array
    bias: Array

    def wanted(self, data: mujoco.MjData, t: float) -> float:
        """What it would give at t [s] if there were no limit, over the limit."""
        angle, rate = float(data.qpos[self.position]), float(data.qvel[self.velocity])
        return float(self.law.torque(self.hinge.control(t), angle, rate)) / self.limit


@dataclass
class Switches:
    """The servos of a model that have a limit, and on which side of it each is: -1, 0, 1 or OWN."""

    control: Control
    servos: tuple[Limited, ...]
    sides: list[int] = field(init=False)

    def __post_init__(self) -> None:
        self.set([0] * len(self.servos))

    def set(self, sides: list[int]) -> None:
        """Lets each servo follow its law alone, or give its limit."""
        compiled, self.sides = self.control.model.compiled, list(sides)
        for servo, side in zip(self.servos, sides, strict=True):
            i, at_limit = servo.actuator, side in (-1, 1)
            compiled.actuator_forcelimited[i] = side == OWN
            compiled.actuator_gainprm[i] = 0.0 if at_limit else servo.gain
            compiled.actuator_biasprm[i] = 0.0 if at_limit else servo.bias
            if at_limit:
                compiled.actuator_biasprm[i, 0] = side * servo.limit

    def restore(self) -> None:
        """Leaves the compiled model as it was."""
        self.set([OWN] * len(self.servos))

    def steps(
        self, data: mujoco.MjData, length: float
    ) -> Iterator[tuple[float, tuple[Array, list[int]]]]:
        """One step, or as many as there are switches in it; what each began from once it is taken.

        (its length [s], (state, sides))
        """
        left = length
        while self.control.resistance and left > 0:
            self.control.stop(data)
            part = self.control.longest(data, left)
            part = left if left - part < SHORTEST * length else part
            yield from self._to_switches(data, part)
            left -= part
        if left > 0:
            yield from self._to_switches(data, left)

    def _to_switches(
        self, data: mujoco.MjData, length: float
    ) -> Iterator[tuple[float, tuple[Array, list[int]]]]:
        left = length
        for _ in range(MOST):
            # A command that has jumped leaves a servo beyond its side before the step.
            if self._late(data) > 0:
                self._settle(data)
            before, sides = state_of(data), self.sides
            if not self._after(data, left) > 0:  # nor is a NaN
                yield left, (before, sides)
                return
            taken = self._until_switch(data, before, left)
            if taken > left - SHORTEST * length:
                taken = left
            mujoco.mj_setState(data.model, data, before, STATE)
            if taken > SHORTEST * length:
                self._after(data, taken)
                yield taken, (before, sides)
                left -= taken
            self._switch(data)
            if left == 0:
                return
        self.set([OWN] * len(self.servos))
        before = state_of(data)
        self._after(data, left)
        yield left, (before, self.sides)
        self._settle(data)

    def _settle(self, data: mujoco.MjData) -> None:
        """Puts every servo on the side where its law is."""
        self.set([int(w > 1) - int(w < -1) for w in self._wanted(data)])

    def _wanted(self, data: mujoco.MjData) -> list[float]:
        t = self.control.inside(data.time)
        return [servo.wanted(data, t) for servo in self.servos]

    def _beyond(self, data: mujoco.MjData) -> list[float]:
        """How far each servo's law is beyond its own side of the limit, over the limit."""
        sided = zip(self._wanted(data), self.sides, strict=True)
        return [1 - side * wanted if side else abs(wanted) - 1 for wanted, side in sided]

    def _late(self, data: mujoco.MjData) -> float:
        """Positive where a servo should have switched."""
        return max(self._beyond(data), default=0.0) - LATE

    def _after(self, data: mujoco.MjData, length: float) -> float:
        """`_late` after a step."""
        data.model.opt.timestep = length
        mujoco.mj_step(data.model, data)
        return self._late(data)

    def _until_switch(self, data: mujoco.MjData, before: Array, left: float) -> float:
        """The length of a step from a state to the first switch [s], of one that goes beyond."""

        def late(length: float) -> float:
            mujoco.mj_setState(data.model, data, before, STATE)
            return self._after(data, length) if length else self._late(data)

        return float(brentq(late, 0.0, left, xtol=SHARP * left, rtol=SHARP))

    def _switch(self, data: mujoco.MjData) -> None:
        """Puts the servo that has just reached or left its limit on its other side."""
        beyond, wanted = self._beyond(data), self._wanted(data)
        i, sides = int(np.argmax(beyond)), list(self.sides)
        sides[i] = 0 if sides[i] else int(np.sign(wanted[i]))
        self.set(sides)


@contextmanager
def switched(control: Control) -> Iterator[Switches | None]:
    """Those of a model that steps by an order above the first, or rolls against resistance."""
    model = control.model
    integrator = INTEGRATORS[model.settings.integrator or MUJOCOS_DEFAULT]
    servos = [_limited(model.compiled, hinge) for hinge in model.hinges if hinge.torque_limit]
    if integrator.order == 1:
        servos = []
    if not servos and not control.resistance:
        yield None
        return
    switches = Switches(control, tuple(servos))
    try:
        yield switches
    finally:
        switches.restore()


def _limited(compiled: mujoco.MjModel, hinge: Hinge) -> Limited:
    actuator, joint = compiled.actuator(hinge.body), compiled.joint(hinge.joint)
    servo = hinge.actuation
    assert isinstance(servo, Servo | PositionServo)
    assert servo.torque_limit is not None
    return Limited(
        hinge,
        replace(servo, torque_limit=None),
        servo.torque_limit,
        actuator.id,
        int(joint.qposadr[0]),
        int(joint.dofadr[0]),
        compiled.actuator_gainprm[actuator.id].copy(),
        compiled.actuator_biasprm[actuator.id].copy(),
    )

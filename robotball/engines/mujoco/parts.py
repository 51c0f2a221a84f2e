"""Steps in parts: at torque limits, near a standstill, and after a warning of MuJoCo.

RK4 is of second order across a switch between a motor's law and its torque limit. Within a step, a
motor therefore keeps its side: law or limit. A step across a switch is repeated up to the switch.
`rolling_resistance` determines the parts near a standstill.
"""

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Any

import mujoco
import numpy as np

from robotball.engines.mujoco.control import (
    FREE_QPOS,
    FREE_QVEL,
    STATE,
    Control,
    Interpolating,
    Portion,
    Steps,
    Stretch,
    TooManyPartsError,
    put,
    read_row,
    state_of,
)
from robotball.engines.mujoco.model import GearedMotor, Model, motors_of
from robotball.motion import DIVERGED, Fault, FaultKind
from robotball.rotations import Array

_LOOK = 64  # parts between two checks of the monitor; at most this many parts follow a fault
# A motor may exceed its limit by this fraction before it switches. The motion changes by the square
# of this fraction.
_LATE = 1e-7
_SHARP = 1e-10  # of a step: the tolerance of a switch's time
_SHORTEST = 1e-6  # of a step: a switch nearer to an end of a step is taken to be there
_INSIDE = np.arange(1, 6) / 6  # of a step of order 8: when to look for switches inside it
_MOST_SWITCHES = 8  # switches in a step; MuJoCo limits the torques in a step with more
_BY_MUJOCO = 2  # in place of a side: MuJoCo limits the torque


def step_in_parts(control: Control, data: mujoco.MjData, stretch: Stretch) -> Iterator[Portion]:
    """Take the steps of a stretch, with a row for every part of a step and for its samples."""
    rows: list[Array] = []
    sampled: list[int] = []
    parts, longest, began = 0, 0.0, time.thread_time()
    inside = control.order_8

    def portion(failure: Fault | None = None) -> Portion:
        table = np.array(rows).reshape(len(rows), len(data.sensordata) + len(data.warning.number))
        at, seconds = np.array(sampled, dtype=np.int64), time.thread_time() - began
        return Portion(table, at[at < len(rows)], parts, longest, seconds, failure)

    samples, step = {*stretch.samples.tolist()}, 0
    for span, length, count in stretch:
        control.begin(data, span)
        for _ in range(count):
            if step in samples:
                sampled.append(len(rows))
            step += 1
            control.planned += 1
            # A diverged state has neither switches nor a standstill.
            sound = max(np.abs(data.qpos).max(), np.abs(data.qvel).max()) < DIVERGED
            steps = control.steps if sound else None
            try:
                for taken in (steps or control.whole)(data, length):
                    rows.append(read_row(data))
                    parts, longest = parts + 1, max(longest, taken)
                    if inside is not None and len(inside.pending):
                        at_begin, more = inside.rows(data)
                        begin = len(rows)
                        sampled += range(begin - at_begin, begin + len(more))
                        rows += more
                    if len(rows) >= _LOOK:
                        yield portion()
                        rows, sampled, parts = [], [], 0
                        longest, began = 0.0, time.thread_time()
            except TooManyPartsError as error:
                yield portion(Fault(FaultKind.STEP_TOO_SHORT, np.nan, str(error), fatal=True))
                return
    yield portion()


@dataclass(frozen=True)
class _LimitedMotor(GearedMotor):
    """A motor with a torque limit and its numbers in MjModel."""

    actuator: int
    gain: Array
    bias: Array

    def wanted(self, angles: Array, rates: Array, t: float) -> float:
        """Return the torque of the motor's law at t [s], divided by the limit, at hinges (h,)."""
        angle, rate = float(angles @ self.gears), float(rates @ self.gears)
        return float(self.law.unlimited(self.command.rate(t), angle, rate)) / self.law.limit


class _Switches:
    """The limited motors of a model; a side is 0, -1 or 1 at a limit, or _BY_MUJOCO."""

    def __init__(self, control: Control, motors: tuple[_LimitedMotor, ...]) -> None:
        self.control, self.motors = control, motors
        self.known: tuple[Any, float] = (None, 0.0)
        self.set([0] * len(motors))

    def set(self, sides: list[int]) -> None:
        """Set each motor of the compiled model to its law, or to a constant torque."""
        compiled, self.sides = self.control.model.compiled, list(sides)
        for motor, side in zip(self.motors, sides, strict=True):
            i, at_limit = motor.actuator, side in (-1, 1)
            compiled.actuator_forcelimited[i] = side == _BY_MUJOCO
            compiled.actuator_gainprm[i] = 0.0 if at_limit else motor.gain
            compiled.actuator_biasprm[i] = 0.0 if at_limit else motor.bias
            if at_limit:
                compiled.actuator_biasprm[i, 0] = side * motor.law.limit

    def steps(self, data: mujoco.MjData, length: float) -> Iterator[float]:
        """Take one step in parts that end at switches. Yields the length of each part [s]."""
        remaining = length
        for _ in range(_MOST_SWITCHES):
            # After a jump of the command, a motor is beyond its side even before the step.
            if self._late(data) > 0:
                self._settle(data)
            before, began = state_of(data), data.time
            late = self._after(data, remaining) > 0  # a NaN is not
            beyond = self._beyond_inside(data, began, remaining)
            if beyond is None and not late:
                yield remaining
                return
            taken = self._until_switch(data, before, began, beyond or remaining)
            if taken > remaining - _SHORTEST * length:
                taken = remaining
            mujoco.mj_setState(data.model, data, before, STATE)
            if taken > _SHORTEST * length:
                self._after(data, taken)
                yield taken
                remaining -= taken
            self._switch(data)
            if remaining == 0:
                return
        self.set([_BY_MUJOCO] * len(self.motors))
        self._after(data, remaining)
        yield remaining
        self._settle(data)

    def _settle(self, data: mujoco.MjData) -> None:
        """Set the side of every motor from its law."""
        self.set([_sign(wanted, 1.0) for wanted in self._wanted(data)])

    def _wanted(self, data: mujoco.MjData) -> list[float]:
        """Return the torque of each motor's law, divided by the limit."""
        t = self.control.inside(data.time)
        angles, rates = data.qpos[FREE_QPOS:], data.qvel[FREE_QVEL:]
        return [motor.wanted(angles, rates, t) for motor in self.motors]

    def _beyond(self, data: mujoco.MjData) -> list[float]:
        """Return how far each motor's law is beyond its side, divided by the limit."""
        sided = zip(self._wanted(data), self.sides, strict=True)
        return [1 - side * wanted if side else abs(wanted) - 1 for wanted, side in sided]

    def _late(self, data: mujoco.MjData) -> float:
        """Return a number that is positive if a motor should have switched."""
        # Most steps begin with the state and commands at the end of the previous step.
        at = (data.time, self.control.span, self.sides)
        if self.known[0] != at:
            self.known = at, max(self._beyond(data), default=0.0) - _LATE
        return self.known[1]

    def _after(self, data: mujoco.MjData, length: float) -> float:
        """Take a step, and return `_late` after it."""
        self.control.take(data, length)
        return self._late(data)

    @property
    def _order_8(self) -> Interpolating | None:
        """The steps with an interpolant; with dry friction it covers only the last part."""
        return self.control.order_8 if self.control.friction is None else None

    def _beyond_inside(self, data: mujoco.MjData, began: float, length: float) -> float | None:
        """Return the first of a few times in the last step [s] at which a motor has switched.

        A step of order 8 may be so long that a motor reaches and leaves its limit within the step.
        """
        if (order_8 := self._order_8) is None:
            return None
        end = state_of(data)
        for part in (_INSIDE * length).tolist():
            if self._late_inside(data, order_8, began, part) > 0:
                return float(part)
        mujoco.mj_setState(data.model, data, end, STATE)
        return None

    def _late_inside(
        self, data: mujoco.MjData, order_8: Interpolating, began: float, length: float
    ) -> float:
        """Return `_late` after a part of a length [s] of the last step."""
        put(data, began + length, order_8.within(data, np.array([began + length]))[0])
        return self._late(data)

    def _until_switch(
        self, data: mujoco.MjData, before: Array, began: float, longest: float
    ) -> float:
        """Return the length of a step [s] up to the first switch, which is below `longest`."""
        from scipy.optimize import brentq  # late: few motors reach a limit

        # Each trial begins from the same state, so `late` is continuous in the step's length. A
        # trial that diverges is beyond the switch.
        def late(length: float) -> float:
            mujoco.mj_setState(data.model, data, before, STATE)
            beyond = self._after(data, length) if length else self._late(data)
            return beyond if np.isfinite(beyond) else 1.0

        def root(of: Callable[[float], float]) -> float:
            return float(brentq(of, 0.0, longest, xtol=_SHARP * longest, rtol=_SHARP))

        if (order_8 := self._order_8) is not None:
            found = root(partial(self._late_inside, data, order_8, began))
            # With a stiff motor the error of the interpolant may be magnified.
            if abs(late(found)) <= _LATE or late(longest) <= 0:
                return found
        return root(late)

    def _switch(self, data: mujoco.MjData) -> None:
        """Change the side of the motor that has just reached or left its limit."""
        beyond, wanted = self._beyond(data), self._wanted(data)
        i, sides = int(np.argmax(beyond)), list(self.sides)
        sides[i] = 0 if sides[i] else _sign(wanted[i], 0.0)
        self.set(sides)


def _sign(number: float, beyond: float) -> int:
    """Return the sign of a number whose size exceeds `beyond`, else 0."""
    return int(number > beyond) - int(number < -beyond)


@contextmanager
def at_limits(control: Control) -> Iterator[Steps]:
    """Yield steps that end at the switches of a model's motors; restore the model afterwards."""
    motors = tuple(_limited(control.model))
    switches = _Switches(control, motors)
    try:
        yield switches.steps
    finally:
        switches.set([_BY_MUJOCO] * len(motors))


def _limited(model: Model) -> Iterator[_LimitedMotor]:
    """Yield the limited motors, with copies of the numbers that switches overwrite."""
    compiled = model.compiled
    for motor in motors_of(model.scene, model.hinges):
        if motor.law.limit < np.inf:
            i = compiled.actuator(motor.name).id
            gain, bias = compiled.actuator_gainprm[i].copy(), compiled.actuator_biasprm[i].copy()
            yield _LimitedMotor(**vars(motor), actuator=i, gain=gain, bias=bias)

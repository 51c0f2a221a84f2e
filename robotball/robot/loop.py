"""Sample-and-hold loop between a controller and an engine.

Commands are constant between controller calls, so a closed-loop run is a sequence of open-loop
runs. Engines stop at the controller's times and never call it within a step.
"""

import copy
import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from robotball.errors import LARGEST, InputError, call_users, unknown
from robotball.robot.controllers import SENSORS, Controller, Reading, Sensors
from robotball.robot.drives import Constant
from robotball.robot.function_drives import HeldCommand
from robotball.robot.motors import NO_LIMITS, Free
from robotball.robot.scene import Scene
from robotball.rotations import Array, turned


class TrueReading(NamedTuple):
    """Sensor values without noise. Fields as in `Reading`; hinge angles and rates (h,) in order."""

    gyro: Array
    attitude: Array
    angles: Sequence[float]
    rates: Sequence[float]
    contact_point: Array


class Loop:
    """Call a controller during one run and hold its commands.

    Attributes
    ----------
    scene : Scene
        The scene with the held commands; pass this one to the engine.
    calls : list of dict
        The readings and commands of the calls so far, as in `Motion.calls`.
    """

    def __init__(self, scene: Scene, controller: Controller) -> None:
        self.controller = controller
        self.names = [hinge.name for hinge in scene.hinges]
        self.command_limits = {actuator.name: actuator.within for actuator in scene.actuators}
        self.with_activation = [a.name for a in scene.actuators if a.activation is not None]
        hinges = {
            hinge.name: HeldCommand(hinge.command)
            for hinge in scene.hinges
            if not isinstance(hinge.motor, Free | None)
        }
        # Limits and activations are already applied in `controls`.
        actuators = [
            replace(actuator, command=HeldCommand(control), activation=None, within=NO_LIMITS)
            for actuator, control in zip(scene.actuators, scene.controls, strict=True)
        ]
        ball = scene.ball.with_hinges(command=hinges)
        self.scene = replace(scene, ball=ball, actuators=tuple(actuators))
        self.held: dict[str, Any] = hinges | {a.name: a.command for a in actuators}
        failure = f"{scene.name}: the controller cannot be copied for a run"
        self.function = call_users(failure, copy.deepcopy, controller.function)
        self.random = np.random.default_rng(controller.sensors.seed)
        self.measured = self.called = self.applied = 0
        self.readings, self.answers = deque[Reading](), deque[dict[str, float]]()
        self.calls: list[dict[str, float]] = []

    def reach(self, t: float, sense: Callable[[], TrueReading]) -> None:
        """Sample the sensors, call the controller and apply its commands, if due at time t [s].

        Raises InputError if the controller fails or returns invalid commands.
        """
        controller, until = self.controller, t + self.controller.together
        while self.measured * controller.period - controller.sensors.latency <= until:
            self.readings.append(self._read(self.measured * controller.period, sense()))
            self.measured += 1
        while self.called * controller.period <= until:
            reading = self.readings.popleft()
            self.answers.append(self._call(reading))
            row = _row(reading, self.answers[-1])  # a command that is left out keeps its value
            self.calls.append({**self.calls[-1], **row} if self.calls else row)
            self.called += 1
        while self.applied * controller.period + controller.delay <= until:
            for name, value in self.answers.popleft().items():
                self.held[name].hold(t, Constant(value))
            self.applied += 1

    @property
    def holds(self) -> bool:
        """True if every command is constant until the next controller call."""
        commands = (*self.scene.drives, *self.scene.controls)
        last = (c.drives[-1] if isinstance(c, HeldCommand) else c for c in commands)
        return all(isinstance(drive, Constant) for drive in last)

    def _read(self, time: float, true: TrueReading) -> Reading:
        """Return the reading that the sensors give for a state."""
        sensors = self.controller.sensors
        if sensors.noise or sensors.resolution:
            true = self._disturbed(sensors, true)
        angles = dict(zip(self.names, true.angles, strict=True))
        rates = dict(zip(self.names, true.rates, strict=True))
        point = true.contact_point if sensors.contact_point else None
        return Reading(time, true.gyro, true.attitude, angles, rates, point)

    def _disturbed(self, sensors: Sensors, true: TrueReading) -> TrueReading:
        values = {name: np.array(value) for name, value in true._asdict().items()}
        # Fixed order: noise must not depend on the order of a dict.
        for name in [name for name in SENSORS if sensors.noise.get(name)]:
            if name == "attitude":
                turn = sensors.noise[name] * self.random.normal(size=3)
                values[name] = turned(values[name], turn)
            else:
                values[name] += sensors.noise[name] * self.random.normal(size=len(values[name]))
        for name, step in sensors.resolution.items():
            values[name] = step * np.round(values[name] / step) if step else values[name]
        angles, rates = values.pop("angles").tolist(), values.pop("rates").tolist()
        return TrueReading(angles=angles, rates=rates, **values)

    def _call(self, reading: Reading) -> dict[str, float]:
        """Return the controller's commands for a reading, within their limits."""
        failure = f"{self.scene.name}: the controller fails"
        answer: Any = call_users(failure, self.function, reading, at=reading.time)
        if not isinstance(answer, Mapping):
            example = {next(iter(self.held)): 1.0}
            line = f"must return a dict of commands, for example {example}"
            raise self._refused(f"{line}; at t = {reading.time:g} s it returns {answer!r}")
        commands = {}
        for name, value in answer.items():
            if name not in self.held:
                raise self._no_command(name)
            if name in self.with_activation:
                raise self._refused(f"cannot command {name}: remove the lag of its activation")
            try:
                command = float(value)
            except (TypeError, ValueError):
                command = math.nan
            if not abs(command) <= LARGEST:
                line = f"gives {name} the command {value!r} at t = {reading.time:g} s"
                raise self._refused(f"{line}; commands must be finite, at most {LARGEST:g} in size")
            low, high = self.command_limits.get(name, NO_LIMITS)
            commands[name] = min(max(command, low), high)
        return commands

    def _no_command(self, name: object) -> InputError:
        """Return the error for a name without a motor."""
        if name not in self.names:
            return self._refused(f"commands an unknown motor: {unknown('motor', name, self.held)}")
        hinge = self.scene.hinges[self.names.index(str(name))]
        reason = "rate is prescribed" if hinge.motor is None else "hinge turns freely"
        return self._refused(f"cannot command {name}, whose {reason}: give it a motor like Servo")

    def _refused(self, reason: str) -> InputError:
        return InputError(f"{self.scene.name}: the controller {reason}")


def _row(reading: Reading, commands: Mapping[str, float]) -> dict[str, float]:
    row = {"time": reading.time, **{f"command[{name}]": x for name, x in commands.items()}}
    for sensor in SENSORS:
        value = getattr(reading, sensor)
        places = value if isinstance(value, Mapping) else range(0 if value is None else len(value))
        row |= {f"{sensor}[{place}]": float(value[place]) for place in places}
    return row

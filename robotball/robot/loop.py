"""The loop of a controller over one run: engines reach its times, and hold its commands.

A closed loop is a sequence of motions with constant commands. Every engine steps from one change of
a command to the next, so none calls a controller within a step, and all call it at the same times.
In order: what engines tell of a state, the loop.
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
from robotball.robot.function_drives import Held
from robotball.robot.motors import Free
from robotball.robot.scene import Scene
from robotball.rotations import Array, turned


class Sensed(NamedTuple):
    """What the sensors would read without error: gyro, attitude, hinges and contact point.

    As in `Reading`, with the hinges' angles and rates (h,) in the order of the scene.
    """

    gyro: Array
    attitude: Array
    angles: Sequence[float]
    rates: Sequence[float]
    contact_point: Array


class Loop:
    """A controller in one run of its scene.

    scene: with the commands that the run has had so far, for the engine that runs it.
    """

    def __init__(self, scene: Scene, controller: Controller) -> None:
        self.scene, self.controller = scene, controller
        self.names = [hinge.name for hinge in scene.hinges]
        self.within = {each.name: each.within for each in scene.actuators}
        self.filtered = [each.name for each in scene.actuators if each.activation is not None]
        moved = [each for each in scene.hinges if not isinstance(each.motor, Free | None)]
        self.held = {each.name: Held(each.command) for each in moved}
        actuators = zip(scene.actuators, scene.controls, strict=True)
        self.held |= {each.name: Held(command) for each, command in actuators}
        copied = f"{scene.name}: the controller cannot be copied, as each run needs its own"
        self.function = call_users(copied, copy.deepcopy, controller.function)
        self.scene = replace(scene)
        hinges = [replace(h, command=self.held.get(h.name, h.command)) for h in scene.hinges]
        # The properties' own places: what a drive promises a scene, commands to come cannot.
        vars(self.scene).update(
            hinges=tuple(hinges),
            drives=tuple(hinge.command for hinge in hinges),
            controls=tuple(self.held[each.name] for each in scene.actuators),
        )
        self.random = np.random.default_rng(controller.sensors.seed)
        self.measured = self.called = self.applied = 0
        self.readings, self.answers = deque[Reading](), deque[dict[str, float]]()

    def reach(self, t: float, sense: Callable[[], Sensed]) -> None:
        """Measure, call and command what is due at t [s], a stop of the run; sense: its state.

        Raises InputError where the function fails or returns no commands.
        """
        controller, until = self.controller, t + self.controller.together
        while self.measured * controller.period - controller.sensors.latency <= until:
            self.readings.append(self._read(self.measured * controller.period, sense()))
            self.measured += 1
        while self.called * controller.period <= until:
            self.answers.append(self._call(self.readings.popleft()))
            self.called += 1
        while self.applied * controller.period + controller.delay <= until:
            for name, value in self.answers.popleft().items():
                self.held[name].hold(t, Constant(value))
            self.applied += 1

    @property
    def holds(self) -> bool:
        """Whether all commands keep their values until the controller gives others."""
        commands = (*self.scene.drives, *self.scene.controls)
        last = (each.drives[-1] if isinstance(each, Held) else each for each in commands)
        return all(isinstance(each, Constant) for each in last)

    def _read(self, time: float, true: Sensed) -> Reading:
        """Return what the sensors make of a state."""
        sensors = self.controller.sensors
        if sensors.noise or sensors.resolution:
            true = self._disturbed(sensors, true)
        angles = dict(zip(self.names, true.angles, strict=True))
        rates = dict(zip(self.names, true.rates, strict=True))
        point = true.contact_point if sensors.contact_point else None
        return Reading(time, true.gyro, true.attitude, angles, rates, point)

    def _disturbed(self, sensors: Sensors, true: Sensed) -> Sensed:
        read = {name: np.array(value) for name, value in true._asdict().items()}
        # In one order, as the noise must not depend on that of a mapping.
        for name in [name for name in SENSORS if sensors.noise.get(name)]:
            if name == "attitude":
                read[name] = turned(read[name], sensors.noise[name] * self.random.normal(size=3))
            else:
                read[name] += sensors.noise[name] * self.random.normal(size=len(read[name]))
        for name, step in sensors.resolution.items():
            read[name] = step * np.round(read[name] / step) if step else read[name]
        angles, rates = read.pop("angles").tolist(), read.pop("rates").tolist()
        return Sensed(angles=angles, rates=rates, **read)

    def _call(self, reading: Reading) -> dict[str, float]:
        """Return the commands of a reading."""
        failed = f"{self.scene.name}: the controller fails"
        answer: Any = call_users(failed, self.function, reading, at=reading.time)
        if not isinstance(answer, Mapping):
            example, at = {next(iter(self.held)): 1.0}, f"t = {reading.time:g} s"
            raise self._refused(
                f"must return commands by name, as {example}, not {answer!r} ({at})"
            )
        commands = {}
        for name, value in answer.items():
            if name not in self.held:
                raise self._no_command(name)
            if name in self.filtered:
                raise self._refused(f"cannot command {name}, whose activation has a lag")
            try:
                command = float(value)
            except (TypeError, ValueError):
                command = math.nan
            if not abs(command) <= LARGEST:
                raise self._refused(
                    f"commands {value!r} of {name} at t = {reading.time:g} s; a command must be "
                    f"finite and at most {LARGEST:g} in size"
                )
            low, high = self.within.get(name, _ANY)
            commands[name] = min(max(command, low), high)
        return commands

    def _no_command(self, name: object) -> InputError:
        """Return the error for a name that is no motor's."""
        if name not in self.names:
            return InputError(f"{self.scene.name}, controller: {unknown('motor', name, self.held)}")
        hinge = self.scene.hinges[self.names.index(str(name))]
        lacks = "its rate is given exactly" if hinge.motor is None else "it turns freely"
        return self._refused(f"cannot command {name}, as {lacks}: give it a motor, as Servo")

    def _refused(self, why: str) -> InputError:
        return InputError(f"{self.scene.name}: the controller {why}")


_ANY = (-math.inf, math.inf)

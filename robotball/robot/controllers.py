"""Controllers: commands computed from sensor readings, and held until the next call.

Commands are constant between controller calls, so a closed-loop run is a sequence of open-loop
runs. Engines stop at the controller's times and never call it within a step.
"""

import copy
import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from robotball.errors import (
    LARGEST,
    InputError,
    call_users,
    check_not_negative,
    check_positive,
    check_seed,
    unknown,
)
from robotball.robot.ball import Value
from robotball.robot.drives import Constant
from robotball.robot.function_drives import HeldCommand
from robotball.robot.motors import NO_LIMITS, Free
from robotball.robot.scene import Scene
from robotball.rotations import Array, turned

_MOST_CALLS = 1e6  # in a run: 30 s of work of an empty controller
_TOGETHER = 1e-9  # of a period: events at a smaller distance are simultaneous
# Units of the noise by sensor; the contact point is optional.
_ALWAYS_READ = {"gyro": "rad/s", "attitude": "rad", "angles": "rad", "rates": "rad/s"}
_SENSORS = {**_ALWAYS_READ, "contact_point": "m"}


@dataclass(frozen=True)
class Reading(Value):
    """Hold the sensor readings of a robot at a time.

    Attributes
    ----------
    time : float, s
        The time of the call.
    gyro : (3,), rad/s, frame axes
        Angular velocity of the frame, or of the shell in a ball without a frame.
    attitude : (4,)
        Unit quaternion (w, x, y, z) of the frame, frame to world.
    angles, rates : mapping of str to float, rad and rad/s
        Hinge angles and rates by hinge name; m and m/s for slides.
    contact_point : (2,), m, world, or None
        Contact point on the plane; None unless `Sensors.contact_point` is set.

    Examples
    --------
    >>> import numpy as np
    >>> import robotball as rb
    >>> level = np.array([1.0, 0.0, 0.0, 0.0])
    >>> rb.Reading(0.5, np.zeros(3), level, {"frame": 0.2}, {"frame": 1.0}).rates["frame"]
    1.0
    """

    time: float
    gyro: Array
    attitude: Array
    angles: Mapping[str, float]
    rates: Mapping[str, float]
    contact_point: Array | None = None


@dataclass(frozen=True)
class Sensors:
    """Select the sensors of a controller, with their noise, resolution and latency.

    Sensors are gyro, attitude, angles, rates and contact_point, see `Reading`.

    Parameters
    ----------
    noise : mapping of str to float, optional
        Standard deviation of each number of a sensor. For the attitude, of a rotation about each
        axis, rad.
    resolution : mapping of str to float, optional
        Step to which the numbers of a sensor are rounded. The attitude cannot be rounded.
    latency : float, optional
        Age of the readings, s. Until the motion has lasted as long, the initial state is read.
    contact_point : bool, optional
        True to read the contact point.
    seed : int, optional
        Seed of the noise, which is the same in every run of every engine.

    Raises
    ------
    InputError
        If a sensor is unknown, or a number is negative or not finite.

    Examples
    --------
    >>> import robotball as rb
    >>> sensors = rb.Sensors(noise={"gyro": 0.01}, resolution={"angles": 0.002}, latency=0.005)
    >>> sensors.contact_point
    False
    """

    noise: Mapping[str, float] = field(default_factory=dict)
    resolution: Mapping[str, float] = field(default_factory=dict)
    latency: float = 0.0
    contact_point: bool = False
    seed: int = 0

    def __post_init__(self) -> None:
        check_seed(self.seed)
        check_not_negative("the sensors' latency", self.latency, "s")
        read = [*_SENSORS] if self.contact_point else [*_ALWAYS_READ]
        rounded = [name for name in read if name != "attitude"]
        for kind, names in (("noise", read), ("resolution", rounded)):
            for name, value in getattr(self, kind).items():
                if name not in names:
                    raise unknown(f"sensor with a {kind}", name, names)
                check_not_negative(f"the {kind} of {name}", value, _SENSORS[name])


@dataclass(frozen=True)
class Controller:
    """Command the motors of a scene from its sensor readings.

    Parameters
    ----------
    function : callable
        Called with a `Reading`. Returns commands by the names of hinges with a motor and of
        actuators, in the motor's unit. Omitted names keep their command. An object with a state is
        copied for each run.
    period : float
        Time between two calls, s. The first call is at t = 0.
    delay : float, optional
        Time from a call until its commands take effect, s. Before that, motors have the commands of
        their scene.
    sensors : Sensors, optional
        Sensors with their errors.

    Raises
    ------
    InputError
        If the function is not callable, the period not positive, or the delay negative.

    Examples
    --------
    >>> import robotball as rb
    >>> def damp(reading):
    ...     return {"frame": -0.5 * reading.gyro[1]}
    >>> scene = rb.load_scene("pendulum_robot").with_controller(rb.Controller(damp, 0.01))
    >>> rb.simulate(scene, 0.5, settings="fast").report.faults
    ()
    """

    function: Callable[[Reading], Mapping[str, float]]
    period: float
    delay: float = 0.0
    sensors: Sensors = field(default_factory=Sensors)

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise InputError(f"a controller's function must be callable, not {self.function!r}")
        check_positive("a controller's period", self.period, "s")
        check_not_negative("a controller's delay", self.delay, "s")

    @property
    def together(self) -> float:
        """Two events within this time [s] are simultaneous."""
        return _TOGETHER * self.period

    def stops(self, end: float) -> list[float]:
        """Return the times after 0 of measurements, calls and commands in a run to `end` [s].

        Raises InputError if there are too many calls.
        """
        if not end / self.period <= _MOST_CALLS:
            raise InputError(
                f"a controller with a period of {self.period:g} s is called "
                f"{end / self.period:.2g} times in {end:g} s, of at most {_MOST_CALLS:g}; choose a "
                "longer period or a shorter run"
            )
        # Multiples of the period, because sums would accumulate rounding errors.
        calls = self.period * np.arange(math.ceil(end / self.period))
        times = np.sort([*(calls - self.sensors.latency), *calls, *(calls + self.delay)])
        alone = np.diff(times, prepend=-np.inf) > self.together
        inside = (times > self.together) & (times < end - self.together)
        return [float(t) for t in times[alone & inside]]


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
        # Limits and activations are applied already: `controls` has their results.
        actuators = [
            replace(actuator, command=HeldCommand(control), activation=None, within=NO_LIMITS)
            for actuator, control in zip(scene.actuators, scene.controls, strict=True)
        ]
        ball = scene.ball.with_hinges(command=hinges)
        self.scene = replace(scene, ball=ball, actuators=tuple(actuators))
        self.held: dict[str, Any] = hinges | {a.name: a.command for a in actuators}
        failure = f"{scene.name}: the controller cannot be copied, and each run needs its own copy"
        self.function = call_users(failure, copy.deepcopy, controller.function)
        self.random = np.random.default_rng(controller.sensors.seed)
        self.measured = self.called = self.applied = 0
        self.readings, self.answers = deque[Reading](), deque[dict[str, float]]()

    def reach(self, t: float, sense: Callable[[], TrueReading]) -> None:
        """Sample the sensors, call the controller and apply its commands, if due at time t [s].

        Raises InputError if the controller fails or returns invalid commands.
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
        """True if every command is constant until the next controller call."""
        commands = (*self.scene.drives, *self.scene.controls)
        last = (c.drives[-1] if isinstance(c, HeldCommand) else c for c in commands)
        return all(isinstance(drive, Constant) for drive in last)

    def _read(self, time: float, true: TrueReading) -> Reading:
        """Return the reading that the sensors give of a state."""
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
        for name in [name for name in _SENSORS if sensors.noise.get(name)]:
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
            raise self._refused(
                f"must return commands by name, for example {example}, not {answer!r} "
                f"(t = {reading.time:g} s)"
            )
        commands = {}
        for name, value in answer.items():
            if name not in self.held:
                raise self._no_command(name)
            if name in self.with_activation:
                raise self._refused(f"cannot command {name}: its activation has a lag")
            try:
                command = float(value)
            except (TypeError, ValueError):
                command = math.nan
            if not abs(command) <= LARGEST:
                raise self._refused(
                    f"commands {value!r} for {name} at t = {reading.time:g} s; a command must be "
                    f"finite and at most {LARGEST:g} in size"
                )
            low, high = self.command_limits.get(name, NO_LIMITS)
            commands[name] = min(max(command, low), high)
        return commands

    def _no_command(self, name: object) -> InputError:
        """Return the error for a name without a motor."""
        if name not in self.names:
            return InputError(f"{self.scene.name}, controller: {unknown('motor', name, self.held)}")
        hinge = self.scene.hinges[self.names.index(str(name))]
        reason = "its rate is prescribed" if hinge.motor is None else "it turns freely"
        return self._refused(f"cannot command {name}: {reason}. Give it a motor, for example Servo")

    def _refused(self, reason: str) -> InputError:
        return InputError(f"{self.scene.name}: the controller {reason}")

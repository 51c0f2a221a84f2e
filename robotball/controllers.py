"""Controllers: commands by what a robot's own sensors read, held from one call to the next.

A closed loop is a sequence of motions with constant commands. Every engine steps from one change of
a command to the next, so none calls a controller within a step, and all call it at the same times.
In order: what sensors read, the controller, its loop over one run.
"""

import copy
import math
import traceback
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import numpy as np

from robotball.drives import Held
from robotball.errors import (
    InputError,
    check_not_negative,
    check_positive,
    check_seed,
    check_size,
    unknown,
)
from robotball.motors import Free
from robotball.rotations import Array, turned
from robotball.scene import Scene

_MOST_CALLS = 1e6  # in a run: half a minute's work of a controller that does nothing
_TOGETHER = 1e-9  # of a period: times that are so near to each other are one
_UNITS = {"gyro": "rad/s", "attitude": "rad", "angles": "rad", "rates": "rad/s",
          "contact_point": "m"}  # fmt: skip


@dataclass(frozen=True)
class Reading:
    """Hold what the sensors of a robot read at a time.

    Attributes
    ----------
    time : float, s
        The time of the call.
    gyro : (3,), rad/s, frame axes
        The angular velocity of the frame; of the shell in a ball without a frame.
    attitude : (4,)
        The frame's unit quaternion (w, x, y, z), frame to world.
    angles, rates : mapping of str to float, rad and rad/s
        Of each hinge, by its name. Of a slide in m and m/s.
    contact_point : (2,), m, world, or None
        Where the ball touches the plane; None unless `Sensors` asks for it.

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
    """Say what a controller reads, and how badly.

    Sensors are gyro, attitude, angles, rates and contact_point, as in `Reading`.

    Parameters
    ----------
    noise : mapping of str to float, optional
        Standard deviation of each number of a sensor. That of the attitude is in rad, of a turn
        about each axis.
    resolution : mapping of str to float, optional
        Step to which a sensor's numbers are rounded. The attitude has none.
    latency : float, optional
        Age of what is read, s. Before the motion has lasted so long, its start is read.
    contact_point : bool, optional
        Whether the contact point is read.
    seed : int, optional
        Of the noise, which is the same in every run of every engine.

    Raises
    ------
    InputError
        If there is no such sensor, or a number is negative or not finite.

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
        read = [*_UNITS] if self.contact_point else [*_UNITS][:-1]
        for what, names in (("noise", read), ("resolution", [n for n in read if n != "attitude"])):
            for name, value in getattr(self, what).items():
                if name not in names:
                    raise unknown(f"sensor with a {what}", name, names)
                check_not_negative(f"the {what} of {name}", value, _UNITS[name])


@dataclass(frozen=True)
class Controller:
    """Close the loop of a scene: command its motors by what its sensors read.

    Parameters
    ----------
    function : callable
        Called with a `Reading`. Returns commands by the names of hinges with a motor and of
        actuators, in the motor's unit. A name that is left out keeps its command. An object with a
        state of its own is copied for each run.
    period : float
        Time between two calls, s. The first is at t = 0.
    delay : float, optional
        Time from a call until its commands take effect, s. Until the first do, motors have those of
        their scene.
    sensors : Sensors, optional
        What is read, and how badly.

    Raises
    ------
    InputError
        If the function cannot be called, or a time is not finite, negative, or a period of 0.

    Examples
    --------
    >>> import robotball as rb
    >>> def damp(reading):
    ...     return {"frame": -0.5 * reading.gyro[1]}
    >>> scene = rb.load_scene("pendulum_robot").with_controller(rb.Controller(damp, 0.01))
    >>> rb.simulate(scene, rb.sample_times(0.5), "fast").report.faults
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
        """The time [s] within which two events of the loop are one."""
        return _TOGETHER * self.period

    def stops(self, end: float) -> list[float]:
        """Return the times after 0 of a run to `end` [s] at which it measures, calls and commands.

        Raises InputError for a run with too many calls.
        """
        if not end / self.period <= _MOST_CALLS:
            raise InputError(
                f"a controller with a period of {self.period:g} s is called "
                f"{end / self.period:.2g} times in {end:g} s, of at most {_MOST_CALLS:g}; take a "
                "longer period, or a shorter run"
            )
        # Multiples, as sums of a period would add up their rounding.
        calls = self.period * np.arange(math.ceil(end / self.period))
        times = np.sort([*(calls - self.sensors.latency), *calls, *(calls + self.delay)])
        alone = np.diff(times, prepend=-np.inf) > self.together
        inside = (times > self.together) & (times < end - self.together)
        return [float(t) for t in times[alone & inside]]


class Sensed(NamedTuple):
    """What the sensors would read without error: gyro, attitude, hinges and contact point.

    As in `Reading`, with the hinges' angles and rates (h,) in the order of the scene.
    """

    gyro: Array
    attitude: Array
    angles: Array
    rates: Array
    contact_point: Array


def commanded(scene: Scene) -> dict[str, Held]:
    """Return a drive that can be held for each motor that takes a command, by its name."""
    held = {
        hinge.name: Held(hinge.command)
        for hinge in scene.hinges
        if not isinstance(hinge.motor, Free | None)
    }
    actuators = zip(scene.actuators, scene.controls, strict=True)
    return held | {each.name: Held(command) for each, command in actuators}


class Loop:
    """A controller in one run of its scene.

    scene: with the commands that the run has had so far, for the engine that runs it.
    """

    def __init__(self, scene: Scene, controller: Controller) -> None:
        self.controller, self.names = controller, [hinge.name for hinge in scene.hinges]
        self.within = {each.name: each.within for each in scene.actuators}
        self.filtered = [each.name for each in scene.actuators if each.activation is not None]
        self.held = commanded(scene)
        try:
            self.function = copy.deepcopy(controller.function)
        except Exception as error:  # whatever a user's object may raise
            raise InputError(
                f"{scene.name}: the controller cannot be copied, as each run needs one of its own: "
                f"{type(error).__name__}: {error}"
            ) from error
        own = {name: drive for name, drive in self.held.items() if name in self.names}
        actuators = [
            replace(each, command=self.held[each.name], activation=None, within=_ANY)
            for each in scene.actuators
        ]
        self.scene = replace(
            scene, ball=scene.ball.with_hinges(command=own), actuators=tuple(actuators)
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
                self.held[name].hold(t, value)
            self.applied += 1

    def _read(self, time: float, true: Sensed) -> Reading:
        """Return what the sensors make of a state."""
        sensors, read = self.controller.sensors, true._asdict()
        # In one order, as the noise must not depend on that of a mapping.
        for name in [name for name in _UNITS if sensors.noise.get(name)]:
            if name == "attitude":
                read[name] = turned(read[name], sensors.noise[name] * self.random.normal(size=3))
            else:
                drawn = self.random.normal(size=len(read[name]))
                read[name] = read[name] + sensors.noise[name] * drawn
        for name, step in sensors.resolution.items():
            read[name] = step * np.round(read[name] / step) if step else read[name]
        angles, rates = (
            dict(zip(self.names, read[name].tolist(), strict=True)) for name in ("angles", "rates")
        )
        point = read["contact_point"] if sensors.contact_point else None
        return Reading(time, read["gyro"], read["attitude"], angles, rates, point)

    def _call(self, reading: Reading) -> dict[str, float]:
        """Return the commands of a reading."""
        where = f"{self.scene.name}: the controller"
        try:
            answer: Any = self.function(reading)
        except Exception as error:  # whatever a user's function may raise
            raise InputError(
                f"{where} fails at t = {reading.time:g} s{_line_of(error)}: "
                f"{type(error).__name__}: {error}"
            ) from error
        if not isinstance(answer, Mapping):
            example = {next(iter(self.held)): 1.0}
            raise InputError(
                f"{where} must return commands by name, as {example}, not {answer!r} "
                f"(t = {reading.time:g} s)"
            )
        commands = {}
        for name, value in answer.items():
            if name not in self.held:
                raise self._no_command(name)
            if name in self.filtered:
                raise InputError(f"{where} cannot command {name}, whose activation has a lag")
            try:
                value = float(value)
            except (TypeError, ValueError):
                value = math.nan
            check_size(f"{where}'s command of {name} at t = {reading.time:g} s", value)
            low, high = self.within.get(name, _ANY)
            commands[name] = min(max(value, low), high)
        return commands

    def _no_command(self, name: object) -> InputError:
        """Return the error for a name that is no motor's."""
        where = f"{self.scene.name}: the controller"
        if name not in self.names:
            return InputError(f"{where}: {unknown('motor', name, self.held)}")
        hinge = self.scene.hinges[self.names.index(str(name))]
        lacks = "its rate is given exactly" if hinge.motor is None else "it turns freely"
        return InputError(f"{where} cannot command {name}, as {lacks}: give it a motor, as Servo")


_ANY = (-math.inf, math.inf)


def _line_of(error: Exception) -> str:
    """Return where in the user's file an error was raised, as words; "" where it is not known."""
    frames = traceback.extract_tb(error.__traceback__)[1:]
    own = [each for each in frames if each.filename == frames[0].filename]
    return f", in {own[-1].filename} line {own[-1].lineno}" if own else ""


def loop_of(scene: Scene) -> Loop | None:
    """Return the loop of a run of the scene; None where it has no controller."""
    return None if scene.controller is None else Loop(scene, scene.controller)

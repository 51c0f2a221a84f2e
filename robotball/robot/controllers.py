"""Controllers: commands by what a robot's own sensors read, held from one call to the next.

In order: what sensors read, the sensors, the controller. `robotball.robot.loop` runs it.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from robotball.errors import InputError, check_not_negative, check_positive, check_seed, unknown
from robotball.robot.ball import Value
from robotball.rotations import Array

_MOST_CALLS = 1e6  # in a run: half a minute's work of a controller that does nothing
_TOGETHER = 1e-9  # of a period: times that are so near to each other are one
# The sensors with the units of their noise.
SENSORS = {"gyro": "rad/s", "attitude": "rad", "angles": "rad", "rates": "rad/s",
          "contact_point": "m"}  # fmt: skip


@dataclass(frozen=True)
class Reading(Value):
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
        read = [*SENSORS] if self.contact_point else [*SENSORS][:-1]
        for what, names in (("noise", read), ("resolution", [n for n in read if n != "attitude"])):
            for name, value in getattr(self, what).items():
                if name not in names:
                    raise unknown(f"sensor with a {what}", name, names)
                check_not_negative(f"the {what} of {name}", value, SENSORS[name])


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

"""Controllers, which compute commands from sensor readings and hold them until the next call.

`robotball.robot.loop` calls the controllers.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from robotball.errors import InputError, check_not_negative, check_positive, check_seed, unknown
from robotball.robot.ball import Value
from robotball.rotations import Array

_MOST_CALLS = 1e6  # in a run; they take 30 s, even if the controller does nothing
_TOGETHER = 1e-9  # of a period: events that are closer in time are simultaneous
# Units of the noise by sensor; the contact point is optional.
_ALWAYS_READ = {"gyro": "rad/s", "attitude": "rad", "angles": "rad", "rates": "rad/s"}
SENSORS = {**_ALWAYS_READ, "contact_point": "m"}


@dataclass(frozen=True)
class Reading(Value):
    """Hold the sensor readings of a robot at one time.

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

    The sensors are gyro, attitude, angles, rates and contact_point; `Reading` describes them.

    Parameters
    ----------
    noise : mapping of str to float, optional
        Standard deviation of the noise by sensor, the same for each number of the sensor. The
        noise of the attitude is a rotation about each axis, rad.
    resolution : mapping of str to float, optional
        Step to which the numbers of a sensor are rounded. The attitude cannot be rounded.
    latency : float, optional
        Age of the readings, s. Before t = latency, the sensors read the initial state.
    contact_point : bool, optional
        True to read the contact point.
    seed : int, optional
        Seed of the noise. The noise is the same in every run and with every engine.

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
        read = [*SENSORS] if self.contact_point else [*_ALWAYS_READ]
        rounded = [name for name in read if name != "attitude"]
        for kind, names in (("noise", read), ("resolution", rounded)):
            for name, value in getattr(self, kind).items():
                if name not in names:
                    raise unknown(f"sensor with a {kind}", name, names)
                check_not_negative(f"the {kind} of {name}", value, SENSORS[name])


@dataclass(frozen=True)
class Controller:
    """Command the motors of a scene from its sensor readings.

    Parameters
    ----------
    function : callable
        Called with a `Reading`. Returns a mapping of names to commands, in the unit of the motor.
        A name is that of a hinge with a motor or of an actuator; if it is omitted, the command
        stays the same. A callable object with a state is copied for each run.
    period : float
        Time between two calls, s. The first call is at t = 0.
    delay : float, optional
        Time from a call until its commands take effect, s. Until the first commands take effect,
        the motors have the commands of the scene.
    sensors : Sensors, optional
        Sensors, with their noise, resolution and latency.

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
        """Time [s] within which two events are simultaneous."""
        return _TOGETHER * self.period

    def stops(self, end: float) -> list[float]:
        """Return the times of measurements, calls and commands after 0 in a run to `end` [s].

        Raises InputError if there are too many calls.
        """
        if not end / self.period <= _MOST_CALLS:
            many = f"{end / self.period:.2g} calls in {end:g} s, more than {_MOST_CALLS:g}"
            line = f"a controller's period of {self.period:g} s needs {many}"
            raise InputError(f"{line}; choose a longer period or a shorter run")
        # Multiples of the period, because sums would accumulate rounding errors.
        calls = self.period * np.arange(math.ceil(end / self.period))
        times = np.sort([*(calls - self.sensors.latency), *calls, *(calls + self.delay)])
        alone = np.diff(times, prepend=-np.inf) > self.together
        inside = (times > self.together) & (times < end - self.together)
        return [float(t) for t in times[alone & inside]]

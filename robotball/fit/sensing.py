"""Model of a robot's sensors: their readings in a motion, compared with a log's readings.

The model includes circumstances of a real log, such as a late clock, a rotated motion-capture frame
or a gyro bias. Each circumstance is 0 unless it is fitted.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import permutations, product

import numpy as np
from numpy.typing import NDArray

from robotball.errors import unknown
from robotball.fit.logs import Sensor
from robotball.motion import Motion, ReferenceMotion
from robotball.rotations import Array, multiply, rotation_matrix, turn_between

Rows = NDArray[np.intp]

_CLOCK, _ZERO, _BIAS, _SCALE = ".clock", ".zero", ".bias", ".scale"
_AROUND = 1e-3  # s, half the interval of the differences that give an accelerometer's reading
ON_THE_PLANE = 0.05  # of the radius: a smaller height belongs to the contact point
FEWEST = 7  # readings needed to estimate a sensor's noise
_VERTICAL = np.array([0.0, 0.0, 1.0])
_STILL = 1.5  # of the noise: spread of the readings at rest, allowing for few readings
_TURN = 0.3  # rad, rotation over a span that is compared with a gyro
_CONTRADICTS = 0.5  # of the rotation; a sign error gives 2, degrees 1, swapped axes up to 1.4
_BEYOND = 10.0  # of the attitude's noise
_MEDIAN = 0.6745  # median of |x| for the standard normal distribution
_OFTEN = 0.1  # fraction of equal neighbours above which readings are coarsely rounded


@dataclass(frozen=True)
class _Circumstance:
    """A kind of circumstance.

    Attributes
    ----------
    count : int
        How many numbers the circumstance has.
    unit : str
        The unit of these numbers.
    plausible : float
        An amount to be expected in a careful log. If the circumstance is not fitted, this amount
        must not change an estimate by more than the estimate's deviation.
    """

    count: int
    unit: str
    plausible: float


_LATE = _Circumstance(1, "s", 0.02)  # one frame of a camera at 50 Hz
_TURNING = _Circumstance(3, "rad/s", 0.02)  # 1°/s, the zero-rate offset of a cheap gyro
_OF_ENCODERS = _Circumstance(1, "rad", 0.02)  # 1°, a zero set by eye
_FACTOR = _Circumstance(1, "1", 0.02)  # sensitivity error of an uncalibrated sensor
_CIRCUMSTANCES = {
    "sensors.clock": _LATE,
    "commands.delay": _LATE,
    "world.yaw": _Circumstance(1, "rad", 0.035),  # 2°, axes set by eye
    "world.origin": _Circumstance(2, "m", 0.01),
    "position.marker": _Circumstance(3, "m", 0.005),
    "gyro.bias": _TURNING,
    "accelerometer.bias": _Circumstance(3, "m/s²", 0.2),  # 20 mg, of a cheap accelerometer
    "accelerometer.place": _Circumstance(3, "m", 0.01),
}


def circumstances_of(sensors: Iterable[str]) -> dict[str, _Circumstance]:
    """Return the circumstances of a log with these sensors, keyed by name."""
    sensors = list(sensors)
    prefixes = ("sensors", "world", "commands", *sensors)
    kinds = {name: kind for name, kind in _CIRCUMSTANCES.items() if name.split(".")[0] in prefixes}
    kinds |= {name + _CLOCK: _LATE for name in sensors}
    kinds |= {name + _BIAS: _TURNING for name in sensors if name.endswith("_gyro")}
    kinds |= {name + _ZERO: _OF_ENCODERS for name in sensors if name.endswith("_angle")}
    kinds |= {name + _SCALE: _FACTOR for name in sensors if not name.endswith("attitude")}
    return kinds


def circumstance(name: str, sensors: Iterable[str]) -> _Circumstance:
    """Return a circumstance of a log. Raises InputError for an unknown name."""
    known = circumstances_of(sensors)
    if name not in known:
        raise unknown("circumstance of the log", name, known)
    return known[name]


def is_of_readings(name: str) -> bool:
    """Return whether a circumstance affects only the readings, not their times or the motion."""
    return not name.endswith((_CLOCK, ".delay"))


def times_of(sensor: Sensor, amounts: Mapping[str, Array]) -> Array:
    """Return the times (n,) at which a sensor needs the motion; (3n,) for an accelerometer.

    amounts: numbers of the circumstances and the start, keyed by name, here and below.
    """
    at = np.abs(_read_at(sensor, amounts))
    if sensor.name != "accelerometer":
        return at
    return np.concatenate([np.maximum(at - _AROUND, 0.0), at, at + _AROUND])


def _read_at(sensor: Sensor, amounts: Mapping[str, Array]) -> Array:
    """Return the times (n,) of a sensor's readings on the clock of the motion."""
    clocks = ("sensors" + _CLOCK, sensor.name + _CLOCK)
    return sensor.times - sum(float(amounts[name][0]) for name in clocks if name in amounts)


def apart(sensor: Sensor, motion: Motion, rows: Rows, amounts: Mapping[str, Array]) -> Array:
    """Return readings minus values of the motion (n, k); rotation vectors for an attitude.

    rows: samples of the motion at `times_of`.
    """
    read = _readings(sensor, motion, rows, amounts)
    early = _read_at(sensor, amounts) < 0
    if early.any() and sensor.name != "accelerometer":
        # The motion before t = 0 is unknown: extrapolate the readings as odd functions.
        start = np.zeros_like(rows)
        read[early] = 2 * _readings(sensor, motion, start, amounts)[early] - read[early]
    read = read * (1.0 + amounts.get(sensor.name + _SCALE, np.zeros(1))[0])
    if sensor.name.endswith("attitude"):
        return turn_between(read, sensor.values)
    return np.asarray(sensor.values - read)


def _readings(sensor: Sensor, motion: Motion, rows: Rows, amounts: Mapping[str, Array]) -> Array:
    scene, name = motion.scene, sensor.name
    if name == "accelerometer":
        return _specific_force(motion, rows, amounts)
    if name == "position":
        return _position(sensor, motion, rows, amounts)
    if name.endswith("attitude"):
        attitude, _ = _carried(motion, rows, name.removesuffix("attitude"))
        yaw = amounts.get("world.yaw", np.zeros(1))[0]
        world = np.array([np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)])
        return multiply(np.broadcast_to(world, (len(rows), 4)), attitude)
    bias = amounts.get(f"{name}{_BIAS}", 0.0)
    if name.endswith("gyro") and not (name == "shell_gyro" and scene.ball.has_frame):
        return _carried(motion, rows, name.removesuffix("gyro"))[1] + bias
    if name == "shell_gyro":
        axis, half = scene.ball.shell.axis, motion.hinge_angles[rows, :1] / 2
        # The readings are in the shell's axes, from which the hinge rotates the frame.
        to_shell = rotation_matrix(np.concatenate([np.cos(half), np.sin(half) * axis], axis=1))
        return np.asarray(np.einsum("nij,nj->ni", to_shell, of_shell(motion)[rows])) + bias
    hinge, _, kind = name.rpartition("_")
    i = [hinge_.name for hinge_ in scene.hinges].index(hinge)
    if kind == "angle":
        return motion.hinge_angles[rows, i : i + 1] + amounts.get(f"{name}{_ZERO}", 0.0)
    if kind == "rate":
        return motion.hinge_rates[rows, i : i + 1]
    return motion.loads.motor_torques[rows, i : i + 1]


def of_shell(motion: Motion) -> Array:
    """Return the shell's angular velocity (n, 3) in the axes of `Motion.angular_velocity`."""
    if not motion.scene.ball.has_frame:
        return motion.angular_velocity
    axis = motion.scene.ball.shell.axis
    return np.asarray(motion.angular_velocity - np.outer(motion.hinge_rates[:, 0], axis))


def _carried(motion: Motion, rows: Rows, name: str) -> tuple[Array, Array]:
    """Return the attitude (n, 4) and angular velocity (n, 3) of a body, in its own axes."""
    names = ["", *(f"{hinge.name}_" for hinge in motion.scene.hinges)]
    if (i := names.index(name) if name in names else 0) == 0:
        return motion.attitude[rows], motion.angular_velocity[rows]
    link, half = motion.scene.ball.tree[i], motion.hinge_angles[rows, i - 1 : i] / 2
    attitude, turning = _carried(motion, rows, f"{link.parent}_")
    if link.slides:
        return attitude, turning
    turn = np.concatenate([np.cos(half), np.sin(half) * link.axis], axis=1)
    turning = np.einsum("nji,nj->ni", rotation_matrix(turn), turning)
    return multiply(attitude, turn), turning + np.outer(motion.hinge_rates[rows, i - 1], link.axis)


def _position(sensor: Sensor, motion: Motion, rows: Rows, amounts: Mapping[str, Array]) -> Array:
    scene, heights = motion.scene, sensor.values[:, 2:]
    marker = amounts.get("position.marker", np.zeros(3))
    radius = scene.ball.radius
    on_the_plane = len(heights[0]) and np.abs(heights).max() < ON_THE_PLANE * radius
    level = 0.0 if on_the_plane and not marker.any() else radius
    at = rotation_matrix(motion.attitude[rows]) @ marker + [0.0, 0.0, level]
    at[:, :2] += motion.contact_point[rows] + amounts.get("start.place", 0.0)
    if "world.yaw" in amounts:
        c, s = np.cos(amounts["world.yaw"][0]), np.sin(amounts["world.yaw"][0])
        at[:, :2] = at[:, :2] @ np.array([[c, s], [-s, c]])
    at[:, :2] += amounts.get("world.origin", 0.0)
    return at[:, : sensor.values.shape[1]]


def _specific_force(motion: Motion, rows: Rows, amounts: Mapping[str, Array]) -> Array:
    """Return an accelerometer's reading (n, 3), frame axes [m/s²]; at rest +g upwards."""
    scene, (before, at, after) = motion.scene, rows.reshape(3, -1)
    to_world = rotation_matrix(motion.attitude)
    turning = np.einsum("nij,nj->ni", to_world, of_shell(motion))
    velocity = scene.ball.radius * np.cross(turning, _VERTICAL)
    velocity[:, :2] += scene.plane_velocity(motion.times, motion.contact_point)[:, :2]
    if isinstance(motion, ReferenceMotion) and motion.slip is not None:
        velocity[:, :2] += motion.slip[:, :2]
    gap = (motion.times[after] - motion.times[before])[:, None]
    centre = (velocity[after] - velocity[before]) / gap - scene.gravity_at(motion.times[at])
    omega = motion.angular_velocity
    alpha, omega = (omega[after] - omega[before]) / gap, omega[at]
    place = np.broadcast_to(amounts.get("accelerometer.place", np.zeros(3)), omega.shape)
    force = np.einsum("nji,nj->ni", to_world[at], centre) + np.cross(alpha, place)
    force += np.cross(omega, np.cross(omega, place))
    return np.asarray(force + amounts.get("accelerometer.bias", 0.0))


def noise_of(sensor: Sensor) -> float:
    """Return a sensor's noise (one standard deviation), estimated from its readings.

    Each reading is compared with the polynomial through three neighbours on either side. The median
    difference is noise if readings are dense compared with changes of the motion. For coarsely
    rounded readings it returns the rounding noise.
    """
    values, t = sensor.values, sensor.times
    if sensor.name.endswith("attitude"):
        values = turn_between(values[:-1], values[1:]).cumsum(axis=0)
        t = t[1:]
    i = np.arange(3, len(t) - 3)
    if not len(i):
        return 0.0
    near = i + np.array([-3, -2, -1, 1, 2, 3])[:, None]
    weights = np.ones(near.shape)
    for j in range(len(near)):
        for k in range(len(near)):
            if j != k:
                weights[j] *= (t[i] - t[near[k]]) / (t[near[j]] - t[near[k]])
    left = values[i] - np.einsum("jn,jnk->nk", weights, values[near])
    left /= np.sqrt(1 + (weights**2).sum(axis=0))[:, None]
    medians = np.median(np.abs(left), axis=0)
    spread = float(np.sqrt((medians**2).mean())) / _MEDIAN  # combines all columns like χ²
    steps = np.abs(np.diff(values, axis=0))
    least = float(steps[steps > 0].min()) if (steps > 0).any() else 0.0
    often = (steps == 0).mean() > _OFTEN
    return max(spread, least / np.sqrt(12)) if often else spread


def stands_still(sensors: Mapping[str, Sensor]) -> bool:
    """Return whether a log's readings, including a position or attitude, are pure noise."""
    return bool({"position", "attitude"} & sensors.keys()) and all(
        np.sqrt(_plain(sensor).var(axis=0).mean()) <= _STILL * noise_of(sensor)
        for sensor in sensors.values()
    )


def _plain(sensor: Sensor) -> Array:
    turns = sensor.name.endswith("attitude")
    return turn_between(sensor.values[:1], sensor.values) if turns else sensor.values


def _middle(vectors: Array) -> float:
    return float(np.median(np.linalg.norm(vectors, axis=1)))


def contradictions(sensors: Mapping[str, Sensor]) -> Iterator[tuple[str, str, str]]:
    """Yield the pairs of gyro and attitude sensor on one body that no motion can explain.

    The third text says which axes of the gyro would be explained, such as "y, x, -z"; else "".

    Compares median rotations of the attitude with the integrated gyro, over spans in which the
    attitude rotates by far more than its noise, but by so little that its axis does not matter.
    """
    for name, gyro in sensors.items():
        other = name.removesuffix("gyro") + "attitude"
        if not name.endswith("gyro") or other not in sensors:
            continue
        at, attitude = gyro.times, sensors[other]
        both = (attitude.times >= at[0]) & (attitude.times <= at[-1])
        t, attitudes = attitude.times[both], attitude.values[both]
        if len(t) < FEWEST:
            continue
        steps = np.diff(at)[:, None] * (gyro.values[1:] + gyro.values[:-1]) / 2
        sums = np.concatenate([np.zeros((1, 3)), steps.cumsum(axis=0)])
        whole = np.stack([np.interp(t, at, column) for column in sums.T], axis=1)
        for span in 2 ** np.arange(int(np.log2(max(len(t) // 2, 1))) + 1):
            turns = turn_between(attitudes[:-span], attitudes[span:])
            if _middle(turns) > _TURN:
                break
        # Without the median: a gyro bias is not a contradiction.
        turns = turns - np.median(turns, axis=0)
        whole = whole[span:] - whole[:-span]
        most, axes = max(_CONTRADICTS * _middle(turns), _BEYOND * noise_of(attitude)), np.arange(3)
        options = [
            (_middle(v - np.median(v, axis=0)), order, signs)
            for order in permutations(axes)
            for signs in product((1, -1), repeat=3)
            for v in (turns - whole[:, order] * signs,)
        ]
        if options[0][0] > most:
            least, order, signs = min(options, key=lambda option: option[0])
            signed = zip(order, signs, strict=True)
            named = ", ".join("-"[: sign < 0] + "xyz"[i] for i, sign in signed)
            yield name, other, named if least < most else ""

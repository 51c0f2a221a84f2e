"""What the sensors of a log read in a motion, and how far a log's own readings are from that.

Besides the motion, readings have their circumstances: what stands in a log of real life, such as a
clock that is late, a capture's world that is turned, a gyro's bias. Each is 0 unless it is freed.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robotball.errors import InputError, unknown
from robotball.fit.logs import Sensor
from robotball.motion import Motion
from robotball.robot.motors import DCMotor
from robotball.robot.scene import Scene
from robotball.rotations import Array, multiply, rotation_matrix, turn_between

Rows = NDArray[np.intp]


@dataclass(frozen=True)
class Circumstance:
    """A circumstance of a log.

    Attributes
    ----------
    count : int
        How many numbers it has.
    unit : str
        Their unit.
    plausible : float
        An amount that a carefully made log may have. If it is not freed, so much of it must not
        move a fitted number.
    """

    count: int
    unit: str
    plausible: float


_LATE = Circumstance(1, "s", 0.02)  # one frame of a camera at 50 Hz
_TURNING = Circumstance(3, "rad/s", 0.02)  # 1°/s, the zero-rate offset of a cheap gyro
_OF_ENCODERS = Circumstance(1, "rad", 0.02)  # 1°, a zero set by eye
_FACTOR = Circumstance(1, "1", 0.02)  # the error of an uncalibrated sensor's sensitivity
_CIRCUMSTANCES = {
    "sensors.clock": _LATE,
    "commands.delay": _LATE,
    "world.yaw": Circumstance(1, "rad", 0.035),  # 2°, axes set by eye
    "world.origin": Circumstance(2, "m", 0.01),
    "position.marker": Circumstance(3, "m", 0.005),
    "gyro.bias": _TURNING,
    "accelerometer.bias": Circumstance(3, "m/s²", 0.2),  # 20 mg, of a cheap accelerometer
    "accelerometer.place": Circumstance(3, "m", 0.01),
}
_CLOCK, _ZERO, _BIAS, _SCALE = ".clock", ".zero", ".bias", ".scale"
_AROUND = 1e-3  # s, on either side of a time: the difference by which an accelerometer is read
ON_THE_PLANE = 0.05  # of the radius: a height so near 0 is the contact point's
FEWEST = 7  # readings by which a sensor's noise is known
_VERTICAL = np.array([0.0, 0.0, 1.0])


def circumstances_of(sensors: Iterable[str]) -> dict[str, Circumstance]:
    """Return the circumstances of a log with such sensors by their names."""
    sensors = list(sensors)
    there = ("sensors", "world", "commands", *sensors)
    known = {name: what for name, what in _CIRCUMSTANCES.items() if name.split(".")[0] in there}
    known |= {each + _CLOCK: _LATE for each in sensors}
    known |= {each + _BIAS: _TURNING for each in sensors if each.endswith("_gyro")}
    known |= {each + _ZERO: _OF_ENCODERS for each in sensors if each.endswith("_angle")}
    known |= {each + _SCALE: _FACTOR for each in sensors if not each.endswith("attitude")}
    return known


def circumstance(name: str, sensors: Iterable[str]) -> Circumstance:
    """Return a circumstance of a log with such sensors. Raises InputError for an unknown name."""
    known = circumstances_of(sensors)
    if name not in known:
        raise unknown("circumstance of the log", name, known)
    return known[name]


def is_of_readings(name: str) -> bool:
    """Return whether a circumstance changes the readings alone, and not when they are taken."""
    return not name.endswith((_CLOCK, ".delay"))


def times_of(sensor: Sensor, given: Mapping[str, Array]) -> Array:
    """Return the times (n,) at which a motion is read for a sensor, or (3n,) for three around."""
    at = np.abs(_read_at(sensor, given))
    if sensor.name != "accelerometer":
        return at
    return np.concatenate([np.maximum(at - _AROUND, 0.0), at, at + _AROUND])


def _read_at(sensor: Sensor, given: Mapping[str, Array]) -> Array:
    """Return when (n,) a sensor took its readings, by the clock of the motion."""
    clocks = ("sensors" + _CLOCK, sensor.name + _CLOCK)
    return sensor.times - sum(float(given[each][0]) for each in clocks if each in given)


def apart(sensor: Sensor, motion: Motion, rows: Rows, given: Mapping[str, Array]) -> Array:
    """Return how far a sensor's readings are from a motion's (n, k); turns of an attitude.

    rows: of the motion at `times_of`. Raises InputError for a current of a motor whose stall
    current the scene does not give.
    """
    read = _readings(sensor, motion, rows, given)
    early = _read_at(sensor, given) < 0
    if early.any() and sensor.name != "accelerometer":
        # The motion before its start is unknown. Readings are continued there as odd functions.
        start = np.zeros_like(rows)
        read[early] = 2 * _readings(sensor, motion, start, given)[early] - read[early]
    read = read * (1.0 + given.get(sensor.name + _SCALE, np.zeros(1))[0])
    if sensor.name.endswith("attitude"):
        return turn_between(read, sensor.values)
    return np.asarray(sensor.values - read)


def _readings(sensor: Sensor, motion: Motion, rows: Rows, given: Mapping[str, Array]) -> Array:
    scene, name = motion.scene, sensor.name
    if name == "accelerometer":
        return _specific_force(motion, rows, given)
    if name == "position":
        return _position(sensor, motion, rows, given)
    if name.endswith("attitude"):
        attitude, _ = _carried(motion, rows, name.removesuffix("attitude"))
        yaw = given.get("world.yaw", np.zeros(1))[0]
        world = np.array([np.cos(yaw / 2), 0.0, 0.0, np.sin(yaw / 2)])
        return multiply(np.broadcast_to(world, (len(rows), 4)), attitude)
    bias = given.get(f"{name}{_BIAS}", 0.0)
    if name.endswith("gyro") and not (name == "shell_gyro" and scene.ball.has_frame):
        return _carried(motion, rows, name.removesuffix("gyro"))[1] + bias
    if name == "shell_gyro":
        axis, half = scene.ball.shell.axis, motion.hinge_angles[rows, :1] / 2
        # The frame is turned by its hinge's angle from the shell, whose axes the readings have.
        to_shell = rotation_matrix(np.concatenate([np.cos(half), np.sin(half) * axis], axis=1))
        return np.asarray(np.einsum("nij,nj->ni", to_shell, of_shell(motion)[rows])) + bias
    hinge, _, kind = name.rpartition("_")
    i = [each.name for each in scene.hinges].index(hinge)
    if kind == "angle":
        return motion.hinge_angles[rows, i : i + 1] + given.get(f"{name}{_ZERO}", 0.0)
    if kind == "rate":
        return motion.hinge_rates[rows, i : i + 1]
    torque = motion.loads.motor_torques[rows, i : i + 1]
    return torque if kind == "torque" else torque / _torque_constant(scene, i)


def of_shell(motion: Motion) -> Array:
    """Return the shell's angular velocity (n, 3), in the axes in which the motion has its own."""
    if not motion.scene.ball.has_frame:
        return motion.angular_velocity
    axis = motion.scene.ball.shell.axis
    return np.asarray(motion.angular_velocity - np.outer(motion.hinge_rates[:, 0], axis))


def _carried(motion: Motion, rows: Rows, name: str) -> tuple[Array, Array]:
    """Return a body's attitude (n, 4), and its angular velocity (n, 3) in its own axes.

    name: "" of the body whose attitude the motion has, or of a link with "_". A link's axes are
    those that the shell has where all joints are at 0.
    """
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


def _torque_constant(scene: Scene, i: int) -> float:
    """Return a motor's torque on its hinge per current [N m/A]."""
    motor = scene.hinges[i].motor
    if not isinstance(motor, DCMotor) or not motor.stall_current:
        raise InputError(
            f"{scene.hinges[i].name}_current: give the hinge a dc_motor with a stall_current, "
            "which says what torque a current is"
        )
    return motor.efficiency * motor.gear * motor.stall_torque / motor.stall_current


def _position(sensor: Sensor, motion: Motion, rows: Rows, given: Mapping[str, Array]) -> Array:
    scene, heights = motion.scene, sensor.values[:, 2:]
    marker = given.get("position.marker", np.zeros(3))
    radius = scene.ball.radius
    on_the_plane = len(heights[0]) and np.abs(heights).max() < ON_THE_PLANE * radius
    level = 0.0 if on_the_plane and not marker.any() else radius
    at = rotation_matrix(motion.attitude[rows]) @ marker + [0.0, 0.0, level]
    at[:, :2] += motion.contact_point[rows] + given.get("start.place", 0.0)
    if "world.yaw" in given:
        c, s = np.cos(given["world.yaw"][0]), np.sin(given["world.yaw"][0])
        at[:, :2] = at[:, :2] @ np.array([[c, s], [-s, c]])
    at[:, :2] += given.get("world.origin", 0.0)
    return at[:, : sensor.values.shape[1]]


def _specific_force(motion: Motion, rows: Rows, given: Mapping[str, Array]) -> Array:
    """Return what an accelerometer on the frame reads (n, 3), frame axes [m/s²].

    It is the acceleration of its place less that of gravity: a ball that lies still reads +g, up.
    """
    scene, (before, at, after) = motion.scene, rows.reshape(3, -1)
    to_world = rotation_matrix(motion.attitude)
    turning = np.einsum("nij,nj->ni", to_world, of_shell(motion))
    velocity = scene.ball.radius * np.cross(turning, _VERTICAL)
    gap = (motion.times[after] - motion.times[before])[:, None]
    centre = (velocity[after] - velocity[before]) / gap - scene.gravity_at(motion.times[at])
    omega = motion.angular_velocity
    alpha, omega = (omega[after] - omega[before]) / gap, omega[at]
    place = np.broadcast_to(given.get("accelerometer.place", np.zeros(3)), omega.shape)
    force = np.einsum("nji,nj->ni", to_world[at], centre) + np.cross(alpha, place)
    force += np.cross(omega, np.cross(omega, place))
    return np.asarray(force + given.get("accelerometer.bias", 0.0))


def noise_of(sensor: Sensor) -> float:
    """Return the noise of a sensor, one standard deviation, from its own readings.

    Each reading is held against the polynomial through three neighbours on either side; the median
    of what is left belongs to the noise, as long as readings follow one another faster than the
    motion changes. Of readings that are rounded coarsely it is that of the rounding.
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
    spread = float(np.sqrt((medians**2).mean())) / _MEDIAN  # as χ² takes all columns together
    steps = np.abs(np.diff(values, axis=0))
    least = float(steps[steps > 0].min()) if (steps > 0).any() else 0.0
    often = (steps == 0).mean() > _OFTEN
    return max(spread, least / np.sqrt(12)) if often else spread


def stands_still(sensors: Mapping[str, Sensor]) -> bool:
    """Return whether all readings of a log, some of place or attitude, are noise alone."""
    return bool({"position", "attitude"} & sensors.keys()) and all(
        np.sqrt(_plain(each).var(axis=0).mean()) <= _STILL * noise_of(each)
        for each in sensors.values()
    )


def _plain(sensor: Sensor) -> Array:
    turns = sensor.name.endswith("attitude")
    return turn_between(sensor.values[:1], sensor.values) if turns else sensor.values


def _middle(vectors: Array) -> float:
    return float(np.median(np.linalg.norm(vectors, axis=1)))


def contradictions(sensors: Mapping[str, Sensor]) -> Iterator[tuple[str, str]]:
    """Yield the gyros and attitudes of one body that no motion has both, whatever moves it.

    By the medians of what the attitude turns, and the gyro's integral, over spans of time in which
    the attitude turns well beyond its noise, but too little for its axis to matter.
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
        off = turns - (whole[span:] - whole[:-span])
        # A bias of the gyro is none: both are less their median.
        size, apart = (_middle(each - np.median(each, axis=0)) for each in (turns, off))
        if apart > max(_CONTRADICTS * size, _BEYOND * noise_of(attitude)):
            yield name, other


_STILL = 1.5  # of the noise, as it is estimated of few readings
_TURN = 0.3  # rad
_CONTRADICTS = 0.5  # of a turn: another sign is 2, degrees are 1, axes swapped up to 1.4
_BEYOND = 10.0  # of the attitude's noise
_MEDIAN = 0.6745  # of |x| of the normal distribution, in standard deviations
_OFTEN = 0.1  # of neighbours that are equal: readings are rounded coarsely

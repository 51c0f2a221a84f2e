"""Sensor models agree with finite differences of a moving ball's positions and attitudes."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import robotball as rb
from robotball.fit.sensing import apart, times_of
from robotball.motion import Motion
from robotball.robot.scene import Friction
from robotball.rotations import rotation_matrix, turn_between
from tests.robotball.theory.test_friction import sphere
from tests.robots import with_frame

STEP = 1e-3  # s, of differences
AT = np.arange(0.5, 1.5, 0.1)
PLACE = np.array([0.02, -0.05, 0.03])  # m
BIAS = np.array([0.3, -0.2, 0.1])


@cache
def moving(scene: str = "examples/my_robot.toml") -> Motion:
    """Return the motion of a robot that rolls, swings and steers, around the times of readings."""
    times = (AT[:, None] + [-STEP, 0.0, STEP]).ravel()
    return rb.integrate(scene, np.concatenate([[0.0], times]), 1e-13)


def point(m: Motion, place: np.ndarray) -> np.ndarray:
    """Return the position of a point of the frame (n, 3), world axes."""
    centre = np.pad(m.contact_point, ((0, 0), (0, 1)), constant_values=m.scene.ball.radius)
    return (centre + rotation_matrix(m.attitude) @ place)[1:]


def specific_force(m: Motion, place: np.ndarray) -> np.ndarray:
    """Return a point's acceleration minus gravity, frame axes, from second differences."""
    at = point(m, place)
    second = (at[0::3] - 2 * at[1::3] + at[2::3]) / STEP**2
    second += [0.0, 0.0, m.scene.gravity]
    return np.einsum("nji,nj->ni", rotation_matrix(m.attitude[1:][1::3]), second)


def turning(m: Motion) -> np.ndarray:
    """Return the frame's angular velocity, frame axes, from differences of its attitude."""
    q = m.attitude[1:]
    return turn_between(q[1::3], q[2::3]) / (2 * STEP) - turn_between(q[1::3], q[0::3]) / (2 * STEP)


def angle(m: Motion) -> np.ndarray:
    """Return the angle of the frame's hinge."""
    return m.hinge_angles[1:][1::3, :1]


Given = Mapping[str, np.ndarray]
READ: Mapping[str, tuple[str, Given, Callable[[Motion], np.ndarray]]] = {
    "an accelerometer": ("accelerometer", {}, lambda m: specific_force(m, np.zeros(3))),
    "an accelerometer beside the middle": (
        "accelerometer",
        {"accelerometer.place": PLACE},
        lambda m: specific_force(m, PLACE),
    ),
    "an accelerometer with a bias": (
        "accelerometer",
        {"accelerometer.place": PLACE, "accelerometer.bias": BIAS},
        lambda m: specific_force(m, PLACE) + BIAS,
    ),
    "a gyro": ("gyro", {}, turning),
    "a gyro with a bias": ("gyro", {"gyro.bias": BIAS}, lambda m: turning(m) + BIAS),
    "a gyro in other units": ("gyro", {"gyro.scale": np.array([56.0])}, lambda m: 57 * turning(m)),
    "a marker": ("position", {"position.marker": PLACE}, lambda m: point(m, PLACE)[1::3]),
    "a capture from another place": (
        "position",
        {"start.place": np.array([1.0, 2.0])},
        lambda m: point(m, np.zeros(3))[1::3, :2] + [1.0, 2.0],
    ),
    "an encoder's zero": (
        "frame_angle",
        {"frame_angle.zero": np.array([0.1])},
        lambda m: angle(m) + 0.1,
    ),
    "an encoder's direction": (
        "frame_angle",
        {"frame_angle.scale": np.array([-2.0])},
        lambda m: -angle(m),
    ),
}


@pytest.mark.parametrize("case", READ)
def test_a_sensor_reads_the_quantity_of_a_moving_ball(case: str) -> None:
    """To 2e-5 of the largest reading; a scale of 1.02 would be a thousand times that."""
    name, given, read = READ[case]
    m = moving()
    sensor = rb.Sensor(name, AT, read(m))
    rows = np.searchsorted(m.times, times_of(sensor, given) - STEP / 2)
    largest = np.abs(sensor.values).max()
    # Measured at most 1.6e-6, for the gyro, from differences over 1 ms.
    assert np.abs(apart(sensor, m, rows, given)).max() < 2e-5 * largest
    wrong = rb.Sensor(name, AT, 1.02 * sensor.values)
    assert np.abs(apart(wrong, m, rows, given)).max() > 0.01 * largest


@pytest.mark.parametrize("clock", ["sensors.clock", "gyro.clock"])
def test_a_late_clock_reads_the_earlier_motion(clock: str) -> None:
    """A reading at t shows the motion at t minus the delay."""
    m = moving()
    sensor = rb.Sensor("gyro", AT + 0.02, m.angular_velocity[1:][1::3])
    circumstances = {clock: np.array([0.02])}
    assert np.abs(times_of(sensor, circumstances) - AT).max() < 1e-12
    rows = np.searchsorted(m.times, AT - STEP / 2)
    assert not apart(sensor, m, rows, circumstances).any()


@pytest.mark.parametrize("name", ["position", "attitude", "gyro"])
def test_a_reading_before_the_start_extrapolates_the_motion(name: str) -> None:
    """Compared with a ball without drives that is started 10 ms earlier."""
    late, scene = 0.01, rb.load_scene("chaplygin_ball")
    whole = rb.integrate(scene, np.array([0.0, late]), 1e-13)
    later = rb.Start(whole.attitude[1], whole.momentum[1])
    again = rb.integrate(replace(scene, start=later), np.array([0.0, late]), 1e-13)
    of = {
        "position": whole.contact_point,
        "attitude": whole.attitude,
        "gyro": whole.angular_velocity,
    }
    sensor = rb.Sensor(name, np.zeros(1), of[name][:1])
    circumstances = {"sensors.clock": np.array([late]), "start.place": whole.contact_point[1]}
    off = np.abs(apart(sensor, again, np.array([1]), circumstances)).max()
    at_the_start = np.abs(
        apart(sensor, again, np.array([0]), {"start.place": circumstances["start.place"]})
    )
    # Measured 0.014 to 0.017, from the second derivative.
    assert off < 0.05 * at_the_start.max()


def test_an_accelerometer_feels_the_friction_of_a_sliding_ball() -> None:
    """At the centre of a balanced ball it reads the plane's force over the mass."""
    at = np.linspace(0.1, 0.2, 6)
    sensor = rb.Sensor("accelerometer", at, np.zeros((6, 3)))
    times = times_of(sensor, {})
    scene = with_frame(sphere((2.0, 0.0), (0.0, 0.0, 3.0), Friction(0.3)))
    m = rb.integrate(scene, np.unique([0.0, *times]))
    assert m.slip is not None
    rows = np.searchsorted(m.times, times)
    force = np.einsum("nji,nj->ni", rotation_matrix(m.attitude), m.loads.contact_force)
    # Measured 6e-6 m/s² of 9.8, from differences over 1 ms; without the slip it was off by 10.
    read = -apart(sensor, m, rows, {})
    assert np.abs(read - force[rows[6:12]] / m.scene.ball.mass).max() < 1e-4


def test_an_accelerometer_feels_a_turntable() -> None:
    """Measured 3e-6 m/s²; without the velocity of the plane it is off by 0.4."""
    m = moving("turntable")
    sensor = rb.Sensor("accelerometer", AT, specific_force(m, PLACE))
    given = {"accelerometer.place": PLACE}
    rows = np.searchsorted(m.times, times_of(sensor, given) - STEP / 2)
    off = apart(sensor, m, rows, given)
    assert np.abs(off).max() < 1e-5

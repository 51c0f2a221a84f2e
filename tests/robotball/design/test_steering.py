"""Drives that roll a robot along a path are found and verified, or refused."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import robotball as rb
from robotball.design import steering
from robotball.design.steering import (
    WantedPath,
    _Way,
    circle,
    eight,
    shortfalls,
    steer,
    straight,
    through,
)
from robotball.robot.formulas import ROLLING_MODELS, Rolling
from robotball.robot.motors import PositionServo, Servo
from robotball.robot.scene import Friction, Start
from robotball.rotations import Array, rotation_matrix
from tests.messages import naming, unnamed
from tests.robots import kinetic_energy, pendulum_ball, robot

CORNERS = through([(1.0, 0.0), (1.0, 1.0), (0.0, 1.0)])
PATHS = [straight(2.0), circle(0.5), circle(0.5, -0.5), eight(3.0), CORNERS]


@pytest.mark.parametrize("path", PATHS, ids=lambda path: path.name)
def test_paths_start_at_the_origin_and_slope_is_their_derivative(path: WantedPath) -> None:
    """Measured 4e-9 of the length: the error of the finite difference."""
    assert path.point(0.0) == pytest.approx([0.0, 0.0], abs=1e-15)
    h = 1e-5
    for u in np.linspace(0.05, 0.95, 7).tolist():
        difference = (path.point(u + h) - path.point(u - h)) / (2 * h)
        assert path.slope(u) == pytest.approx(difference, abs=2e-8 * path.length)


def test_paths_have_the_requested_size_and_waypoints() -> None:
    """2 m straight; circumference and side of a circle; size of an eight; waypoints are met."""
    line, left, right, figure, _ = PATHS
    assert (line.length, left.length) == pytest.approx((2.0, np.pi), rel=1e-5)
    for path, u, place in (
        (left, 0.25, (0.5, 0.5)),
        (right, 0.5, (0.5, -0.5)),
        (figure, 0.25, (3.0, 0.0)),
        (figure, 0.125, (3.0 * np.sqrt(0.5), 1.5)),
        (CORNERS, 1 / 3, (1.0, 0.0)),
        (CORNERS, 2 / 3, (1.0, 1.0)),
        (CORNERS, 1.0, (0.0, 1.0)),
    ):
        assert path.point(u) == pytest.approx(place)


def pendulum_robot() -> rb.Scene:
    """Return the pendulum robot at rest, both hinges with servos."""
    motors = (Servo(0.5, torque_limit=0.6), PositionServo(6.0, 0.3, torque_limit=0.7))
    return robot("pendulum", pendulum_ball(), "rubber", [0.0, 0.0], (1, 0, 0, 0), motors=motors)


def three_rotors() -> rb.Scene:
    return rb.load_scene("three_rotors")


def off(steered: Any) -> float:
    """Return how far the contact point leaves the path when the equations run the drives [m]."""
    motion = rb.integrate(steered.scene, steered.times, 1e-8)
    return float(np.linalg.norm(motion.contact_point - steered.wanted, axis=1).max())


@pytest.mark.parametrize(
    ("make", "rolling", "size", "duration"),
    [(three_rotors, "rubber", 0.2, 1.0), (pendulum_robot, "classical", 0.1, 4.0)],
)
def test_a_steered_ball_follows_an_arc(
    make: Callable[[], rb.Scene], rolling: Rolling, size: float, duration: float
) -> None:
    """With rotors, or with a frame and a hanging pendulum.

    Measured 5e-5 m: sampling of the drives, and the tolerance of the boundary-value problem.
    """
    steered = steer(replace(make(), rolling=rolling), circle(size, 0.25), duration)
    assert off(steered) < 1.5e-4
    assert steered.wanted[-1] == pytest.approx([size, size])


def test_weights_start_hanging_for_any_attitude_of_the_shell() -> None:
    """Below the centre, also if the shell is rotated by 0.4 rad about the frame's hinge.

    This fast path has a larger error: measured 6.2e-4 m, from sampling the drives.
    """
    robot, angles, attitudes = pendulum_robot(), [], []
    axis, tilt = robot.ball.shell.axis, 0.4
    for turn in (0.0, tilt):
        start = Start(np.array([np.cos(turn / 2), *(np.sin(turn / 2) * axis)]), np.zeros(3))
        steered = steer(replace(robot, start=start), straight(0.1), 2.0)
        assert off(steered) < 2e-3
        first = steered.scene.start
        at = np.array([hinge.angle for hinge in steered.scene.hinges])
        angles.append(at)
        attitudes.append(first.attitude)
        to_world, still = rotation_matrix(first.attitude), np.zeros((1, 3))
        states = robot.robot.states(to_world[2:], at[None], still, still[:, :2])
        centre = to_world @ states.centre_of_mass[0]
        assert np.abs(centre[:2]).max() < 1e-8  # measured 1.2e-9 m, like the angles below
        assert centre[2] < -0.01
    # Measured 2e-8 rad: the accuracy of the balance.
    assert angles[0] - angles[1] == pytest.approx([tilt, 0.0], abs=1e-6)
    assert attitudes[0] == pytest.approx(attitudes[1], abs=1e-6)


WEIGHT, BALL = pendulum_robot(), three_rotors().ball
IN_LINE = BALL.with_hinges(
    body=(BALL.frame, *(replace(r, axis=BALL.shell.axis) for r in BALL.rotors))
)
REFUSED: dict[str, Callable[[], object]] = {
    "line length": lambda: straight(-1.0),
    "circle turns 0": lambda: circle(0.5, 0.0),
    "waypoint~1": lambda: through([(0.0, 0.0)]),
    "inhomogeneous": lambda: through([(1.0, 0.0, 2.0)]),
    "hinges 1 two": lambda: steer(
        WEIGHT.with_hinges(motor={"pendulum1": None}), straight(1.0), 5.0
    ),
    "rolling~friction": lambda: steer(
        replace(WEIGHT, friction=Friction(rolling=0.001)), straight(1.0), 5.0
    ),
    "t~= hinges direction": lambda: steer(
        replace(three_rotors(), ball=IN_LINE), straight(0.01), 0.5
    ),
    "t~= hinge rad/s duration": lambda: steer(three_rotors(), straight(0.01), 0.2),
    "drives path": lambda: steer(WEIGHT, circle(0.5), 1.0),
}


@pytest.mark.parametrize("facts", REFUSED)
def test_paths_that_cannot_be_followed_are_refused(
    facts: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The message names the value."""
    monkeypatch.setattr(steering, "_MOST_NODES", 30)
    monkeypatch.setattr(steering, "_FASTEST", 1.0)
    with pytest.raises((rb.InputError, ValueError), match=naming(facts)):
        REFUSED[facts]()


def test_each_exceeded_limit_of_robot_and_plane_is_reported() -> None:
    """One line each for torque, rate and friction."""
    scene, times = pendulum_robot(), np.linspace(0.0, 1.0, 11)
    ramp = rb.Ramp(final=-1.0, end=1.0, shape="smooth")
    hard = scene.with_hinges(motor=(None, None), command={"frame": ramp})
    motion = rb.integrate(hard, times, 1e-9)
    assert shortfalls(scene, motion) == []
    weak = replace(
        scene.with_hinges(motor={"frame": Servo(0.5, torque_limit=0.01)}),
        friction=Friction(sliding=0.01, torsional=0.001),
    )
    spun = replace(motion, loads=replace(motion.loads, spin_torque=np.full(11, 0.1)))  # N m
    lines = shortfalls(weak, spun, rate_limit=0.5)
    assert [line.split(" ")[0] for line in lines[:2]] == ["frame", "frame"]
    facts = ("motor 0.01~N~m", "0.5", "slips", "0.001~m")
    assert [unnamed(*pair) for pair in zip(facts, lines, strict=True)] == [[]] * 4
    enough = replace(scene, friction=Friction(sliding=10.0, torsional=10.0))
    assert shortfalls(enough, spun, rate_limit=10.0) == []


@pytest.mark.parametrize("rolling", ROLLING_MODELS)
@pytest.mark.parametrize("make", [pendulum_robot, three_rotors])
def test_hinge_rates_give_the_momentum_and_roll_the_shell_as_wanted(
    make: Callable[[], rb.Scene], rolling: Rolling
) -> None:
    """In any state, M computed from the bodies' motions is the state's M.

    The rates, and the shell's spin, have the least energy Σ J φ̇²/2, so J φ̇ is a combination of the
    equations' rows. Measured 1e-14 kg m²/s: rounding.
    """
    rng, scene = np.random.default_rng(4), replace(make(), rolling=rolling)
    path, times = circle(0.5), np.linspace(1.0, 4.0, 20)
    way = _Way(scene, path, 5.0, np.array([True] * len(scene.hinges)))
    y = rng.normal(size=(len(way.start()), 20))
    y[:4] /= np.linalg.norm(y[:4], axis=0)
    y[6] *= rolling == "classical"
    rates, axes = way.rates(times, y)[0], rotation_matrix(y[:4].T)
    readings = way._run(y, rates)[1]
    turning = np.column_stack([readings.rolling[:, :2], readings.slip[:, 2]])
    shell, gamma = np.einsum("ni,nij->nj", turning, axes), axes[:, 2]

    def of(shell: Array, rates: Array) -> tuple[Array, Array]:
        """Return twice the kinetic energy (20,) and M (20, 3), world axes."""
        omega = shell + np.outer(rates[:, 0], scene.ball.shell.axis)
        states = scene.robot.states(gamma, y[7:].T, omega, rates)
        M = np.einsum("nij,nj->ni", axes, states.momentum(rolling))
        return 2 * kinetic_energy(states), M

    assert np.abs(of(shell, rates)[1] - y[4:7].T).max() < 1e-13
    velocity = scene.ball.radius * np.column_stack([turning[:, 1], -turning[:, 0]])
    h = 1e-4
    wanted = (way.point(times + h) - way.point(times - h)) / (2 * h)
    assert np.abs(velocity - wanted).max() < 1e-7  # measured 1.6e-8, the difference's
    units = [(0 * shell, np.tile(alone, (20, 1))) for alone in np.eye(len(scene.hinges))]
    if rolling == "classical":
        units.append((gamma, 0 * rates))
        rates = np.column_stack([rates, turning[:, 2]])
    J, of_M = (
        np.stack(parts, axis=1) for parts in zip(*(of(*unit) for unit in units), strict=True)
    )
    multipliers = np.linalg.pinv(of_M) @ (J * rates)[:, :, None]
    assert np.abs(of_M @ multipliers - (J * rates)[:, :, None]).max() < 1e-11


def test_the_ball_waits_before_and_after_the_path() -> None:
    """A twentieth of the duration each."""
    way = _Way(pendulum_robot(), straight(2.0), 10.0, np.array([True, True]))
    x = way.point(np.array([0.0, 0.5, 0.6, 5.0, 9.4, 9.5, 10.0]))[:, 0]
    assert x[[0, 1, 3, 5, 6]].tolist() == [0.0, 0.0, 1.0, 2.0, 2.0]
    assert 0 < x[2] < 0.01
    assert 1.99 < x[4] < 2


def test_the_rate_of_a_diverged_state_is_nan() -> None:
    """Only at that time; there the square of the quaternion is infinite."""
    scene = pendulum_robot()
    way = _Way(scene, circle(0.5), 5.0, np.array([True, True]))
    y = np.tile(way.start()[:, None], 3)
    y[:4, 1] = 1e200
    assert np.isnan(way.rate(np.full(3, 1.0), y)).all(axis=0).tolist() == [False, True, False]

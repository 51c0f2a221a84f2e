"""Drives that roll a robot along a path: found, checked by the equations, or refused."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import robotball as rb
from robotball.equations import Rolling
from robotball.motors import PositionServo, Servo
from robotball.scene import Friction, Start
from robotball.steering import WantedPath, Way, circle, eight, shortfalls, steer, straight, through
from tests.robots import pendulum_ball, robot

PATHS = [
    straight(2.0),
    circle(0.5),
    circle(0.5, -0.5),
    eight(1.0),
    through([(1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]),
]


@pytest.mark.parametrize("path", PATHS, ids=lambda path: path.name)
def test_paths_begin_at_the_origin_and_have_their_slopes(path: WantedPath) -> None:
    """The slope is the point's derivative: measured 4e-9 of the length, the difference's error."""
    assert path.point(0.0) == pytest.approx([0.0, 0.0], abs=1e-15)
    h = 1e-5
    for u in (0.1, 0.37, 0.8):
        difference = (path.point(u + h) - path.point(u - h)) / (2 * h)
        assert np.abs(path.slope(u) - difference).max() < 2e-8 * path.length
    assert (path.slope(0.0)[0] > 0) or path.name == "waypoints"


def test_lengths_are_known() -> None:
    """2 m straight, a circle's circumference, and waypoints are met."""
    assert straight(2.0).length == pytest.approx(2.0)
    assert circle(0.5, 2.0).length == pytest.approx(2 * np.pi, rel=1e-5)
    way = through([(1.0, 0.0), (1.0, 1.0)])
    assert way.point(1.0) == pytest.approx([1.0, 1.0])
    assert way.point(0.5) == pytest.approx([1.0, 0.0])


def pendulum_robot() -> rb.Scene:
    """W4's robot from rest, both hinges with servos."""
    motors = (Servo(0.5, torque_limit=0.6), PositionServo(6.0, 0.3, torque_limit=0.7))
    return robot("pendulum", pendulum_ball(), "rubber", [0.0, 0.0], (1, 0, 0, 0), motors=motors)


def off(scene: rb.Scene, path: WantedPath, duration: float) -> float:
    """How far the equations' motion is from the path [m]."""
    steered = steer(scene, path, duration)
    theory = rb.integrate(steered.scene, steered.times, 1e-9)
    return float(np.linalg.norm(theory.contact_point - steered.wanted, axis=1).max())


@pytest.mark.slow
def test_rotors_roll_a_ball_along_a_circle() -> None:
    """Three rotors; measured 8e-5 m: the samples of the drives, 0.04 s apart."""
    assert off(rb.load_scene("three_rotors"), circle(0.3), 4.0) < 2e-4


@pytest.mark.slow
@pytest.mark.parametrize("path", [straight(0.5), circle(0.7, 0.25)], ids=lambda path: path.name)
def test_weights_roll_a_ball_along(path: WantedPath) -> None:
    """A frame and a pendulum that hang; measured 3e-5 m: the tolerance of the boundary problem."""
    assert off(pendulum_robot(), path, 5.0) < 2e-4


def test_weights_begin_where_they_hang_however_the_shell_lies() -> None:
    """A shell turned by 0.4 rad about the frame's hinge: the same frame in space, and path."""
    robot, angles, attitudes = pendulum_robot(), [], []
    axis, tilt = robot.ball.shell.axis, 0.4
    for turn in (0.0, tilt):
        start = Start(np.array([np.cos(turn / 2), *(np.sin(turn / 2) * axis)]), np.zeros(3))
        steered = steer(replace(robot, start=start), straight(0.1), 2.0)
        first = steered.scene.start
        assert first.hinge_angles is not None
        angles.append(first.hinge_angles)
        attitudes.append(first.attitude)
        theory = rb.integrate(steered.scene, steered.times, 1e-9)
        off_path = np.linalg.norm(theory.contact_point - steered.wanted, axis=1).max()
        assert off_path < 2e-3  # measured 6.2e-4 m: the samples of the drives, 0.04 s apart
    # Measured 2e-8 rad: the balance that is found.
    assert angles[0] - angles[1] == pytest.approx([tilt, 0.0], abs=1e-6)
    assert attitudes[0] == pytest.approx(attitudes[1], abs=1e-6)


def steered(**changes: Any) -> object:
    return steer(replace(pendulum_robot(), **changes), straight(1.0), 5.0)


@pytest.mark.parametrize(
    ("do", "words"),
    [
        (lambda: straight(-1.0), "the line's length must be positive"),
        (lambda: circle(0.5, 0.0), "the circle's turns must not be 0"),
        (lambda: through([(0.0, 0.0)]), "waypoint 1 is where the path is already"),
        (lambda: through([(1.0, 0.0, 2.0)]), "waypoints are pairs|inhomogeneous"),
        (
            lambda: steered(motors=(pendulum_robot().motors[0], None)),
            "1 hinges are driven; to roll anywhere takes two",
        ),
        (lambda: steered(friction=Friction(rolling=0.001)), "the plane resists rolling"),
    ],
)
def test_what_cannot_be_steered_is_refused(do: Callable[[], object], words: str) -> None:
    """One line with the value."""
    with pytest.raises((rb.InputError, ValueError), match=words):
        do()


def test_what_is_lacking_is_told() -> None:
    """A torque, a rate and friction beyond what there is, a line each."""
    scene, times = pendulum_robot(), np.linspace(0.0, 1.0, 11)
    hard = replace(scene, motors=(), frame_rate=rb.Ramp(final=-1.0, end=1.0, shape="smooth"))
    motion = rb.integrate(hard, times, 1e-9)
    assert shortfalls(scene, motion) == []
    weak = replace(
        scene,
        motors=(Servo(0.5, torque_limit=0.01), scene.motors[1]),
        friction=Friction(sliding=0.01, torsional=0.001),
    )
    spun = replace(motion, loads=replace(motion.loads, spin_torque=np.full(11, 0.1)))  # N m
    lines = shortfalls(weak, spun, rate_limit=0.5)
    assert [line.split(" ")[0] for line in lines] == ["frame", "frame", "it", "it"]
    assert "its motor gives 0.01 N m" in lines[0]
    assert "of at most 0.5" in lines[1]
    assert "it slips" in lines[2]
    assert "m, of 0.001 m" in lines[3]
    enough = replace(scene, friction=Friction(sliding=10.0, torsional=10.0))
    assert shortfalls(enough, spun, rate_limit=10.0) == []


@pytest.mark.slow
def test_a_trial_that_overflows_is_rejected() -> None:
    """The solver meets quaternions of 1e200 on the way, and ends without drives in one line."""
    scene = rb.load_scene("examples/my_robot.toml")
    with pytest.raises(rb.InputError, match="no drives are found that roll it along this path"):
        steer(scene, circle(0.5), 5.0)


@pytest.mark.parametrize("rolling", ["rubber", "classical"])
@pytest.mark.parametrize("make", [pendulum_robot, lambda: rb.load_scene("three_rotors")])
def test_the_hinges_turn_so_that_the_ball_has_its_momentum_and_its_way(
    make: Callable[[], rb.Scene], rolling: Rolling
) -> None:
    """Of any state: M by the bodies' motions is the state's, and the shell rolls as is wanted.

    Measured 5e-15 kg m²/s: rounding.
    """
    rng, scene = np.random.default_rng(4), replace(make(), rolling=rolling)
    path, times = circle(0.5), np.linspace(1.0, 4.0, 20)
    way = Way(scene, path, 5.0, np.array([True] * len(scene.hinges)))
    y = rng.normal(size=(len(way.start()), 20))
    y[:4] /= np.linalg.norm(y[:4], axis=0)
    y[6] *= rolling == "classical"
    moves = way.moves(times, y)
    shell, rates = moves.u[:3].T, moves.u[3:].T
    omega = shell + np.outer(rates[:, 0], scene.ball.shell.axis)
    states = scene.robot.states(moves.gamma, y[7:].T, omega, rates)
    M = np.einsum("nij,nj->ni", moves.axes, states.momentum(rolling))
    assert np.abs(M - y[4:7].T).max() < 1e-13
    turning = np.einsum("nij,nj->ni", moves.axes, shell)
    velocity = scene.ball.radius * np.column_stack([turning[:, 1], -turning[:, 0]])
    h = 1e-4
    wanted = (way.point(times + h) - way.point(times - h)) / (2 * h)
    assert np.abs(velocity - wanted).max() < 1e-7  # measured 1.6e-8, the difference's


def test_a_state_astray_has_no_rate() -> None:
    """NaN at that time alone, where the square of the quaternion is infinite."""
    scene = pendulum_robot()
    way = Way(scene, circle(0.5), 5.0, np.array([True, True]))
    y = np.tile(way.start()[:, None], 3)
    y[:4, 1] = 1e200
    assert np.isnan(way.rate(np.full(3, 1.0), y)).all(axis=0).tolist() == [False, True, False]

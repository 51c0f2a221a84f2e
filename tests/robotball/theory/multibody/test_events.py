"""Events that end a smooth piece of a motion: the shell stops or lifts off."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from robotball import InputError, Scene, integrate
from robotball.fit.scene_numbers import numbers_of
from robotball.robot.ball import Ball, Frame, Hinge, Shell
from robotball.robot.drives import Sine
from robotball.robot.motors import Servo
from robotball.robot.scene import Friction
from robotball.theory.multibody.integration import integrate_together
from tests.messages import naming
from tests.robots import Y, energy, robot, worked

pytestmark = pytest.mark.core

RADIUS, MASS, MOMENT = 0.3, 2.0, 0.09
RESISTANCE, G = 0.004, 9.81
STOPPING = RESISTANCE * MASS * G / (MOMENT + MASS * RADIUS**2)  # rad/s²
TIMES = np.linspace(0.0, 10.0, 101)


def round_ball(rolling: Any, omega: Any, **more: Any) -> Scene:
    """A ball with isotropic inertia on a plane with resistance to rolling."""
    ball = Ball(Shell(RADIUS, 1.0, 0.05, 0.05, Y), (Hinge(Frame(1.0, 0.04 * np.eye(3))),))
    friction = Friction(rolling=RESISTANCE)
    attitude = (1.0, 0.3, 0.2, -0.1)
    return robot("round", ball, rolling, [0.0], attitude, omega, friction=friction, **more)


@pytest.mark.parametrize("rolling", ["rubber", "classical"])
def test_resistance_decelerates_a_ball_uniformly_to_rest(rolling: Any) -> None:
    """It stops after a distance a ω₀²/2α; a classical ball keeps spinning about the vertical.

    Measured 6e-15 m, 1.3e-14 rad/s, and a horizontal M of 1e-19 kg m²/s after the stop.
    """
    motion = integrate(round_ball(rolling, (1.0, -0.5, 0.3)), TIMES)
    shell = motion.angular_velocity
    up = (shell * motion.gamma).sum(axis=1)
    level = np.linalg.norm(shell - up[:, None] * motion.gamma, axis=1)
    assert 1 < level[0] / STOPPING < 9  # s
    assert level == pytest.approx(np.maximum(level[0] - STOPPING * TIMES, 0.0), abs=1e-13)
    way = RADIUS * level[0] ** 2 / 2 / STOPPING
    assert np.linalg.norm(motion.contact_point[-1]) == pytest.approx(way, abs=1e-12)
    assert up == pytest.approx(np.full(101, up[0]), abs=1e-12)
    assert motion.rolling_loss is not None
    assert np.ptp(energy(motion) + motion.rolling_loss) < 1e-12
    assert (abs(up[0]) > 0.1) == (rolling == "classical")
    assert np.abs(motion.momentum[-1, :2]).max() < 1e-15


@pytest.mark.parametrize("slope", [0.9, 1.2])
def test_a_ball_starts_to_roll_on_a_slope_steeper_than_its_resistance(slope: float) -> None:
    """From rest it stays put below tan(slope) = resistance/radius, and rolls above.

    Measured 6e-14 m.
    """
    tangent = slope * RESISTANCE / RADIUS
    down = np.array([tangent, 0.0, -1.0]) / np.hypot(1.0, tangent)
    motion = integrate(round_ball("rubber", (0.0, 0.0, 0.0), gravity_direction=tuple(down)), TIMES)
    pull = MASS * G * (RADIUS * down[0] + RESISTANCE * down[2])
    acceleration = max(pull, 0.0) * RADIUS / (MOMENT + MASS * RADIUS**2)
    way = np.outer(acceleration * TIMES**2 / 2, [1.0, 0.0])
    assert np.abs(motion.contact_point - way).max() < 1e-12


def test_the_energy_loss_is_the_work_of_the_resistance() -> None:
    """W4 on a plane with resistance to rolling, alternately at rest and rolling.

    Measured 1.2e-14 J, of 5 J lost.
    """
    scene = replace(worked("W4"), friction=Friction(rolling=0.005))
    motion = integrate(scene, TIMES[:51])
    assert motion.motor_work is not None
    assert motion.rolling_loss is not None
    kept = energy(motion) - motion.motor_work.sum(axis=1) + motion.rolling_loss
    assert np.ptp(kept) < 1e-13
    assert motion.rolling_loss[-1] > 0.1
    assert (np.diff(motion.rolling_loss) >= -1e-15).all()


def test_a_held_ball_that_starts_to_roll_does_not_make_the_equations_stiff() -> None:
    """The ball is held at rest until a frame that swings faster and faster moves it.

    Measured 1e-17 m while held, and 5e-5 m at 1.3 s. Without an event for rest, 20000 steps reach
    only 1.162 s.
    """
    swinging = Sine(amplitude=20.0, frequency=0.3)
    ball = Ball(Shell(0.2, 1.5, 0.03, 0.03, Y), (Hinge(Frame(0.5, 0.002 * np.eye(3))),))
    scene = robot(
        "swinging",
        ball,
        "classical",
        [swinging],
        (1.0, 0.3, 0.2, 0.1),
        gravity_direction=(np.sin(0.01), 0.0, -np.cos(0.01)),
        friction=Friction(rolling=0.004),
    )
    motion = integrate(scene, np.array([0.0, 1.1, 1.3]), max_steps=20_000)
    assert np.abs(motion.contact_point[1]).max() < 1e-15
    assert np.linalg.norm(motion.contact_point[2]) > 1e-5


def test_lift_off_and_stiff_motors_are_refused() -> None:
    """Lift-off ends the motion at F_z = 0; motors with a rate of 1.2e7 1/s never start."""
    with pytest.raises(InputError, match=naming("plane 0.…~s")):
        integrate(worked("W2").with_hinges(command=[-40.0]))
    ball = Ball(Shell(0.2, 1.0, 0.03, 0.03, Y), (Hinge(Frame(0.5, 4e-5 * np.eye(3))),))
    stiff, soft = (
        robot("stiff", ball, "rubber", [1.0], (1.0, 0.2, 0.1, 0.0), motors=(Servo(gain),))
        for gain in (500.0, 0.5)
    )
    with pytest.raises(InputError, match=naming("1.25e+07~1/s 10~s")):
        integrate(stiff)
    assert np.isfinite(integrate(soft, np.array([0.0, 0.01])).contact_point).all()


@pytest.mark.parametrize("name", ["frame.kv", "frame.torque_limit", "friction.rolling"])
def test_motions_integrated_together_differ_smoothly_across_events(name: str) -> None:
    """Their difference is the derivative, through rest, release and a torque limit."""
    numbers = numbers_of("pendulum_robot")
    values = {"frame.kv": 0.4, "frame.torque_limit": 0.15, "friction.rolling": 2e-3}
    times, small = np.linspace(0.0, 3.0, 31), 1e-6

    def scene(off: float) -> Scene:
        return numbers.scene({**values, name: values[name] * (1 + off)})

    both = [integrate(scene(off), times, 1e-12).contact_point for off in (1e-4, -1e-4)]
    slope = (both[0] - both[1]) / 2e-4
    first, second = integrate_together([scene(0.0), scene(small)], times, 1e-7)
    error = (second.contact_point - first.contact_point) / small - slope
    # Measured 1.5e-4: error of the steps. Integrated separately, the error for kv would be 0.3.
    assert np.abs(error).max() < 1e-3 * np.abs(slope).max()

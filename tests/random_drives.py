"""Random scenes with drives that are zero, delayed, constant, sampled or of zero amplitude."""

from dataclasses import replace

import numpy as np

from robotball.robot.ball import Rotor
from robotball.robot.drives import Ramp, Rate, Samples, Sine
from robotball.robot.motors import Motor, PositionServo, Servo, Torque
from robotball.robot.scene import Scene, Start
from tests.random_balls import ball_of_points
from tests.random_robots import MODELS, random_robot
from tests.robots import turning

DURATION = 0.5  # s
_SEED = 20260301


def random_drive(rng: np.random.Generator, size: float) -> Rate:
    """Return a drive that may be zero for a part of the run or all of it."""
    value = size * rng.uniform(0.2, 1.0) * rng.choice([-1, 1])
    start = rng.uniform(0.5, 0.9) * DURATION
    kinds: list[Rate] = [
        0.0,
        value,
        Ramp(final=value, start=start, end=start + rng.uniform(0.1, 0.5), shape="smooth"),
        Ramp(final=value, start=1.1 * DURATION, end=1.2 * DURATION),
        Samples(times=(0.0, start, 2 * DURATION), values=(0.0, 0.0, 0.0)),
        Samples(times=(0.0, start, 2 * DURATION), values=(0.0, 0.5 * value, value)),
        Sine(amplitude=0.0, frequency=1.0),
        Sine(amplitude=0.0, frequency=2.0, mean=value),
    ]
    return kinds[rng.integers(len(kinds))]


def random_drives(number: int) -> Scene:
    """Return a balanced ball with prescribed rates, or a robot with or without motors.

    It starts at rest or rolling, in either model.
    """
    rng = np.random.default_rng([_SEED, number])
    if number % 3 == 0:
        scene = ball_of_points(number // 3)
        rates = [hinge.rate for hinge in scene.hinges]
        drives = tuple(random_drive(rng, abs(rate)) for rate in rates)
        scene = replace(scene, duration=DURATION, ball=scene.ball.with_hinges(command=drives))
    else:
        scene = _robot(rng)
    omega = np.zeros(3) if rng.integers(2) else rng.normal(size=3)
    return turning(replace(scene, name=f"drives {number}"), omega)


def _robot(rng: np.random.Generator) -> Scene:
    """Return a robot with up to one rotor and one pendulum, at any initial angles."""
    ball = random_robot(rng, int(rng.integers(2)), int(rng.integers(2)))
    inertia = 0.05 * ball.radius**2
    motors: list[Motor | None] = []
    drives: list[Rate] = []
    for hinge in ball.hinges:
        moment = hinge.body.axial_inertia if isinstance(hinge.body, Rotor) else inertia
        kinds: list[Motor | None] = [
            None,
            None,
            Servo(20 * moment),
            Servo(20 * moment, 5 * moment),
            PositionServo(50 * moment, 5 * moment),
            Torque(0.1 * moment),
        ]
        motor = kinds[rng.integers(len(kinds))]
        motors.append(motor)
        drives.append(random_drive(rng, moment if isinstance(motor, Torque) else 1.0))
    angles = rng.uniform(-1, 1, len(ball.hinges)) * rng.integers(2, size=len(ball.hinges))
    attitude = rng.normal(size=4)
    return Scene(
        name="robot",
        title="",
        source="",
        duration=DURATION,
        ball=ball.with_hinges(command=tuple(drives), motor=tuple(motors), angle=tuple(angles)),
        rolling=MODELS[rng.integers(2)],
        start=Start(attitude / np.linalg.norm(attitude), np.zeros(3)),
    )

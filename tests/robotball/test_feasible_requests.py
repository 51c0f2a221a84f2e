"""Whatever numbers real bodies have, bodies with these numbers are found."""

import math
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from robotball import Limits, design
from tests.random_balls import RandomBall, random_ball, ring_ball
from tests.robotball.designs import check_bodies, error


def request_of(rng: np.random.Generator, real: RandomBall) -> tuple[float | None, Limits]:
    """A mass or none, and limits that the ball `real` keeps by 1 %, or none but its shell."""
    ball, rates = real.ball, np.abs(real.rotor_rates)
    mass = None if rng.integers(2) else ball.mass
    limits = Limits(buildable=True, shell_thickness=real.thickness)
    if rng.integers(2):
        return mass, limits
    return mass, replace(
        limits,
        rotor_speed=1.01 * float(rates.max()) if len(rates) else math.inf,
        frame_radius=real.frame_radius,
        rotor_radius=real.rotor_radius,
        shell_mass=0.99 * ball.shell.mass,
        frame_mass=0.99 * ball.frame.mass,
        rotor_mass=0.99 * ball.rotors[0].mass if len(rates) == 1 else 0.0,
    )


@pytest.mark.slow
def test_a_thousand_random_feasible_requests_are_all_solved() -> None:
    """Each asks for the numbers of a ball made of points and rings, which can be built."""
    rng = np.random.default_rng(1)
    worst, rotors = 0.0, Counter[int]()
    for _ in range(1000):
        real = random_ball(rng, int(rng.integers(4)))
        mass, limits = request_of(rng, real)
        made = design(real.ball.A, real.Omega, real.K, real.ball.radius, mass, limits)
        assert made.buildable
        check_bodies(made, mass)
        worst = max(worst, error(made, real.ball.A, real.Omega, real.K))
        rotors[len(made.ball.rotors)] += 1
    # Measured 5e-16: rounding of one inverse and of sums of four bodies.
    assert worst < 1e-14
    assert min(rotors[0], rotors[1]) > 200


@pytest.mark.slow
def test_no_number_of_rotors_does_what_two_cannot() -> None:
    """Balls of two to five heavy rings at one rate: its limit is enough for one or two."""
    rng = np.random.default_rng(2)
    worst, rotors = 0.0, Counter[int]()
    for _ in range(200):
        real = ring_ball(rng, int(rng.integers(2, 6)))
        limits = Limits(
            buildable=True,
            rotor_speed=real.rotor_rates[0] * (1 + 1e-6),
            rotor_radius=real.rotor_radius,
            shell_thickness=real.thickness,
        )
        mass = real.ball.mass
        made = design(real.ball.A, real.Omega, real.K, real.ball.radius, mass, limits)
        check_bodies(made, mass)
        worst = max(worst, error(made, real.ball.A, real.Omega, real.K))
        rotors[len(made.ball.rotors)] += 1
    assert worst < 1e-14  # measured 4e-16: rounding
    assert rotors[1] + rotors[2] == 200
    assert rotors[2] >= 20

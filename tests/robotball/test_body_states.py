"""The bodies' states are those of the rolling ball that the equations describe."""

from dataclasses import replace

import numpy as np
import pytest

import robotball as rb
from robotball.bodies import Pendulum
from robotball.body_states import body_states, momentum_of


@pytest.mark.parametrize("name", ["fig12", "three_rotors", "classical_regular", "wobbling_drive"])
def test_the_bodies_momentum_is_the_equations(name: str) -> None:
    """M summed over the bodies, about the contact point (measured 7e-15 of 5 kg m²/s)."""
    motion = rb.integrate(rb.load_scene(name), np.linspace(0, 3, 31))
    hinges = (motion.hinge_angles, motion.hinge_rates)
    states = body_states(motion.scene, motion.attitude, motion.angular_velocity, *hinges)
    assert momentum_of(motion.scene, states) == pytest.approx(motion.momentum, abs=2e-14)


def test_a_pendulum_moves_as_its_coordinates_say() -> None:
    """Velocities of every body against differences of its places, 1e-6 s apart.

    Measured: off by 4e-9 m/s, which is rounding over the interval.
    """
    scene = rb.load_scene("fig12")
    axis = np.array([0.6, 0.0, 0.8])
    centre, pivot = np.array([0.1, -0.2, -0.4]), np.array([0.1, 0.2, 0.3])
    pendulum = Pendulum(0.3, np.diag([0.02, 0.03, 0.04]), centre, axis, pivot)
    ball = replace(scene.ball, pendulums=(pendulum,))
    scene = replace(scene, ball=ball, pendulum_rates=(1.5,))
    h = 1e-6
    times = np.array([0.7 - h, 0.7, 0.7 + h])
    # A ball that turns about a fixed axis, its hinges at their rates.
    omega = np.array([0.3, -0.5, 0.4])
    size = np.linalg.norm(omega)
    half = size * times / 2
    attitude = np.stack([np.cos(half), *(np.sin(half) * omega[:, None] / size)], axis=1)
    hinge_rates = np.tile([float(hinge.command.rate(0.0)) for hinge in scene.hinges], (3, 1))
    states = body_states(
        scene, attitude, np.tile(omega, (3, 1)), times[:, None] * hinge_rates, hinge_rates
    )
    for each in states:
        moved = (each.centre_of_mass[2] - each.centre_of_mass[0]) / (2 * h)
        rolled = states[0].velocity[1]  # of the shell, whose centre of mass is the sphere's
        assert each.velocity[1] - rolled == pytest.approx(moved, abs=2e-8), each.name

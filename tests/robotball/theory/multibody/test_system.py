"""Readings of a state in the equations of any robot: torques, checked with their work."""

import numpy as np
import pytest

import robotball as rb
from robotball.rotations import Array
from tests.random_robots import random_scene
from tests.robots import energy

pytestmark = pytest.mark.core

SCENES = {"swinging_frame": rb.load_scene("swinging_frame")}
SCENES |= {f"random {i}": random_scene(np.random.default_rng(i)) for i in (0, 3, 14)}


def gain(values: Array, step: float) -> Array:
    """The rate of values (n, ...) at all but the first and the last, by central differences."""
    return (values[2:] - values[:-2]) / (2 * step)


@pytest.mark.parametrize("name", SCENES)
def test_motor_power_is_torque_times_rate_and_adds_up_to_the_energy_gain(name: str) -> None:
    """For motors and for hinges with prescribed rates.

    Measured 1e-5 of the largest power, the error of differences over 0.1 ms.
    """
    step = 1e-4
    motion = rb.integrate(SCENES[name], np.arange(0.0, 0.2, step))
    assert motion.motor_work is not None
    assert motion.rolling_loss is not None
    powers = motion.loads.motor_torques * motion.hinge_rates
    largest = np.abs(powers).max()
    assert largest > 0
    assert np.abs(gain(motion.motor_work, step) - powers[1:-1]).max() < 3e-5 * largest
    kept = energy(motion) - motion.motor_work.sum(axis=1) + motion.rolling_loss
    assert np.ptp(kept) < 1e-12 * max(np.ptp(energy(motion)), largest)

"""The momentum form is the Newton-Euler form with multipliers: loads of states, and motions."""

import numpy as np
import pytest

from robotball import integrate
from robotball.engines.multibody import March
from robotball.engines.multibody.system import HINGES, MOMENTUM, POINT, System
from tests.random_robots import random_scene
from tests.robotball.engines.multibody.second_form import SecondForm

pytestmark = pytest.mark.core

ROBOTS = 50


def test_loads_are_those_of_newton_and_euler() -> None:
    """Force, spin torque and motor torques of 50 random robots at their starts, both models.

    Measured 7e-16, relative to the weight and to weight times radius. With the pendulum's pivot on
    the other side they differ by more than 1e-3.
    """
    rng = np.random.default_rng(7)
    seen_wrong = 0
    for _ in range(ROBOTS):
        scene = random_scene(rng)
        loads = integrate(scene, np.array([0.0, 1e-3])).loads
        weight = scene.ball.mass * scene.gravity
        lever = weight * scene.ball.radius
        form = SecondForm(scene)
        second = form.loads(0.0, *form.start())
        assert np.abs(loads.contact_force[0] - second.force).max() < 1e-14 * weight
        assert abs(loads.spin_torque[0] - second.spin) < 1e-14 * lever
        given = [i for i, hinge in enumerate(scene.hinges) if hinge.motor is None]
        assert np.abs(loads.motor_torques[0, given] - second.torques).max(initial=0) < 1e-14 * lever
        if scene.ball.pendulums:
            wrong = SecondForm(scene, pivot_sign=-1.0)
            off = wrong.loads(0.0, *wrong.start()).force - second.force
            seen_wrong += int(np.abs(off).max() > 1e-3 * weight)
    assert seen_wrong > 10


@pytest.mark.slow
def test_motions_are_those_of_newton_and_euler() -> None:
    """Contact point and hinge angles of 50 random robots after 1 s; measured 2e-12 m, 2e-11 rad."""
    rng = np.random.default_rng(8)
    for _ in range(ROBOTS):
        march = March(System(random_scene(rng)), 1e-15, 1.0, 10_000)
        state = march.run(np.array([0.0, 1.0]))[0][-1]
        scene, count = march.system.scene, march.system.count
        point, angles = SecondForm(scene).end(1.0, march.switches)
        assert np.abs(state[POINT:MOMENTUM] - point).max() < 1e-10
        assert np.abs(state[HINGES : HINGES + count] - angles).max() < 1e-10

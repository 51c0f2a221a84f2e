"""A plane that turns: exact circles, a second formulation, slip, work and energy."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import robotball as rb
from robotball.robot import formulas
from robotball.robot.formulas import Rolling
from robotball.robot.scene import Friction
from robotball.rotations import Array, rotation_matrix
from robotball.theory.dop853 import LEAST_RTOL
from robotball.theory.multibody.derivative import HINGES, POINT, readings_of
from robotball.theory.multibody.march import March
from robotball.theory.multibody.system import System
from tests.messages import naming
from tests.random_robots import random_scene
from tests.robotball.theory.multibody.second_form import SecondForm
from tests.robotball.theory.test_friction import SlidingForm, slipping_robots, sphere

pytestmark = pytest.mark.core

VELOCITY = np.array([0.3, 0.1])  # m/s
TIMES = np.linspace(0.0, 10.0, 201)
WOBBLING = rb.Sum((2.0, rb.Sine(amplitude=1.5, frequency=0.7, phase=0.3)))


def rolling_sphere(
    rolling: Rolling = "classical", rotation: float = 2.0, **options: Any
) -> rb.Scene:
    """A solid sphere on a turntable, with VELOCITY at its axis."""
    x, y = VELOCITY
    scene = sphere((x, y), (-y / 0.1, x / 0.1, 0.0), Friction(), rolling)
    return replace(scene, duration=10.0, plane_rotation=rotation, **options)


def circle(k: float, rotation: float, times: Array) -> Array:
    """The path (n, 2) of a sphere with inertia k m a², from the axis with VELOCITY."""
    rate = 1j * rotation * k / (1 + k)
    path = complex(*VELOCITY) * np.expm1(rate * times) / rate
    return np.stack([path.real, path.imag], axis=1)


@pytest.mark.parametrize("rolling", ["classical", "rubber"])
@pytest.mark.parametrize(("k", "rotation"), [(2 / 5, 2.0), (2 / 3, -5.0)])
def test_a_sphere_on_a_turntable_runs_on_a_circle(
    rolling: Rolling, k: float, rotation: float
) -> None:
    """Its rate is Ωk/(1 + k), 2Ω/7 for a solid sphere; measured 6e-15 m."""
    scene = rolling_sphere(rolling, rotation)
    inertia = k * 0.1**2
    ball = rb.Ball(rb.Shell(0.1, 1.0, inertia, inertia, np.array([0.0, 0.0, 1.0])))
    momentum = scene.start.momentum * (k + 1) / 1.4
    start = replace(scene.start, momentum=momentum)
    motion = rb.integrate(replace(scene, ball=ball, start=start), TIMES)
    assert np.abs(motion.contact_point - circle(k, rotation, TIMES)).max() < 1e-13


def test_the_sign_of_the_rotation_decides_the_sense_of_the_circle(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With Ω×r reversed the path differs by a metre; the second form differs, too."""
    reversed_ = circle(0.4, -2.0, TIMES)
    motion = rb.integrate(rolling_sphere(), TIMES)
    assert np.abs(motion.contact_point - reversed_).max() > 0.5
    assert motion.contact_point[-1, 1] != pytest.approx(reversed_[-1, 1], abs=0.1)
    x, y = formulas.turntable_velocity(2.0, (0.3, 0.1))
    assert (x, y) == (-0.2, 0.6)


def off_by(form: SecondForm, scene: rb.Scene, seconds: float = 0.3) -> float:
    """The largest difference after some time: contact point, hinges, and force over weight."""
    march, count = March(System(scene), LEAST_RTOL, seconds, 100_000), len(scene.hinges)
    states, numbers = march.run(np.array([0.0, seconds]))
    readings, (q, v) = readings_of(numbers, count), form.end(seconds, march.switches)
    differences = [
        states[-1, POINT : POINT + 2] - q[:2],
        states[-1, HINGES : HINGES + count] - q[7:],
        readings.rates[-1] - v[6:],
    ]
    if not isinstance(form, SlidingForm):
        weight = scene.ball.mass * scene.gravity
        differences += [(readings.force[-1] - form.loads(seconds, q, v).force) / weight]
    return float(np.abs(np.concatenate(differences)).max())


def test_robots_on_a_turntable_obey_the_newton_euler_equations() -> None:
    """Random robots on a plane that turns unevenly and shakes, in maximal coordinates.

    Measured 6e-13, errors of both integrators. A plane that turns the opposite way differs.
    """
    rng, up = np.random.default_rng(4), rb.Sine(amplitude=2.0, frequency=3.0, phase=0.4)
    for _ in range(4):
        scene = replace(random_scene(rng), plane_rotation=WOBBLING, plane_motion=(0.0, 0.0, up))
        assert off_by(SecondForm(scene), scene) < 1e-11
    opposite = replace(scene, plane_rotation=-2.0)
    assert off_by(SecondForm(opposite), replace(scene, plane_rotation=2.0)) > 1e-3


def test_robots_that_slip_on_a_turntable_obey_the_newton_euler_equations() -> None:
    """With every kind of limit; measured 2e-13 after 0.02 s."""
    compared = 0
    for scene in slipping_robots(8):
        turned = replace(scene, plane_rotation=WOBBLING)
        march = March(System(turned), LEAST_RTOL, 0.02, 100_000)
        march.run(np.array([0.0, 0.02]))
        if not march.system.slip_events:
            compared += 1
            assert off_by(SlidingForm(turned), turned, 0.02) < 1e-11
    assert compared > 5

"""The equations of any robot, compared with Newton-Euler and with the reduced equations."""

from dataclasses import replace

import numpy as np
import pytest

import robotball as rb
from robotball.motion import attitude_error, momentum_error, path_error
from robotball.robot.motors import Free
from robotball.rotations import multiply
from robotball.theory.dop853 import LEAST_RTOL
from robotball.theory.multibody.derivative import HINGES, MOMENTUM, POINT, readings_of
from robotball.theory.multibody.march import March
from robotball.theory.multibody.system import System
from tests.random_robots import random_scene, random_tree
from tests.robotball.theory.multibody.second_form import SecondForm

pytestmark = pytest.mark.core

SECONDS = 0.3
EPS = float(np.finfo(float).eps)
RATES = ("angular_velocity", "hinge_angles", "hinge_rates")


def off_by(form: SecondForm, scene: rb.Scene) -> list[float]:
    """Return the largest difference at the start and at the end; loads relative to the weight."""
    march = March(System(scene), 1e-15, SECONDS, 10_000)
    states, numbers = march.run(np.array([0.0, SECONDS]))
    readings = readings_of(numbers, len(scene.hinges))
    weight, worst = scene.ball.mass * scene.gravity, []
    for i, t, (q, v) in ((0, 0.0, form.start()), (1, SECONDS, form.end(SECONDS, march.switches))):
        loads = form.loads(t, q, v)
        differences = [
            states[i, POINT:MOMENTUM] - q[:2],
            states[i, HINGES : HINGES + len(scene.hinges)] - q[7:],
            readings.rates[i] - v[6:],
            (readings.force[i] - loads.force) / weight,
            (readings.plane_torque[i, 2:] - loads.spin) / weight,
            (readings.torques[i] - loads.torques) / weight,
        ]
        worst.append(float(np.abs(np.concatenate(differences)).max()))
    return worst


def test_random_robots_obey_the_newton_euler_equations() -> None:
    """Contact point, hinges, force, spin and motor torques, at the start and after 0.3 s.

    Measured 3e-15 at the start, rounding, then 3.2e-12 rad/s of a hinge, from both integrators.
    A pendulum pivot on the opposite side changes the results by more than 1e-3.
    """
    rng, seen_wrong = np.random.default_rng(8), False
    for _ in range(12):
        scene = random_scene(rng)
        start, end = off_by(SecondForm(scene), scene)
        assert start < 1e-14
        assert end < 1e-11
        if scene.ball.pendulums and not seen_wrong:
            hung = replace(scene.ball.pendulums[0], pivot=-scene.ball.pendulums[0].pivot)
            wrong = scene.with_hinges(body={"pendulum1": hung})
            seen_wrong = min(off_by(SecondForm(wrong), scene)) > 1e-3
    assert seen_wrong


@pytest.mark.parametrize("framed", [True, False])
def test_trees_of_depth_three_obey_the_newton_euler_equations(framed: bool) -> None:
    """Hinges, a slide, an asymmetric shell, an actuator on two joints, a limit, dry friction.

    Measured 2e-15 at the start, then 2.9e-11 rad/s. Dry friction magnifies rounding: of 150 starts
    that differ by roundings the median is 8e-13, and the largest 8e-11. A hinge in place of the
    slide differs.
    """
    rng = np.random.default_rng(3)
    for _ in range(3):
        scene = random_tree(rng, framed)
        last = scene.hinges[-1].motor
        assert isinstance(last, Free)
        dry = replace(last, friction=0.02 * scene.ball.radius**2)
        scene = scene.with_hinges(motor={scene.hinges[-1].name: dry})
        start, end = off_by(SecondForm(scene), scene)
        assert start < 5e-15
        assert end < 3e-10
    links = {link.name: replace(link, slides=False) for link in scene.ball.links}
    turned = scene.with_hinges(body=links)
    assert min(off_by(SecondForm(turned), scene)) > 1e-3


def differences(one: rb.Motion, other: rb.Motion) -> dict[str, float]:
    """Return the largest difference of each quantity of two motions."""
    pairs = {name: (getattr(one, name), getattr(other, name)) for name in RATES}
    pairs |= {name: (getattr(one.loads, name), right) for name, right in vars(other.loads).items()}
    return {
        "path": path_error(one, other),
        "attitude": attitude_error(one, other),
        "momentum": momentum_error(one, other),
        **{name: float(np.abs(a - b).max(initial=0.0)) for name, (a, b) in pairs.items()},
    }


def growths(scene: rb.Scene, theory: rb.Motion) -> dict[str, float]:
    """How much each of these differences grows, of a ball that starts near by.

    It starts turned by 1e-6 rad about each axis, or with as much more horizontal momentum.
    """
    near, start = 1e-6, scene.start
    pushes = near * scene.momentum_scale * np.eye(3)[:2]
    turns = near / 2 * np.eye(4)[1:]
    starts = [replace(start, momentum=start.momentum + push) for push in pushes]
    starts += [
        replace(start, attitude=multiply(np.eye(4)[0] + turn, start.attitude)) for turn in turns
    ]
    grown = [
        differences(rb.integrate(replace(scene, start=item), theory.times), theory)
        for item in starts
    ]
    return {name: max(item[name] for item in grown) / near for name in grown[0]}


@pytest.mark.parametrize(
    "name", [name for name in rb.catalog() if not rb.load_scene(name).not_reduced]
)
def test_a_balanced_ball_follows_the_reduced_equations(name: str) -> None:
    """Path, attitude, M, hinges and loads.

    Errors of the steps add up at random, here to four standard deviations, and grow like the
    distance between two neighbouring motions. Eight roundings of the largest terms are added: the
    terms of a fast rotor reach 1300 N m and cancel in loads of 10 N m. Measured up to 0.54 of the
    bound on any processor, in the frame rate; the bound is at most 9.1e-12, for a contact force.
    """
    scene, times = rb.load_scene(name), np.linspace(0.0, 3.0, 16)
    theory = rb.integrate(scene, times)
    motion = rb.simulate(scene, times, engine="multibody")
    assert motion.report.faults == ()
    march = March(System(scene), LEAST_RTOL, times[-1], 10_000)
    march.run(times[[0, -1]])
    ball, fastest = scene.ball, np.abs(theory.hinge_rates).max(axis=0)
    whirls = [rotor.axial_inertia * w**2 for rotor, w in zip(ball.rotors, fastest[1:], strict=True)]
    of_loads = ball.mass * scene.gravity * ball.radius + sum(whirls)
    units = dict.fromkeys(vars(theory.loads), of_loads)
    units |= {name: np.abs(getattr(theory, name)).max(initial=0.0) for name in RATES}
    ours, grown = differences(motion, theory), growths(scene, theory)
    for quantity, difference in ours.items():
        at_random = 4 * LEAST_RTOL * np.sqrt(march.steps)
        bound = at_random * grown[quantity] + 8 * EPS * units.get(quantity, 1.0)
        assert difference <= bound < 2e-11, quantity

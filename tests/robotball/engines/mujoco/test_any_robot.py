"""MuJoCo agrees with ideal rolling for any robot, also under a varying contact force."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco.model import Model, build
from robotball.engines.mujoco.rolling_resistance import Resistance
from robotball.engines.mujoco.run import run
from robotball.engines.mujoco.settings import Resolved
from robotball.robot.ball import Ball, Frame, Hinge, Shell, shell_inertia
from robotball.robot.scene import Friction
from tests.messages import naming
from tests.motions import Pair, pair_of
from tests.random_robots import random_scene, random_tree
from tests.robots import Y, box_inertia, robot, worked

pytestmark = pytest.mark.core


def thin_shell(radius: float, mass: float) -> Shell:
    inertia = shell_inertia(radius, mass)
    return Shell(radius, mass, inertia, inertia, Y)


def times_mass(factor: float) -> rb.Scene:
    """Return W2 with all masses multiplied."""
    scene = worked("W2")
    frame = scene.ball.frame
    frame = replace(frame, mass=factor * frame.mass, inertia=factor * frame.inertia)
    hinges = scene.ball.with_hinges(body=[frame]).hinges
    return replace(scene, ball=Ball(thin_shell(0.2, factor), hinges))


RESISTING, SLOPE = Friction(rolling=0.01), (np.sin(0.1), 0.0, -np.cos(0.1))
# A user's file may have a shell and nothing else.
ALONE = robot(
    "alone",
    Ball(thin_shell(0.2, 1.0)),
    "classical",
    [],
    (1.0, 0.3, 0.2, 0.1),
    (1.0, 3.0, 2.0),
    gravity_direction=SLOPE,
)
SCENES = {
    **{name: worked(name) for name in ("W1", "W2", "W4", "W5")},
    "light": times_mass(1e-6),
    "heavy": times_mass(1e6),
    "resisting": replace(rb.load_scene("fig12"), friction=RESISTING),
    "resisting classical": replace(rb.load_scene("classical_regular"), friction=RESISTING),
    "resisting W4": replace(worked("W4"), friction=Friction(rolling=0.005)),
    "resisting W5": replace(worked("W5"), friction=Friction(rolling=0.005)),
    "shell alone": ALONE,
    # Rotors, pendulums, every motor, inclined planes; these are not chaotic.
    **{f"random {i}": random_scene(np.random.default_rng(i)) for i in (0, 3, 14)},
    "tree": random_tree(np.random.default_rng(3), framed=False),
    "framed tree": random_tree(np.random.default_rng(3), framed=True),
}


@cache
def pair_by(name: str, settings: str) -> Pair:
    return pair_of(SCENES[name], settings, rb.sample_times(2.0))


# Bounds on the path error over 2 s: about three times the measured error, given after each.
LIKE_THE_EQUATIONS = {
    ("W1", "exact"): 3e-13,  # 3.8e-14, from the contact depth, as for W2
    ("W2", "exact"): 3e-13,  # 9.8e-14
    ("W4", "exact"): 1.5e-12,  # 4.7e-13: order 8, as in the framed tree
    ("W4", "balanced"): 9e-8,  # 3.0e-8: RK4's error, as in all following cases
    ("W5", "accurate"): 7e-10,  # 2.1e-10
    ("resisting", "accurate"): 3.6e-12,  # 1.2e-12
    ("resisting classical", "accurate"): 2.4e-11,  # 7.9e-12
    # Under a varying load; W4 stops repeatedly.
    ("resisting W4", "accurate"): 1.5e-9,  # 4.9e-10
    ("resisting W5", "accurate"): 4e-10,  # 1.3e-10
    ("shell alone", "accurate"): 1.8e-13,  # 5.9e-14
    ("light", "accurate"): 3e-11,  # 9.9e-12
    ("heavy", "accurate"): 3e-11,  # 1.0e-11
    ("tree", "accurate"): 2.2e-10,  # 7.5e-11
    ("framed tree", "balanced"): 6.5e-8,  # 2.1e-8
    ("framed tree", "exact"): 2.7e-11,  # 8.9e-12
    ("random 0", "balanced"): 4.5e-9,  # 1.5e-9
    ("random 3", "balanced"): 1.5e-10,  # 5.1e-11
    ("random 14", "balanced"): 3.6e-9,  # 1.2e-9
}


LONG = ("resisting W4", "accurate")  # stops repeatedly, with a switch at each stop


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        pytest.param(*case, marks=pytest.mark.study if case == LONG else ())
        for case in LIKE_THE_EQUATIONS
    ],
)
def test_any_robot_follows_its_equations(name: str, settings: str) -> None:
    """Unbalanced, with motors, on an inclined plane, or with resistance to rolling."""
    pair = pair_by(name, settings)
    assert pair.report.faults == ()
    assert pair.path_error < LIKE_THE_EQUATIONS[name, settings]


def test_motors_that_start_a_robot_from_rest_cause_no_fault() -> None:
    """The first step slips by more than the tolerance of its short path, which is harmless."""
    scene = rb.load_scene("examples/first_robot.xml")
    pair = pair_of(scene, "accurate", rb.sample_times(1.0, 1e-3))
    report = pair.motion.report
    moved = np.linalg.norm(pair.motion.contact_point[1])
    assert report.slip[1] * 1e-3 > 3 * report.settings.error_tolerance * moved
    assert pair.report.faults == ()
    assert pair.path_error < 1.5e-8  # measured 5.1e-9: RK4's


def test_a_varying_load_needs_a_hard_contact_and_an_exact_solver() -> None:
    """W5 at 1 ms without one or the other of them: measured 5.8e-7 and 3.1e-3."""
    whole = replace(Resolved(worked("W5"), rb.preset("accurate")).settings, stop_at_fault=False)
    for wrong in ({"softness": 1.0}, {"solver": "PGS", "iterations": 3}):
        pair = pair_of(worked("W5"), replace(whole, **wrong), rb.sample_times(2.0))
        assert pair.path_error > 1e-7


def test_forces_torques_and_momentum_agree_with_the_equations() -> None:
    """The motor torque of a servo includes what accelerates its armature."""
    pair = pair_by("W4", "balanced")
    ours, theirs = pair.motion, pair.theory
    of_motors = np.abs(ours.loads.motor_torques - theirs.loads.motor_torques).max(axis=0)
    assert of_motors.max() < 2e-6  # measured 6.3e-7 N m, of 0.7: RK4's error
    assert np.abs(ours.loads.contact_force - theirs.loads.contact_force).max() < 1.3e-5  # 4.4e-6 N
    assert pair.momentum_error < 1.1e-7  # measured 3.6e-8
    assert np.ptp(theirs.loads.normal_force) > 1
    assert np.ptp(theirs.momentum, axis=0).min() > 1e-3
    # A motor at its limit is a note, not a fault, with the time of the switch.
    note = pair.report.notes[0]
    assert (note.kind, note.subject) == (rb.FaultKind.TORQUE_LIMIT, "frame")
    assert note.time == pytest.approx(0.3078706, abs=1e-6)
    assert np.abs(ours.loads.motor_torques[:, 0]).max() == pytest.approx(0.6, rel=1e-6)


def test_a_step_across_a_torque_limit_costs_two_orders_of_magnitude(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """If steps are not split at switches, the error of W4 at 5 ms is 2.9e-6, not 3e-8."""
    monkeypatch.setattr(Model, "has_torque_limits", False)
    theory = pair_by("W4", "balanced").theory
    assert pair_of(worked("W4"), "balanced", theory=theory).path_error > 1e-6


def test_a_robot_at_rest_keeps_its_contact() -> None:
    """With its weight below the centre, only rounding in the Newton solver moves it.

    The shell of W2 with other radii and a box a third of the radius below the centre. These two of
    35 radii and masses creep most: 0.051 and 0.31 of the contact depth. A contact that is too hard,
    with a softness of 1e-5, is lost, and the ball falls back 0.5 mm deep.
    """

    def crept(radius: float, mass: float, settings: rb.Settings) -> float:
        frame = Frame(mass, box_inertia(mass, 0.1, 0.1, 0.05), np.array([0.0, 0.0, -radius / 3]))
        ball = Ball(thin_shell(radius, 1.0), (Hinge(frame),))
        model = build(robot("rest", ball, "rubber", [0.0], (1.0, 0.0, 0.0, 0.0)), settings)
        report = run(model, np.linspace(0.0, 0.1, 21)).report
        return float(np.abs(report.depth).max() / model.compiled.pair_margin[0])

    balanced = rb.preset("balanced")
    assert crept(0.37, 0.1, balanced) < 0.15
    assert crept(0.12, 0.5, rb.preset("exact")) < 0.9
    hard = replace(Resolved(worked("W2"), balanced).settings, softness=1e-5, solref=(0.04, 1.0))
    assert crept(0.1, 1.0, hard) > 1e5


def test_a_ball_loses_contact_when_the_normal_force_vanishes() -> None:
    """At the time of zero normal force in the equations."""
    scene = random_scene(np.random.default_rng(11))
    with pytest.raises(rb.InputError, match=naming("plane 6.40484…~s")):
        rb.integrate(scene)
    (fault,) = rb.simulate(scene, settings="balanced").report.faults
    assert fault.text == "contact lost"
    assert fault.time == pytest.approx(6.404846, abs=5e-3)  # one step; measured 1.5e-4 late


def test_resistance_to_rolling_is_proportional_to_the_normal_force(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """With the weight of W5 in its place the path error is 1.2e-2, not 2.9e-8."""
    monkeypatch.setattr(
        Resistance, "_resisting", lambda resistance, *_: resistance.arm * resistance.weight
    )
    theory = pair_by("resisting W5", "accurate").theory
    pair = pair_of(SCENES["resisting W5"], "balanced", theory=theory)
    assert pair.path_error > 4e-3


@pytest.mark.parametrize("preset", ["fast", "exact"])
@pytest.mark.parametrize(("slope", "omega"), [(0.015, 0.0), (0.0, 3.0)])
def test_resistance_to_rolling_holds_a_ball_at_rest(
    preset: str, slope: float, omega: float
) -> None:
    """On a gentle slope, and after it has rolled to a stop.

    Measured 9e-16 m and 7e-14 m, rounding. Without static resistance it is 1.5e-3 m and 1.4e-5 m,
    and steps in parts never finish.
    """
    ball = Ball(Shell(0.2, 1.5, 0.03, 0.03, Y), (Hinge(Frame(0.5, 0.002 * np.eye(3))),))
    scene = robot(
        "held",
        ball,
        "classical",
        [0.0],
        (1.0, 0.0, 0.0, 0.0),
        (0.0, omega, 0.0),
        gravity_direction=(np.sin(slope), 0.0, -np.cos(slope)),
        friction=Friction(rolling=0.004),
    )
    times = np.linspace(0.0, 5.0, 11)
    motion = rb.simulate(scene, times, settings=replace(rb.preset(preset), max_steps=10_000))
    assert motion.report.faults == ()
    theory = rb.integrate(scene, times).contact_point
    assert np.abs(motion.contact_point - theory).max() < 5e-13
    assert np.abs(motion.angular_velocity[-1]).max() < 1e-13

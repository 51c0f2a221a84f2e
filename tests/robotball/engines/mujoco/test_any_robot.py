"""MuJoCo rolls any robot as ideal rolling does, where the plane's load varies as well."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

import robotball as rb
from robotball.engines.mujoco import stepping
from robotball.engines.mujoco.fault_window import load, replay
from robotball.engines.mujoco.limits import exceeded, planned, servo_gain
from robotball.engines.mujoco.mjcf_export import write_model
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.run import run
from robotball.engines.mujoco.settings import CONSTANT, VARYING, for_load
from robotball.motion import ContactMotion
from robotball.motors import Servo
from robotball.robot import Ball, Frame, Shell, thin_shell_inertia
from robotball.scene import Friction
from tests.random_robots import random_scene
from tests.robots import ENDINGS, Y, box_inertia, pendulum_ball, robot, swing, worked
from validation import compare

# Bounds are about three times what was measured, beside them: of the path error at t = 10 s.
PATH_BOUNDS = {
    ("W1", "fast"): 7e-6,  # 2.4e-6
    ("W1", "balanced"): 3e-8,  # 9.3e-9
    ("W1", "accurate"): 4e-11,  # 1.2e-11
    ("W2", "fast"): 3e-7,  # 8.6e-8
    ("W2", "balanced"): 6e-10,  # 2.1e-10
    ("W2", "accurate"): 6e-12,  # 2.5e-12
    ("W4", "fast"): 3e-5,  # 8.4e-6
    ("W4", "balanced"): 9e-8,  # 2.8e-8
    ("W4", "accurate"): 1.4e-10,  # 4.0e-11
    ("W5", "fast"): 5e-5,  # 1.5e-5
    ("W5", "balanced"): 6e-7,  # 1.8e-7
    ("W5", "accurate"): 8e-10,  # 3.1e-10
}


@cache
def motion_of(name: str, settings: str) -> ContactMotion:
    scene = worked(name)
    return run(build(scene, rb.preset(settings)), scene.times)


@pytest.mark.parametrize(("name", "settings"), PATH_BOUNDS)
def test_a_robot_ends_where_ideal_rolling_does(name: str, settings: str) -> None:
    """Two programs' end points of four robots; RK4's error dominates."""
    motion, ending = motion_of(name, settings), ENDINGS[name]
    off = np.linalg.norm(motion.contact_point[-1] - ending.contact_point)
    assert off < PATH_BOUNDS[name, settings] * motion.path_scale


# Bounds are about three times what was measured, beside them: of the path error over 10 s.
LIKE_THE_EQUATIONS = {
    ("W1", "adaptive"): 3e-13,  # 1.0e-13: the depth of the contact, in W2 and W5 too
    ("W2", "adaptive"): 1.4e-13,  # 4.7e-14
    ("W4", "adaptive"): 1.7e-12,  # 5.6e-13: DOP853 finds no switch, it steps across in small steps
    ("W5", "adaptive"): 1e-11,  # 6.0e-12
    ("servo_motors", "accurate"): 4e-10,  # 1.2e-10
    ("tilted", "accurate"): 7e-12,  # 2.3e-12
    ("resisting", "accurate"): 9e-12,  # 3.0e-12
    ("resisting classical", "accurate"): 1e-11,  # 3.4e-12
}


def scene_of(name: str) -> rb.Scene:
    if name in ENDINGS:
        return worked(name)
    if name == "servo_motors":
        return rb.load_scene(name)
    if name == "tilted":
        return replace(rb.load_scene("fig12"), gravity_direction=(np.sin(0.1), 0.0, -np.cos(0.1)))
    kind = "classical_regular" if "classical" in name else "fig12"
    return replace(rb.load_scene(kind), friction=Friction(rolling=0.01))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "settings"), LIKE_THE_EQUATIONS)
def test_any_robot_rolls_as_its_equations_say(name: str, settings: str) -> None:
    """Unbalanced, by motors of its own, on an inclined plane, or on one that resists rolling."""
    agreement = compare(scene_of(name), settings)
    assert agreement.faults == ()
    assert agreement.path_error is not None
    assert agreement.path_error < LIKE_THE_EQUATIONS[name, settings]


@pytest.mark.slow
@pytest.mark.parametrize("number", [0, 3, 14, 18])
def test_random_robots_roll_as_their_equations_say(number: int) -> None:
    """Rotors, pendulums, every motor, inclined planes; these four are not chaotic.

    Measured 1.4e-10, 3.1e-11, 8.4e-12 and 9.5e-11.
    """
    error = compare(random_scene(np.random.default_rng(number)), "accurate").path_error
    assert error is not None
    assert error < 5e-10


@pytest.mark.parametrize(
    ("settings", "bound"),
    [("fast", 0.12), ("balanced", 0.15), ("accurate", 0.18), ("adaptive", 0.9)],
)
def test_a_robot_at_rest_keeps_its_contact(settings: str, bound: float) -> None:
    """Its weight straight below the centre, so that the rounding of Newton's accelerations is all.

    Of 35 radii and masses these creep most: by 0.039, 0.051, 0.061 and 0.47 of the contact's depth.
    """
    for radius, mass in ((0.1, 0.1), (0.1, 3.3), (0.12, 0.5), (0.37, 0.1)):
        model = build(at_rest(radius, mass), rb.preset(settings))
        report = run(model, np.linspace(0.0, 0.1, 21)).report
        assert report.faults == ()
        assert np.abs(report.depth).max() < bound * model.compiled.pair_margin[0]


def test_a_robot_at_rest_leaves_a_contact_that_is_too_hard() -> None:
    """So the test before this one would tell: at a softness of 1e-5 it falls back 0.5 mm deep."""
    scene = at_rest(0.1, 1.0)
    hard = replace(for_load(rb.preset("balanced"), scene), softness=1e-5, solref=(0.04, 1.0))
    model = build(scene, hard)
    depth = run(model, np.linspace(0.0, 0.1, 21)).report.depth
    assert np.abs(depth).max() > 1e5 * model.compiled.pair_margin[0]


def at_rest(radius: float, mass: float) -> rb.Scene:
    """W2's shell, of another radius, with a box in it that hangs a third of the radius low."""
    inertia = thin_shell_inertia(radius, 1.0)
    shell = replace(
        worked("W2").ball.shell,
        radius=radius,
        axial_inertia=inertia,
        transverse_inertia=inertia,
    )
    frame = Frame(mass, box_inertia(mass, 0.1, 0.1, 0.05), np.array([0.0, 0.0, -radius / 3]))
    return robot("rest", Ball(shell, frame, ()), "rubber", [0.0], (1.0, 0.0, 0.0, 0.0))


def test_forces_torques_and_momentum_are_those_of_the_equations() -> None:
    """Of a servo with an armature too, whose joint carries less than the motor gives."""
    agreement = compare(worked("W4"), "balanced", rb.sample_times(2.0))
    ours, theirs = agreement.motion, agreement.theory
    of_motors = np.abs(ours.loads.motor_torques - theirs.loads.motor_torques).max(axis=0)
    assert of_motors.max() < 3e-5  # measured 9.4e-6 N m of 0.7: RK4's
    assert np.abs(ours.loads.contact_force - theirs.loads.contact_force).max() < 2e-4  # 4.8e-5 N
    assert agreement.momentum_error is not None
    assert agreement.momentum_error < 1.5e-6  # measured 4.0e-7
    assert np.ptp(theirs.loads.normal_force) > 1
    assert np.ptp(theirs.momentum, axis=0).min() > 1e-3


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_the_unit_of_mass_does_not_count(factor: float) -> None:
    """A million times lighter or heavier, a rubber robot rolls the same; measured 3e-12."""
    light = worked("W2")
    shell, frame = light.ball.shell, light.ball.frame
    heavy_shell = replace(
        shell,
        mass=factor * shell.mass,
        axial_inertia=factor * shell.axial_inertia,
        transverse_inertia=factor * shell.transverse_inertia,
    )
    heavy_frame = replace(frame, mass=factor * frame.mass, inertia=factor * frame.inertia)
    ball = replace(light.ball, shell=heavy_shell, frame=heavy_frame)
    error = compare(replace(light, ball=ball), "accurate").path_error
    assert error is not None
    assert error < 1e-11


def test_a_step_across_a_torque_limit_costs_two_orders(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where steps do not end on the switches, W4 is off by 1e-5 at 5 ms, not by 3e-8."""

    @contextmanager
    def none(control: object) -> Iterator[None]:
        yield None

    monkeypatch.setattr(stepping, "switched", none)
    motion = run(build(worked("W4"), rb.preset("balanced")), worked("W4").times)
    off = np.linalg.norm(motion.contact_point[-1] - ENDINGS["W4"].contact_point)
    assert off > 1e-6 * motion.path_scale  # measured 2.4e-5


def test_a_soft_contact_and_a_quick_solver_are_wrong_where_the_load_varies() -> None:
    """Two choices of VARYING, each undone alone, on W5 at 1 ms; measured 4.3e-7 and 1.6e-2."""
    hard = replace(for_load(rb.preset("accurate"), worked("W5")), stop_at_fault=False)
    for wrong in ({"softness": 1.0}, {"solver": "PGS", "iterations": 3}):
        motion = run(build(worked("W5"), replace(hard, **wrong)), worked("W5").times)
        off = np.linalg.norm(motion.contact_point[-1] - ENDINGS["W5"].contact_point)
        assert off > 1e-7 * motion.path_scale


def test_the_load_chooses_one_of_two_recipes() -> None:
    """The whole of one or of the other; nothing is left open in the settings that run."""
    balanced = rb.preset("balanced")
    for scene in (rb.load_scene("fig12"), scene_of("tilted")):
        assert for_load(balanced, scene) == replace(balanced, **CONSTANT)
    harder: dict[str, Any] = {"softness": 3e-4, "solref": (0.01, 1.0)}
    assert for_load(balanced, worked("W5")) == replace(balanced, **VARYING, **harder)
    assert for_load(rb.preset("fast"), worked("W5")).solref == (0.04, 1.0)  # two of its steps


OWN: tuple[dict[str, Any], ...] = (
    *({"iterations": count} for count in (3, 4, 10)),
    *({"sliding_friction": size} for size in (0.3, 20.0, 2000.0)),
    *({name: value} for name, value in CONSTANT.items()),
    CONSTANT,
)


@pytest.mark.parametrize("own", OWN, ids=str)
def test_what_a_user_sets_is_what_runs(own: dict[str, Any]) -> None:
    """Also a value that one of the recipes has, on a scene that takes the other recipe."""
    mine = replace(rb.preset("balanced"), **own)
    for scene in (worked("W5"), rb.load_scene("fig12")):
        ran = rb.simulate(scene, np.array([0.0, 0.01]), mine).report.settings
        assert {name: getattr(ran, name) for name in own} == own


def test_settings_given_whole_are_what_runs() -> None:
    """And what a run has had is given whole: it is the same on any other scene."""
    for name in ("W5", "servo_motors"):
        whole = for_load(rb.preset("balanced"), scene_of(name))
        assert for_load(whole, worked("W5")) is whole
        assert build(worked("W5"), whole).settings is whole


def test_a_ball_that_lifts_off_loses_its_contact_then() -> None:
    """At the time at which the equations say that nothing presses it on the plane."""
    scene = random_scene(np.random.default_rng(11))
    with pytest.raises(rb.InputError, match=r"lifts off the plane at t = 6\.40484") as told:
        rb.integrate(scene)
    assert "shorten the motion" in str(told.value)
    (fault,) = rb.simulate(scene, settings="accurate").report.faults
    assert fault.text == "contact lost"
    assert fault.time == pytest.approx(6.404846, abs=1e-3)  # measured 1.5e-4 late: a step


def test_a_motor_at_its_limit_is_a_note_of_the_motion() -> None:
    """It stands beside the faults, with the time of the switch, and the motions agree."""
    agreement = compare(worked("W4"), "balanced", rb.sample_times(1.0))
    (note,) = agreement.report.notes
    assert note.text == "frame's motor at its torque limit"
    assert note.time == pytest.approx(0.3078706, abs=1e-6)
    torques = np.abs(agreement.motion.loads.motor_torques[:, 0])
    assert torques.max() == pytest.approx(0.6, rel=1e-6)
    assert agreement.agrees


def test_a_gain_that_the_step_cannot_hold_is_told() -> None:
    """By the inertia that it feels with the ball rolling: sound at 2.7, diverged at 2.9."""
    errors = {}
    for product in (2.7, 2.9):
        scene = swinging(product)
        lines = [str(each) for each in exceeded(scene, rb.preset("fast"), scene.times)]
        assert any("gain times the timestep" in line for line in lines) == (product == 2.9)
        settings = replace(rb.preset("fast"), stop_at_fault=False)
        errors[product] = compare(scene, settings, rb.sample_times(3.0)).path_error
    assert errors[2.7] is not None
    assert errors[2.7] < 1e-4  # measured 1.6e-5
    assert errors[2.9] is None or errors[2.9] > 0.1  # measured 0.48


def swinging(product: float) -> rb.Scene:
    """A pendulum on a velocity servo, whose gain times 20 ms over its inertia is `product`."""
    motors = (Servo(0.5, armature=0.002), Servo(1.0, armature=0.001))
    commands = [swing(2.0, 1.2), swing(0.5, 2.0)]
    ball, q = pendulum_ball(), (1.0, 0.05, 0.0, 0.0)

    def of(gain: float) -> rb.Scene:
        gains = (motors[0], replace(motors[1], gain=gain))
        return robot("swinging", ball, "rubber", commands, q, motors=gains, hinge_rates=(0.0, 0.0))

    def off(gain: float) -> float:
        check = servo_gain(planned(of(gain), rb.preset("fast"), 3.0))
        assert check is not None
        return check.value - product

    return of(brentq(off, 0.1, 10.0))


def test_too_little_friction_of_the_scenes_own_is_told() -> None:
    """Of an unbalanced ball as well, with both numbers."""
    slippery = replace(worked("W2"), friction=Friction(sliding=0.02))
    lines = [str(each) for each in exceeded(slippery, rb.preset("balanced"), slippery.times)]
    assert lines[0].startswith("sliding friction is 0.02 and must be at least 0.05855")


def test_a_fault_window_of_a_robot_steps_again(tmp_path: Path) -> None:
    """On both sides of its torque limits, and with its hard contact, to the last bit."""
    scene = replace(worked("W4"), friction=Friction(sliding=0.05))
    path = tmp_path / "fault.json"
    rb.simulate(scene, settings="balanced", fault_window=path)
    replayed = replay(load(path))
    assert replayed.why == ""
    assert replayed.rows > 20
    assert replayed.difference == 0.0


def test_resistance_that_goes_with_a_varying_load_is_refused() -> None:
    """In one line, before the run."""
    scene = replace(worked("W1"), friction=Friction(rolling=0.01))
    with pytest.raises(rb.InputError, match="resists rolling, by a load that varies"):
        rb.simulate(scene)


def test_a_written_model_says_that_it_does_not_resist_rolling() -> None:
    """For that torque is no part of MJCF."""
    for name, told in (("resisting", True), ("tilted", False)):
        xml = write_model(scene_of(name), rb.preset("fast"), dressed=False, stem="x").xml
        assert ("resistance to rolling, which a run of robotball adds" in xml) == told


@pytest.mark.parametrize("preset", ["fast", "balanced", "accurate", "adaptive"])
@pytest.mark.parametrize(("slope", "omega"), [(0.015, 0.0), (0.0, 3.0)])
def test_a_ball_held_by_the_plane_stands_still(preset: str, slope: float, omega: float) -> None:
    """At rest on a slope that cannot move it, and once it has rolled to its end.

    Measured 9e-16 m and 7e-14 m, rounding; with resistance against rolling alone 1.5e-3 m and
    1.4e-5 m, and adaptive steps without end.
    """
    ball = Ball(Shell(0.2, 1.5, 0.03, 0.03, Y), Frame(0.5, 0.002 * np.eye(3)), ())
    scene = robot(
        "held", ball, "classical", [0.0], (1.0, 0.0, 0.0, 0.0), (0.0, omega, 0.0),
        gravity_direction=(np.sin(slope), 0.0, -np.cos(slope)), friction=Friction(rolling=0.004),
    )  # fmt: skip
    times = np.linspace(0.0, 5.0, 11)
    settings = replace(rb.preset(preset), max_steps=10_000)
    motion = rb.simulate(scene, times, settings)
    assert motion.report.faults == ()
    theory = rb.integrate(scene, times).contact_point
    assert np.abs(motion.contact_point - theory).max() < 5e-13
    assert np.abs(motion.angular_velocity[-1]).max() < 1e-13


def test_adaptive_steps_of_stiff_servos_are_refused() -> None:
    """By their rate times the duration, before the run."""
    ball = Ball(Shell(0.2, 1.0, 0.03, 0.03, Y), Frame(0.5, 4e-5 * np.eye(3)), ())
    scene = robot("stiff", ball, "rubber", [1.0], (1.0, 0.2, 0.1, 0.0), motors=(Servo(500.0),))
    words = r"the number of steps that the servos' rate takes is 1\.98\d*e\+07"
    with pytest.warns(rb.SceneWarning), pytest.raises(rb.InputError, match=words):
        rb.simulate(scene, settings="adaptive")

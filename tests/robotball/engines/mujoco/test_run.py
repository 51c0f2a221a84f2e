"""MuJoCo rolls the ball as the equations do: path, momentum, forces, order in the timestep."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.settings import recipe
from robotball.motion import loads_of
from robotball.rotations import multiply, rotation_matrix
from tests.scenes import FOUR
from validation import Agreement, compare

pytestmark = pytest.mark.core

# Bounds are about three times what was measured, beside them, in path error over 10 s. At 20
# ms RK4's own error dominates and is the same on every machine; at 1 ms it does, with rounding of
# the same size; the adaptive preset has rounding alone. test_catalog has balanced.
PATH_BOUNDS = {
    ("fig12", "fast"): 1e-6,  # 3.3e-7
    ("fig12", "accurate"): 1e-11,  # 2.5e-12
    ("fig12", "adaptive"): 6e-14,  # 1.7e-14
    ("fig13", "fast"): 6e-7,  # 2.2e-7
    ("fig13", "accurate"): 1e-11,  # 2.1e-12
    ("fig13", "adaptive"): 8e-14,  # 2.4e-14
    ("fig14", "fast"): 3e-6,  # 1.0e-6
    ("fig14", "accurate"): 3e-11,  # 9.4e-12
    ("fig14", "adaptive"): 1e-13,  # 3.3e-14
    ("classical_regular", "fast"): 2e-6,  # 6.6e-7
    ("classical_regular", "accurate"): 1.5e-11,  # 3.9e-12
    ("classical_regular", "adaptive"): 1.5e-13,  # 4.3e-14
}
BOTH = ["fig12", "classical_regular"]


@cache
def agreement_of(name: str, settings: str) -> Agreement:
    return compare(rb.load_scene(name), settings)


@pytest.mark.parametrize(("name", "settings"), PATH_BOUNDS)
def test_mujoco_follows_the_equations(name: str, settings: str) -> None:
    """The contact point's path stays within the preset's error, and no fault is found."""
    agreement = agreement_of(name, settings)
    assert agreement.faults == ()
    assert agreement.path_error is not None
    assert agreement.path_error < PATH_BOUNDS[name, settings]
    assert agreement.agrees


@pytest.mark.slow
def test_twenty_lyapunov_times_are_followed() -> None:
    """fig14 to t = 170 s, where the equations themselves are known to 2e-9 of the path.

    A difference grows 4e8-fold on the way, which magnifies the rounding of MuJoCo's accelerations,
    4e-14 rad/s² as its terms of the rotor's rate squared cancel: 8e-10 to 3e-8 as the steps fall.
    """
    scene = rb.load_scene("fig14")
    theory = rb.integrate(scene, rb.sample_times(170.0))
    adaptive, accurate = (
        compare(scene, settings, theory=theory).path_error for settings in ("adaptive", "accurate")
    )
    assert adaptive is not None
    assert accurate is not None
    assert adaptive < 1e-7  # measured 3.0e-9
    assert accurate < 1e-4  # measured 2.9e-5: RK4's error


@pytest.mark.parametrize("name", FOUR)
def test_mujoco_keeps_the_momentum_constant(name: str) -> None:
    """M of MuJoCo's own momenta stays what it was at the start."""
    momentum = agreement_of(name, "accurate").motion.momentum
    start = rb.load_scene(name).start.momentum
    # Measured at most 1.0e-14 kg m²/s of 5: rounding in summing the bodies' momenta.
    assert np.abs(momentum[0] - start).max() < 5e-14
    # Measured at most 1.3e-11 relative (fig14): RK4's error.
    drift = agreement_of(name, "accurate").momentum_error
    assert drift is not None
    assert drift < 4e-11


@pytest.mark.parametrize("name", FOUR)
def test_the_error_is_of_fourth_order_in_the_timestep(name: str) -> None:
    """From 20 to 5 ms the path error falls by four to the fourth; measured 3.79 to 4.11."""
    coarse, fine = (agreement_of(name, settings).path_error for settings in ("fast", "balanced"))
    assert coarse is not None
    assert fine is not None
    assert 3.7 < np.log(coarse / fine) / np.log(4) < 4.3


@pytest.mark.parametrize("name", BOTH)
def test_attitude_and_angular_velocity_agree(name: str) -> None:
    """Not the path alone: the frame's attitude and ω, in frame axes, are those of the equations."""
    agreement = agreement_of(name, "accurate")
    ours, theirs = agreement.motion, agreement.theory
    same = np.abs((ours.attitude * theirs.attitude).sum(axis=1))
    # Measured 1.1e-15 and 4.0e-10 rad/s: RK4's error, which a quaternion's cosine squares.
    assert np.abs(same - 1).max() < 5e-15
    assert np.abs(ours.angular_velocity - theirs.angular_velocity).max() < 1.5e-9
    assert agreement.gamma_error is not None
    assert agreement.gamma_error < 3e-10  # measured 9.2e-11 rad


@pytest.mark.parametrize("name", BOTH)
def test_forces_and_torques_are_the_mechanics_own(name: str) -> None:
    """The contact's force and torque and the motors' torques are those of Newton and Euler."""
    scene, motion = rb.load_scene(name), agreement_of(name, "balanced").motion
    # At MuJoCo's own states, so that the error of the path does not count.
    axes = rotation_matrix(multiply(motion.attitude, scene.principal_quaternion))
    expected = loads_of(scene, motion.times, axes, motion.angular_velocity @ scene.principal_axes)
    weight = scene.ball.mass * scene.gravity
    # Measured 3.3e-10, 3.1e-10 and 2.2e-10 of the weight, on forces as large as it: the weak
    # damping of what slip there is. The normal force is the weight to rounding, 2.2e-15.
    assert np.abs(motion.loads.contact_force - expected.contact_force).max() < 1e-9 * weight
    assert np.abs(motion.loads.spin_torque - expected.spin_torque).max() < 1e-9 * weight
    assert np.abs(motion.loads.motor_torques - expected.motor_torques).max() < 1e-9 * weight
    assert np.abs(motion.loads.normal_force - weight).max() < 1e-14 * weight
    assert expected.sliding_friction.max() > 1
    assert np.abs(expected.motor_torques).max(axis=0).min() > 0.1


def test_a_ball_whose_axes_are_not_principal_rolls_the_same() -> None:
    """Bodies in turned axes: MuJoCo agrees with the equations, which turn to principal axes."""
    scene = rb.load_scene("fig12")
    tilted = np.array([[0.05, 0.02, 0.01], [0.02, 0.03, -0.03], [0.01, -0.03, 0.04]])
    frame = replace(scene.ball.frame, inertia=scene.ball.frame.inertia + tilted)
    ball = replace(scene.ball, frame=frame)
    assert np.abs(ball.principal[1] - np.eye(3)).max() > 0.1
    agreement = compare(replace(scene, ball=ball), "balanced")
    assert agreement.path_error is not None
    assert agreement.path_error < 1e-8  # measured 1.4e-9, RK4's


def test_a_load_that_varies_hardly_moves_the_centre() -> None:
    """The recipe for a varying load: off balance the lever arm keeps its length, and so the path.

    With a contact a thousand times as soft the depth is as many times as large, and the path is off
    by 1.1e-9.
    """
    agreement = compare(rb.load_scene("offset_routh_sphere"), "accurate", rb.sample_times(4.0))
    assert agreement.path_error is not None
    assert agreement.path_error < 1e-11  # measured 3.3e-12
    radius = agreement.theory.scene.ball.radius
    assert np.abs(agreement.report.depth).max() < 3e-11 * radius  # measured 8.7e-12


def test_samples_need_not_fall_on_the_timestep() -> None:
    """Uneven times are hit exactly, by equal steps not longer than the preset's."""
    scene = rb.load_scene("fig12")
    times = np.array([0.0, 0.0131, 0.5, 0.7, 2.0])
    agreement = compare(scene, "balanced", times)
    assert agreement.report.timestep <= 0.005
    # Measured 2.4e-9 m over 7 m: RK4's.
    assert agreement.path_errors.max() < 8e-9


def test_far_apart_samples_take_the_same_steps_as_near_ones() -> None:
    """A long interval is run in parts without a trace of them."""
    scene = rb.load_scene("fig12")
    near = rb.simulate(scene, np.linspace(0.0, 6.0, 301), "accurate")
    far = rb.simulate(scene, np.array([0.0, 6.0]), "accurate")
    # Measured 1.6e-13 m: step lengths differ by rounding.
    assert np.abs(near.contact_point[-1] - far.contact_point[-1]).max() < 1e-12
    assert far.report.steps == 6000


@pytest.mark.parametrize("timestep", [0.02, 0.01, 0.005])
def test_samples_may_fall_on_the_steps_of_dop853(timestep: float) -> None:
    """Steps that end on sample times are read once, and time does not seem to stand still."""
    settings = recipe("fixed", 1e-9, integrator="DOP853", timestep=timestep, rtol=1.0)
    agreement = compare(rb.load_scene("fig12"), settings, rb.sample_times(1.0))
    assert agreement.faults == ()
    assert agreement.path_error is not None
    assert agreement.path_error < 1e-12  # measured 1.9e-13, rounding


def test_prescribed_hinges_keep_their_rates() -> None:
    """Frame and rotor turn at constant rates, whatever torque that takes."""
    agreement = agreement_of("fig12", "accurate")
    motion, theory = agreement.motion, agreement.theory
    # Measured 1.4e-10 of 1480 rad: rounding of 10 000 additions.
    assert np.abs(motion.hinge_angles - theory.hinge_angles).max() < 1e-9
    assert motion.report.hinge_rate_error.max() < 3e-13  # measured 6e-14 at most


@pytest.mark.parametrize("preset", ["fast", "naive"])
def test_a_servo_follows_its_law_between_its_limits(preset: str) -> None:
    """Its torque is kv times the rate's error, cut at either limit, by our switches and MuJoCo's.

    RK4 of "fast" steps as far as each switch; the first order of "naive" leaves the limit to
    MuJoCo.
    """
    motors = (rb.Servo(gain=100.0, torque_limit=3.0), None)
    scene = replace(rb.load_scene("fig12"), motors=motors)
    motion = rb.simulate(scene, rb.sample_times(2.0), preset)
    torque = motion.loads.motor_torques[:, 0]
    rate = scene.hinges[0].command.rate(motion.times)
    law = np.clip(100.0 * (rate - motion.hinge_rates[:, 0]), -3.0, 3.0)
    assert np.abs(torque - law).max() < 5e-14  # measured 1.4e-14 N m: rounding
    # Of 101 samples 39 and 46 are at one limit, 31 and 27 at the other, the others between.
    assert min((law == 3.0).sum(), (law == -3.0).sum(), (np.abs(law) < 3.0).sum()) > 20


def test_progress_is_told_up_to_the_end() -> None:
    """The progress that a long run tells grows to one."""
    told: list[float] = []
    rb.simulate(rb.load_scene("fig12"), settings="accurate", progress=told.append)
    assert told == sorted(told)
    assert len(told) > 1
    assert told[-1] == pytest.approx(1.0, abs=1e-3)


def test_a_model_runs_again_from_its_start() -> None:
    """A built model can be run twice, with the same result to the last bit."""
    from robotball.engines.mujoco.run import run

    scene = rb.load_scene("fig12")
    model = build(scene, rb.preset("fast"))
    first, second = run(model, scene.times), run(model, scene.times)
    assert np.array_equal(first.contact_point, second.contact_point)

"""Fixed steps of order 8 over MuJoCo's forward dynamics."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.integrate import DOP853

import robotball as rb
from robotball.engines.mujoco.control import Control
from robotball.engines.mujoco.limits import PlannedRun
from robotball.engines.mujoco.model import build
from robotball.engines.mujoco.settings import INTEGRATORS, Resolved, recipe
from robotball.engines.mujoco.stepping import controlled
from robotball.motion import path_errors
from robotball.robot.scene import Friction
from tests.messages import naming
from tests.motions import pair_of
from tests.random_robots import random_scene
from tests.robots import worked

pytestmark = pytest.mark.core

FIG12 = rb.load_scene("fig12")
EFFICIENT, EXACT = rb.preset("efficient"), rb.preset("exact")
RK8 = INTEGRATORS["RK8"]


def stepped(step: float, **changes: Any) -> rb.Settings:
    return recipe("stepped", 1e-2, integrator="RK8", timestep=step, **changes)


@pytest.mark.parametrize("name", ["fig12", "classical_regular"])
def test_half_the_step_divides_the_error_by_2_to_the_8(name: str) -> None:
    """Measured 8.45 and 8.26, with errors of 2e-13 at least. All samples end steps."""
    scene, times = rb.load_scene(name), np.linspace(0.0, 2.4, 11)
    coarse, fine = (pair_of(scene, stepped(step), times).path_error for step in (0.06, 0.03))
    assert np.log2(coarse / fine) == pytest.approx(8, abs=0.7)


@cache
def scenes() -> dict[str, rb.Scene]:
    """Return a scene for each kind of control."""
    resisting = replace(FIG12, friction=Friction(rolling=0.01))
    names = {"drive": "wobbling_drive", "moving plane": "shaken_ball", "turntable": "turntable"}
    catalog = {control: rb.load_scene(name) for control, name in names.items()}
    return {**catalog, "torque limit": worked("W4"), "rolling resistance": resisting}


@pytest.mark.parametrize(
    ("control", "bound"),
    [
        ("drive", 7e-14),  # measured 2.1e-14: rounding
        ("moving plane", 1e-12),  # 2.6e-13: the contact's depth
        ("turntable", 5e-14),  # 1.5e-14
        ("torque limit", 1e-12),  # 3.1e-13
        ("rolling resistance", 5e-14),  # 1.4e-14
    ],
)
def test_controls_act_as_in_the_equations(control: str, bound: float) -> None:
    pair = pair_of(scenes()[control], "exact", rb.sample_times(0.6))
    assert pair.report.faults == ()
    assert pair.path_error < bound


@pytest.mark.parametrize("control", ["torque limit", "rolling resistance"])
def test_samples_inside_steps_change_no_step_and_are_as_accurate(control: str) -> None:
    """Sample at uneven times; some are nearly at the end of a step."""
    scene, times = scenes()[control], np.array([0.0, 0.05 - 1e-13, 0.07, 0.0701, 0.33, 0.9999, 1.0])
    settings = stepped(0.05)
    inside, ends = pair_of(scene, settings, times), pair_of(scene, settings, times[[0, -1]])
    assert inside.report.steps == ends.report.steps
    assert np.array_equal(inside.motion.contact_point[-1], ends.motion.contact_point[-1])
    errors = path_errors(inside.motion, inside.theory)
    # Measured 3.4 times with the torque limit, from the interpolation near a switch.
    assert errors.max() < 5 * errors[-1] + 1e-11


def test_a_torque_limit_is_met_with_a_single_trial() -> None:
    """The interpolant of a step across a switch gives its time; RK4 needs some seven trials.

    In a second of steps of 20 ms there are three switches. Each takes a step across it, one to
    check its time, one up to it and the rest.
    """
    model = build(worked("W4"), stepped(0.02))
    with controlled(model) as control:
        control.span, data = (0.0, 1.0), model.start_data()
        assert control.steps is not None
        parts = [part for _ in range(50) for part in control.steps(data, 0.02)]
    assert (len(parts), control.taken) == (53, 59)
    assert parts[:15] == [0.02] * 15
    assert parts[15] == pytest.approx(0.0078706, abs=1e-6)


@pytest.mark.parametrize(("seed", "bound"), [(31, 5e-7), (94, 1e-11)])
@pytest.mark.slow
def test_long_steps_keep_motors_and_contacts_of_random_robots(seed: int, bound: float) -> None:
    """Measured 1.4e-7 and 2.2e-12.

    31 reaches a torque limit and leaves it within 2 ms; with MuJoCo's limit it is off by 7e-5. 94
    lifts off, and is off by 6e-4, if the contact's time constant is a quarter of a step.
    """
    scene = random_scene(np.random.default_rng(seed))
    settings = replace(EXACT, stop_at_fault=False)
    assert pair_of(scene, settings, rb.sample_times(10.0)).path_error < bound


def test_the_models_own_timestep_is_not_the_step() -> None:
    """Its flag refsafe would soften the contact, and RK4 is for other programs."""
    option = build(FIG12, EFFICIENT).compiled.opt
    assert option.timestep == 2e-3
    for settings, constant in ((EFFICIENT, 0.05 / 3), (EXACT, 0.02 / 3), (stepped(1e-3), 0.004)):
        resolved = Resolved(worked("W5"), settings)
        assert resolved.solref == pytest.approx((constant, 1.0))
        # d = 0.9999: stiffness 1/(d·constant)².
        assert resolved.normal_reference[0] == pytest.approx((0.9999 * constant) ** -2)


def test_steps_are_shorter_for_fast_rotations_and_servos() -> None:
    """A rotation is 0.5 rad per step with efficient; a servo's rate times the step is at most 4."""
    fast, stiff = rb.load_scene("tilting_gyroscope"), rb.load_scene("servo_motors")
    plan = PlannedRun(fast, EFFICIENT, 1.0)
    assert plan.timestep * plan.rotation_rate == pytest.approx(0.5, rel=1e-3)
    plan = PlannedRun(stiff, EFFICIENT, 1.0)
    assert plan.timestep * plan.servo_rate == pytest.approx(4, rel=1e-9)
    assert PlannedRun(FIG12, EFFICIENT, 1.0).timestep == 0.05
    assert pair_of(stiff, EFFICIENT, rb.sample_times(1.0)).agrees


def test_the_stability_is_that_of_the_table() -> None:
    """R(z) = Σ (b Aᵏ⁻¹ 1) zᵏ from scipy's table, and |R| = 1 at the limits on both axes."""
    A, b, powers = DOP853.A[:12, :12], DOP853.B, [np.ones(12)]
    for _ in range(11):
        powers.append(A @ powers[-1])
    expected = [b @ power for power in powers]
    assert RK8.stability[::-1] == pytest.approx([1.0, *expected], rel=1e-9)
    assert RK8.rotation_limit is not None
    assert RK8.servo_limit is not None
    for z in (1j * RK8.rotation_limit, -RK8.servo_limit):
        before, after = (abs(np.polyval(RK8.stability, part * z)) for part in (0.999, 1.001))
        assert before < 1 < after
    assert RK8.momentum_loss is not None
    power, part = RK8.momentum_loss
    assert abs(np.polyval(RK8.stability, 0.8j)) == pytest.approx(1 - part * 0.8**power, abs=1e-9)


def test_a_ball_that_slips_keeps_rk4() -> None:
    slick = replace(FIG12, friction=Friction(0.3, 0.3), duration=1.0)
    settings = Resolved(slick, EFFICIENT).settings
    assert (settings.slips, settings.integrator, settings.timestep) == (True, "RK4", 2e-4)


def test_a_drive_is_clipped_at_breakpoints_alone() -> None:
    """At a sample it keeps its value; a clipped one would be 1e-9 s early."""
    scene = FIG12.with_hinges(command={"frame": rb.Ramp(final=1.0, start=0.5, end=1.0)})
    control = Control(build(scene, EXACT))
    control.span = (0.2, 0.4)
    assert control.inside(0.4) == 0.4
    control.span = (0.4, 0.5)
    assert control.inside(0.5) == pytest.approx(0.5 - 1e-9, abs=1e-12)
    control.span = (0.5, 0.6)
    assert (control.inside(0.5), control.inside(0.49)) == (0.5, 0.5)


def test_order_8_needs_a_timestep() -> None:
    with pytest.raises(rb.InputError, match=naming("RK8 timestep 0.05")):
        replace(EXACT, timestep=None)

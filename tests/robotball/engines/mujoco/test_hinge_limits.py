"""A servo diverges at the gain predicted, and a hinge loses the share of its rate predicted."""

from dataclasses import replace

import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco import limits as hinge_limits
from robotball.engines.mujoco import limits as step_limits
from robotball.engines.mujoco.planned_run import PlannedRun
from tests.robotball.engines.mujoco.limits import FAST, FIG12, REGULAR, error, run, the_limit
from validation import compare
from validation.studies.extreme_maps import scaled

SERVO = replace(FAST, timestep=2e-3, drive=rb.Servo(gain=1.0))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("integrator", "inside", "outside"),
    [("RK4", 2.7, 2.9), ("Euler", 1.95, 2.1), ("discrete", 1.8, 2.1)],
)
@pytest.mark.parametrize("scene", [FIG12, REGULAR], ids=["rubber", "classical"])
def test_a_servo_may_not_be_too_strong_for_the_step(
    scene: rb.Scene, integrator: str, inside: float, outside: float
) -> None:
    """kv·dt/j with j of the rolling ball: below the limit it turns, above it all diverges."""
    weak = replace(SERVO, integrator=integrator)
    per_gain = the_limit(step_limits.servo_gain, scene, weak, 1.0).value
    for product in (inside, outside):
        settings = replace(weak, drive=rb.Servo(gain=product / per_gain))
        assert the_limit(step_limits.servo_gain, scene, settings, 1.0).exceeded == (
            product == outside
        )
        if product == inside:
            assert error(run(scene, settings, 1.0)) < 0.2  # measured 0.026 to 0.13: the droop
        else:
            assert error(run(scene, settings, 1.0)) == np.inf


def test_an_implicit_integrator_bears_any_servo() -> None:
    """implicit takes the gain into its step: no limit, and no divergence at twenty times RK4's."""
    gain = 20 * 30.0
    settings = replace(SERVO, integrator="implicit", drive=rb.Servo(gain=gain))
    assert step_limits.servo_gain(PlannedRun(FIG12, settings, 1.0)) is None
    assert error(run(FIG12, settings, 1.0)) < 0.2  # measured 0.072


def test_a_servo_droops_as_predicted() -> None:
    """τ/kv of the rate: measured 0.99 of it at a gain of 100."""
    settings = replace(FAST, timestep=1e-3, integrator="implicitfast", drive=rb.Servo(gain=100.0))
    limit = the_limit(hinge_limits.servo_droop, FIG12, settings, 0.1)
    measured = run(FIG12, settings, 0.1).report.hinge_rate_error.max()
    assert 0.95 < measured / limit.value < 1.0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["fig12", "classical_regular", "spin_up_from_rest"])
def test_heavy_bodies_turn_their_hinges_in_spite_of_the_armature(name: str) -> None:
    """A million times the masses at adaptive: wrong by 1e-9 and more, and warned of by the rate."""
    scene = rb.load_scene(name)
    adaptive = rb.preset("adaptive")
    for mass in (1.0, 1e6):
        ball = scaled(scene, mass=mass, length=1.0)
        agreement = compare(ball, replace(adaptive, stop_at_fault=False))
        plan = PlannedRun(ball, adaptive, 10.0, agreement.theory.loads)
        limit = hinge_limits.prescribed_rate(plan)
        assert limit is not None
        assert limit.exceeded == (mass == 1e6)
        assert limit.exceeded == (error(agreement) > 1e-11)  # measured 1.6e-9, 1.3e-8 and 7.1e-7
        assert the_limit(hinge_limits.prescribed_rate, ball, adaptive, 10.0).exceeded == (
            mass == 1e6
        )
        if mass == 1e6:
            lost = agreement.report.hinge_rate_error.max()
            assert limit.value == pytest.approx(lost, rel=0.05)  # measured within 3 %

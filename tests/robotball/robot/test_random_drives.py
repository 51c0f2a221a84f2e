"""Drives that are zero, late, constant, sampled or of amplitude zero: no fault, and no warning."""

import warnings

import numpy as np
import pytest

import robotball as rb
from robotball.engines.mujoco.limits import PlannedRun
from robotball.engines.mujoco.run import limit_checks
from robotball.errors import SceneWarning
from tests.random_drives import random_drives

QUICK = range(10)
STANDS = rb.Samples(times=(0.0, 1.0, 20.0), values=(0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    "number", [*QUICK, *(pytest.param(n, marks=pytest.mark.study) for n in range(10, 200))]
)
def test_drives_that_are_zero_late_or_flat_run_without_a_fault(number: int) -> None:
    """The path error is below 5e-6, the tolerance; RK4's steps are its source."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", SceneWarning)
        run = rb.compare(random_drives(number), settings="balanced")
    assert (run.faults, run.agrees) == ((), True)


def test_a_rate_that_is_zero_throughout_is_measured_against_that_of_a_falling_ball() -> None:
    scene = rb.load_scene("fig12").with_hinges(command=(3.0, STANDS))
    falling = np.sqrt(scene.gravity / scene.ball.radius)
    assert list(scene.rate_scales) == pytest.approx([3.0, falling])
    # Rounding in a sum of sines is no rate either.
    parts = [rb.Sine(amplitude=a, frequency=1.0) for a in (0.1, 0.2, -0.3)]
    scene = scene.with_hinges(command=(rb.Sum(tuple(parts)), 2.0))
    assert 0 < scene.largest_rates[0] < 1e-15
    assert list(scene.rate_scales) == pytest.approx([falling, 2.0])


def test_steps_see_a_sum_whose_parts_cancel() -> None:
    """Relative to the rounding that is left, the error was 25."""
    parts = tuple(rb.Sine(amplitude=a, frequency=1.0) for a in (0.1, 0.2, -0.3))
    scene = rb.load_scene("fig12").with_hinges(command={"frame": rb.Sum(parts)})
    assert scene.sampling_error(1.0, 0.02) < 1e-12  # measured 2e-15, rounding


def test_soft_friction_at_rest_is_not_predicted_to_creep_without_bound() -> None:
    """From rest the slip is relative to the radius. It was infinite, and the run agrees."""
    checks = limit_checks(PlannedRun(random_drives(3), rb.preset("naive"), 0.5))
    assert checks["creep"].value < 1e-12  # measured 3e-19, rounding in the loads


def test_a_servo_droops_relative_to_a_rate_that_begins_late() -> None:
    """Relative to the largest rate, not to the rate at the start, which is 0."""
    late = rb.Ramp(final=3.0, start=0.1, end=0.2)
    scene = rb.load_scene("fig12").with_hinges(command={"frame": late})
    loads = rb.integrate(scene, rb.sample_times(0.5)).loads
    plan = PlannedRun(scene, rb.preset("naive"), 0.5, loads)
    assert limit_checks(plan)["servo_droop"].value > 1  # measured 2.1, as the ramp is steep

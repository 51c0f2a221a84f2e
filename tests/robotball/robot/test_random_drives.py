"""Zero, late, constant and sampled drives: no fault and no warning."""

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
def test_zero_late_and_constant_drives_run_without_a_fault(number: int) -> None:
    """The path error is below the tolerance of 5e-6; it comes from the RK4 steps."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", SceneWarning)
        run = rb.compare(random_drives(number), settings="balanced")
    assert (run.faults, run.agrees) == ((), True)


def test_errors_of_a_zero_rate_are_relative_to_the_rate_of_a_falling_ball() -> None:
    scene = rb.load_scene("fig12").with_hinges(command=(3.0, STANDS))
    falling = np.sqrt(scene.gravity / scene.ball.radius)
    assert list(scene.rate_scales) == pytest.approx([3.0, falling])
    # A sum of sines that cancels to rounding counts as zero.
    parts = [rb.Sine(amplitude=a, frequency=1.0) for a in (0.1, 0.2, -0.3)]
    scene = scene.with_hinges(command=(rb.Sum(tuple(parts)), 2.0))
    assert 0 < scene.largest_rates[0] < 1e-15
    assert list(scene.rate_scales) == pytest.approx([falling, 2.0])


def test_the_sampling_error_of_sines_that_cancel_is_small() -> None:
    """Relative to the residual rounding it would be 25."""
    parts = tuple(rb.Sine(amplitude=a, frequency=1.0) for a in (0.1, 0.2, -0.3))
    scene = rb.load_scene("fig12").with_hinges(command={"frame": rb.Sum(parts)})
    assert scene.sampling_error(1.0, 0.02) < 1e-12  # measured 2e-15, rounding


def test_the_predicted_creep_from_rest_is_finite() -> None:
    """From rest the slip is relative to the radius, not to the zero path."""
    checks = limit_checks(PlannedRun(random_drives(3), rb.preset("naive"), 0.5))
    assert checks["creep"].value < 1e-12  # measured 3e-19, rounding in the loads


def test_servo_droop_is_relative_to_the_largest_rate() -> None:
    """Not relative to the initial rate, which is 0."""
    late = rb.Ramp(final=3.0, start=0.1, end=0.2)
    scene = rb.load_scene("fig12").with_hinges(command={"frame": late})
    loads = rb.integrate(scene, rb.sample_times(0.5)).loads
    plan = PlannedRun(scene, rb.preset("naive"), 0.5, loads)
    assert limit_checks(plan)["servo_droop"].value > 1  # measured 2.1: the ramp is steep

"""Random runs: failures at extremes are reported, and ordinary runs raise no alarm."""

import numpy as np
import pytest

import robotball as rb
from bench.random_runs import extreme, judged, ordinary, robot
from tests.robots import low_weight
from validation import compare

pytestmark = pytest.mark.core


@pytest.mark.parametrize("number", [6, 10, 15, 19, 27, 34])
def test_no_extreme_run_fails_unreported(number: int) -> None:
    """A path error over 10 % has a warning before or a fault during the run."""
    outcome = judged(extreme(7, number))
    assert (outcome.failed, bool(outcome.reported)) == (True, True)


@pytest.mark.parametrize("number", [1, 2, 12, 17])
def test_no_ordinary_run_is_called_wrong(number: int) -> None:
    """Recipe presets on varied catalog balls have no warning and no fault, and agree."""
    outcome = judged(ordinary(7, number))
    assert (outcome.within, bool(outcome.reported)) == (True, False)


# (robot, preset, duration) of runs that only this check reports
OFF: dict[str, tuple[rb.Scene, str, float]] = {
    "RK4's error at a low weight": (low_weight(50.0, 0.15), "fast", 0.6),
    "the contact's depth under a low weight": (low_weight(50.0, 0.15), "accurate", 0.6),
}


@pytest.mark.parametrize("name", OFF)
def test_an_inaccurate_motion_without_constants_is_reported(name: str) -> None:
    """Runs with other steps show an error of path or M above the tolerance."""
    scene, settings, duration = OFF[name]
    run = compare(scene, rb.sample_times(duration), settings=settings)
    (fault,) = run.faults
    tolerance = run.settings.error_tolerance
    assert (fault.kind, fault.limit) == (rb.FaultKind.OFF, tolerance)
    errors = np.maximum(run.path_errors / run.theory.path_scale, run.momentum_errors) / tolerance
    assert errors.max() > 1
    # Measured 0.79 and 0.82; 0.71 and 0.78 one row earlier.
    assert 0.7 < errors[run.theory.times >= fault.time][0] < 1.2
    (one,) = rb.simulate_many(scene, [scene.start], run.theory.times, settings=settings)
    assert one.report.faults == run.faults


def test_a_lighter_weight_is_not_called_wrong() -> None:
    """Nor is a run of one or two steps, which has no run with longer steps to compare."""
    for duration in (0.001, 0.008, 0.6):
        run = compare(low_weight(10.0, 0.15), np.array([0.0, duration]), settings="balanced")
        assert (run.faults, run.agrees) == ((), True)


@pytest.mark.parametrize("number", [9, 35])
def test_no_robot_is_off_unreported(number: int) -> None:
    """With changed bodies or motion, errors above the preset's tolerance are reported as faults."""
    outcome = judged(robot(7, number))
    assert (outcome.off, outcome.warned, len(outcome.faults)) == (True, (), 1)


@pytest.mark.parametrize("number", [5, 6, 8, 18])
def test_no_robot_is_called_wrong(number: int) -> None:
    outcome = judged(robot(7, number))
    assert (outcome.within, outcome.reported) == (True, False)


@pytest.mark.parametrize(
    ("settings", "duration"), [("fast", 4), ("balanced", 2), ("accurate", 0.4)]
)
def test_no_robot_of_the_catalog_is_called_wrong(settings: str, duration: float) -> None:
    """The largest error is 1/25 of the tolerance."""
    for scene in map(rb.load_scene, rb.catalog()):
        # Its servos are too stiff for steps of 20 ms.
        if scene.not_reduced and (scene.name, settings) != ("servo_motors", "fast"):
            assert (
                rb.simulate(scene, rb.sample_times(duration), settings=settings).report.faults == ()
            )

"""Both engines agree on every scene of the catalog and on random balls and drives."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import robotball as rb
from robotball.robot.formulas import ROLLING_MODELS
from robotball.scene_files.scene_file import heads
from tests.motions import pair_of
from tests.random_balls import ball_of_points

pytestmark = pytest.mark.core

# Path errors with "balanced" over 10 s, for robots over 4 s. RK4's error dominates; it scales with
# the fourth power of the fastest rate and is largest for Figs 5-8, with frames at 4.6 rad/s.
MEASURED = {
    "beaver_ball": 2.6e-8, "chaplygin_ball": 1.7e-9, "chaplygin_ball_same_tori": 2.4e-11,
    "chaplygin_gyrostat": 1.0e-9, "classical_chaotic": 2.4e-8, "classical_regular": 2.2e-9,
    "fig05b": 1.7e-7, "fig05c": 4.8e-9, "fig05d": 3.5e-9, "fig06": 9.6e-8, "fig07": 7.4e-8,
    "fig08": 2.0e-8, "fig10": 2.8e-12, "fig10_stable": 2.5e-12, "fig12": 1.7e-9, "fig13": 9.9e-10,
    "fig14": 5.5e-9, "inclined_plane": 3.2e-9, "offset_routh_sphere": 2.7e-9,
    "pendulum_robot": 2.4e-10, "routh_sphere": 1.1e-8, "rubber_chaplygin_ball": 2.4e-11,
    "rubber_chaplygin_gyrostat": 2.4e-9, "rubber_routh_sphere": 4.6e-9, "servo_motors": 1.5e-10,
    "shaken_ball": 6.3e-9, "spin_up_from_rest": 6.2e-8, "steered_pendulum_robot": 6.1e-10,
    "swinging_frame": 1.9e-8, "three_rotors": 1.7e-9, "tilting_gyroscope": 3.2e-9,
    "turntable": 2.1e-10, "vibrated_ball": 3.8e-8, "wobbling_drive": 2.5e-9, "zero_rotor": 3.9e-11,
}  # fmt: skip


@pytest.mark.parametrize("name", rb.catalog())
def test_both_engines_agree_on_every_scene(name: str) -> None:
    """On the path, within three times the measured error, on M, and on forces and torques."""
    scene = rb.load_scene(name)
    preset, times = "balanced", rb.sample_times(4.0) if scene.not_reduced else None
    if name == "servo_motors":  # too fast for steps of 5 ms
        preset, times = "accurate", rb.sample_times(1.0)
    pair = pair_of(scene, preset, times)
    assert pair.report.faults == ()
    assert pair.agrees
    # Below 1e-12 rounding matters as well. For a new scene without an entry, the tolerance of the
    # preset is the bound.
    measured = MEASURED.get(name, rb.preset(preset).error_tolerance / 3)
    assert pair.path_error < 3 * max(measured, 1e-12)
    assert pair.momentum_error < 1.7e-7  # measured 5.6e-8 (swinging_frame): RK4's error
    ours, theirs = pair.motion.loads, pair.theory.loads
    for kind in ("contact_force", "spin_torque", "motor_torques"):
        expected = getattr(theirs, kind)
        # The spin torque of fig05d is zero; RK4's error in it is 5.1e-8 N m.
        scale = max(float(np.abs(expected).max()), 1e-2)
        # Measured 3.0e-5 (tilting_gyroscope), else 7.6e-6: RK4's error in the state.
        assert np.abs(getattr(ours, kind) - expected).max() < 9e-5 * scale, kind


def test_the_head_of_a_file_matches_its_scene() -> None:
    """`robotball scenes` lists heads without building the scenes; every scene has a source."""
    for name, head in heads().items():
        scene = rb.load_scene(name)
        assert all(head[key] == getattr(scene, key) for key in ("title", "rolling", "duration"))
        assert "=" in scene.source
    assert [*heads()] == rb.catalog()


# Any ball -------------------------------------------------------------------------------------

GRID = np.linspace(0, 10, 41)
UNSTEADY: dict[str, dict[str, Any]] = {
    "ramp across samples": {"frame": rb.Ramp(initial=2.0, final=4.0, start=1.233, end=3.217)},
    "smooth ramps": {
        "frame": rb.Ramp(initial=2.0, final=4.0, start=1.0, end=3.0, shape="smooth"),
        "rotor1": rb.Ramp(initial=148.0, final=-148.0, start=0.5, end=8.0),
    },
    "sines": {
        "frame": rb.Sine(mean=2.0, amplitude=1.0, frequency=0.5),
        "rotor1": rb.Sine(mean=148.0, amplitude=20.0, frequency=0.8),
    },
    "a function": {"frame": lambda t: 2 + np.sin(3 * t)},
    "samples": {"frame": rb.Samples(times=tuple(GRID), values=tuple(2 + np.sin(GRID)))},
    "a sum": {
        "frame": rb.Sum(
            (2.0, rb.Ramp(final=1.0, start=1.1, end=2.0), rb.Sine(amplitude=0.5, frequency=0.6))
        )
    },
}
CASES = [*range(8), *zip(UNSTEADY, 3 * ROLLING_MODELS, strict=True)]


def scene_of(case: Any) -> rb.Scene:
    """Return a random ball, or the ball of Fig. 12 with time-dependent drives."""
    if isinstance(case, int):
        return ball_of_points(case)
    name, rolling = case
    return replace(rb.load_scene("fig12").with_hinges(command=UNSTEADY[name]), rolling=rolling)


@pytest.mark.parametrize(
    "case",
    [pytest.param(c, marks=pytest.mark.study if c in range(4, 8) else ()) for c in CASES],
    ids=str,
)
def test_mujoco_converges_to_the_equations_with_order_four(case: Any) -> None:
    """Shells with I_s ≠ J_s, rates of both signs, both rolling models, several breakpoints.

    Measured with "balanced" at most 1.5e-8, with drives 2.9e-8; orders between 20 and 5 ms from
    3.60 (samples) to 4.35.
    """
    scene = scene_of(case)
    theory = rb.integrate(scene)
    coarse, fine = (pair_of(scene, preset, theory=theory) for preset in ("fast", "balanced"))
    assert fine.report.faults == ()
    assert fine.path_error < (5e-8 if isinstance(case, int) else 9e-8)
    assert 3.5 < np.log(coarse.path_error / fine.path_error) / np.log(4) < 4.5

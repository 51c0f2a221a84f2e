"""The balls of the paper's figures, designed from their numbers: all roll, some can be built."""

import math
from dataclasses import replace

import numpy as np
import pytest

import robotball as rb
from robotball import design
from robotball.designing import WIDER
from tests.robotball.designs import UNBUILDABLE, check_bodies, error
from validation import compare


@pytest.mark.parametrize("name", ["fig12", "fig13", "fig14"])
def test_the_balls_of_figs_11_to_14_can_be_built_and_run_in_both_engines(name: str) -> None:
    """Designed from the numbers alone, each rolls as the equations say."""
    scene = rb.load_scene(name)
    p = scene.parameters
    made = design(p.A, p.Omega, p.K, p.a)
    check_bodies(made, None)
    assert made.buildable
    assert made.verdict.startswith("can be built")
    assert len(made.ball.rotors) == 1
    # Measured at most 2e-16: rounding.
    assert error(made, np.diag(p.A), np.array(p.Omega), np.array(p.K)) < 2e-15
    designed = replace(
        scene, ball=made.ball, frame_rate=made.frame_rate, rotor_rates=made.rotor_rates
    )
    agreement = compare(designed, "balanced")
    assert agreement.agrees
    # Measured at most 5.5e-9 (fig14): RK4's error at 5 ms.
    assert agreement.path_error is not None
    assert agreement.path_error < 1e-7


@pytest.mark.parametrize(
    ("name", "radius"),
    [*((f"fig{n}", 1.3628) for n in ("05b", "05c", "05d", "06", "07", "08")), ("fig10", 3.0)],
)
def test_the_balls_of_figs_5_to_10_run_in_mujoco_only(name: str, radius: float) -> None:
    """The frame needs a radius of √((3 max b - Σb)/(Σb - 2 max b)) at least, for a = 1."""
    p = rb.load_scene(name).parameters
    made = design(p.A, p.Omega, p.K, p.a)
    check_bodies(made, None)
    assert made.verdict.startswith(UNBUILDABLE)
    b = 1 / np.array(p.A)
    assert math.sqrt((3 * b.max() - b.sum()) / (b.sum() - 2 * b.max())) == pytest.approx(
        radius, rel=1e-4
    )
    # It is searched to four digits.
    assert made.needed_radius == pytest.approx(radius, rel=3e-4)
    assert f"needs a radius of {made.needed_radius:.4g} m" in made.verdict
    assert made.needed_radius <= made.reach <= WIDER * made.needed_radius
    assert made.masses[0] > made.masses[1]
    assert error(made, np.diag(p.A), np.array(p.Omega), np.array(p.K)) < 2e-15


@pytest.mark.parametrize("name", ["fig06", "fig10"])
def test_a_ball_that_no_workshop_can_build_rolls_in_mujoco(name: str) -> None:
    """Only the place of the mass is impossible, not the inertia."""
    scene = rb.load_scene(name)
    p = scene.parameters
    made = design(p.A, p.Omega, p.K, p.a)
    designed = replace(
        scene, ball=made.ball, frame_rate=made.frame_rate, rotor_rates=made.rotor_rates
    )
    assert compare(designed, "balanced", rb.sample_times(2.0)).agrees

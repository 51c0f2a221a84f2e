"""The balls of the paper's figures, designed from their numbers: some can be built."""

import math

import numpy as np
import pytest

import robotball as rb
from robotball import design
from robotball.designing import WIDER
from tests.robotball.designs import UNBUILDABLE, check_bodies, error

# The radius that the frame needs at least, for a = 1; none beyond the shell.
RADII = {
    **dict.fromkeys(("fig12", "fig13", "fig14")),
    **dict.fromkeys(("fig05b", "fig05c", "fig05d", "fig06", "fig07", "fig08"), 1.3628),
    "fig10": 3.0,
}


@pytest.mark.parametrize(("name", "radius"), RADII.items())
def test_a_paper_ball_has_its_numbers_and_is_built_where_it_can_be(
    name: str, radius: float | None
) -> None:
    """By one rotor, to rounding: measured 2e-16; else the verdict has the frame's radius."""
    p = rb.load_scene(name).parameters
    made = design(p.A, p.Omega, p.K, p.a)
    check_bodies(made, None)
    assert error(made, np.diag(p.A), np.array(p.Omega), np.array(p.K)) < 2e-15
    assert made.buildable == (radius is None)
    if radius is None:
        assert made.verdict.startswith("can be built")
        assert len(made.ball.rotors) == 1
        return
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

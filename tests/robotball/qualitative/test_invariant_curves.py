"""Invariant curves of the section map: an integrable ball has them, a chaotic one has not."""

import numpy as np
import pytest

from robotball.equations import Parameters
from robotball.errors import InputError
from robotball.qualitative.basins import level_points
from robotball.qualitative.sections import section, section_starts
from robotball.qualitative.tori import invariant_curve
from robotball.rotations import Array
from tests.figures import CHAOTIC, F, ball

# Chaplygin's own ball, nothing inside it turning: integrable.
CHAPLYGIN = ball((0.7, 0.6, 0.8), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), "classical")


def orbit_of(some: Parameters, L: float, l: float) -> Array:
    """γ and M/|M| (1000, 6) at the crossings in one direction."""
    attitudes, momenta = section_starts(L, l, F)
    found = section(some, attitudes, momenta, count=1000, direction=1)
    return level_points(found.attitudes, momenta)[0]


@pytest.mark.slow
@pytest.mark.parametrize(("L", "l"), [(3.6, 0.6), (1.0, 2.0)])
def test_an_integrable_ball_has_invariant_curves(L: float, l: float) -> None:
    """Points held out are on the curve; so are the next 500, which the fit never saw.

    Measured 8e-10 and 4e-9 of unit vectors, then 4e-9 and 1.5e-8: the harmonics left out, and the
    error of ρ times the number of the point.
    """
    points = orbit_of(CHAPLYGIN, L, l)
    curve = invariant_curve(points[:500])
    assert curve.residual < 2e-8
    later = curve.at(curve.rotation * np.arange(500.0, 1000.0))
    assert np.abs(later - points[500:]).max() < 8e-8
    ends = curve.at(np.array([0.0, 1.0]))
    assert np.abs(ends[1] - ends[0]).max() < 2e-15  # measured 2e-16


@pytest.mark.slow
def test_the_rotation_number_of_a_known_curve() -> None:
    """A bent circle turned by 0.381966… a step: ρ and curve to the rounding of a fit with
    twenty times the harmonics that it has.
    """
    rho = (3 - np.sqrt(5)) / 2
    phase = 2 * np.pi * rho * np.arange(400)
    circle = [np.cos(phase) + 0.2 * np.cos(2 * phase), np.exp(np.sin(phase))]
    curve = invariant_curve(np.stack(circle, axis=1))
    assert curve.rotation == pytest.approx(rho, abs=1e-13)
    assert curve.residual < 2.5e-10  # measured 4.7e-11


@pytest.mark.slow
def test_chaos_fills_no_curve() -> None:
    """Fig. 14: the points held out are as far off as the section is wide."""
    assert invariant_curve(orbit_of(CHAOTIC, 0.0, 0.6)).residual > 0.5


def test_points_of_no_curve_are_refused() -> None:
    """Too few, not finite, or a fixed point."""
    with pytest.raises(InputError, match="100 finite points"):
        invariant_curve(np.ones((99, 2)))
    with pytest.raises(InputError, match="100 finite points"):
        invariant_curve(np.full((200, 2), np.nan))
    with pytest.raises(InputError, match="all the same"):
        invariant_curve(np.ones((200, 2)))

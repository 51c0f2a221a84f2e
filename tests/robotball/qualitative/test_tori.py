"""Invariant tori: the curves that they cut from a section, and those that two balls share."""

import numpy as np
import pytest

from robotball import equations as eq
from robotball.engines.ensembles.orbits import orbit
from robotball.equations import Parameters
from robotball.errors import InputError
from robotball.qualitative.long_run import level_points
from robotball.qualitative.sections import invariant_curve, section, section_starts, shared_integral
from robotball.rotations import Array, rotation_matrix
from robotball.scene import along_momentum, section_state
from tests.figures import CHAOTIC, F, ball


def orbit_of(some: Parameters, L: float, l: float) -> Array:
    """γ and M/|M| (400, 6) at the crossings in one direction."""
    attitudes, momenta = section_starts(L, l, F)
    found = section(some, attitudes, momenta, count=400, direction=1)
    return level_points(found.attitudes, momenta)[0]


def test_an_integrable_ball_has_invariant_curves_and_a_chaotic_one_has_not() -> None:
    """Points held out are on the curve; so are the next 200, which the fit never saw.

    Measured 4.0e-7 of unit vectors, then 9.7e-7: the harmonics left out, and the error of ρ times
    the number of the point. Fig. 14's points held out are as far off as the section is wide.
    """
    chaplygin = ball((0.7, 0.6, 0.8), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), "classical")
    points = orbit_of(chaplygin, 3.6, 0.6)
    curve = invariant_curve(points[:200])
    assert curve.residual < 1.2e-6
    later = curve.at(curve.rotation * np.arange(200.0, 400.0))
    assert np.abs(later - points[200:]).max() < 3e-6
    ends = curve.at(np.array([0.0, 1.0]))
    assert np.abs(ends[1] - ends[0]).max() < 2e-15  # measured 2e-16
    assert invariant_curve(orbit_of(CHAOTIC, 0.0, 0.6)[:200]).residual > 0.5


def test_the_rotation_number_of_a_known_curve() -> None:
    """A bent circle turned by 0.381966… a step: ρ and the curve are found to rounding."""
    rho = (3 - np.sqrt(5)) / 2
    phase = 2 * np.pi * rho * np.arange(150)
    circle = [np.cos(phase) + 0.2 * np.cos(2 * phase), np.exp(np.sin(phase))]
    curve = invariant_curve(np.stack(circle, axis=1))
    assert curve.rotation == pytest.approx(rho, abs=1e-13)
    assert curve.residual < 2.5e-12  # measured 8.4e-13


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (np.ones((99, 2)), "100 finite points"),
        (np.full((200, 2), np.nan), "100 finite points"),
        (np.ones((200, 2)), "all the same"),
    ],
)
def test_points_of_no_curve_are_refused(points: Array, words: str) -> None:
    with pytest.raises(InputError, match=words):
        invariant_curve(points)


def test_the_shared_integral_is_twice_the_rubber_balls_energy() -> None:
    """Along 20 s with Ω = K = 0; that a classical ball keeps it is a claim of the paper's."""
    rubber = ball((0.8, 0.6, 0.7), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    start = along_momentum(*section_state(1.0, 2.0, 0.0, F))
    axes = rotation_matrix(
        orbit(rubber, start.attitude, start.momentum, np.linspace(0.0, 20.0, 200))[0]
    )
    gamma, M = axes[:, 2], start.momentum @ axes
    omega = rubber.angular_velocity(tuple(M.T), tuple(gamma.T))
    E = eq.energy(omega, tuple(gamma.T), rubber.Omega, rubber.A, rubber.d, False)
    J = shared_integral(rubber, gamma, np.cross(M, gamma))
    # Measured 2e-15 and 2.9e-15: the tolerance of the steps.
    assert 2 * np.asarray(E) == pytest.approx(J, rel=2e-14)
    assert np.ptp(J) < 1e-14 * J[0]

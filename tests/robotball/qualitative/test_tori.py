"""Invariant tori: the curves that they cut from a section, and those that two balls share."""

from dataclasses import replace

import numpy as np
import pytest

from robotball import equations as eq
from robotball import load_scene
from robotball.engines.ensembles.orbits import orbits
from robotball.equations import Parameters, as_vector
from robotball.errors import InputError
from robotball.qualitative.basins import level_points
from robotball.qualitative.sections import section, section_starts
from robotball.qualitative.tori import invariant_curve, shared_integral
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


# Shared tori, introduction, 3 --------------------------------------------------------------

RUBBER = ball((0.8, 0.6, 0.7), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def classical_partner(rubber: Parameters, d: float, s: float) -> Parameters:
    """The classical Chaplygin ball with A' = E/d - sA and this d [kg m²], A the rubber ball's."""
    A = 1 / d - s * np.array(rubber.A)
    return Parameters("classical", as_vector(1 / A - d), d, rubber.a, rubber.Omega, rubber.K)


def states(some: Parameters, seed: int) -> tuple[Array, Array, Array]:
    """γ, M and ℓ (200, 3) along a motion of 20 s from a random start with (ℓ, γ) = 0."""
    random = np.random.default_rng(seed)
    gamma, level = section_state(random.uniform(-4, 4), random.uniform(-3, 3), 0.0, 25.0)
    M = np.cross(gamma, level) if some.rolling == "rubber" else level
    start = along_momentum(gamma, M)
    times = np.linspace(0.0, 20.0, 200)
    found = orbits(some, start.attitude[None], start.momentum[None], times)
    axes = rotation_matrix(found.attitudes[0])
    M = np.einsum("nji,j->ni", axes, start.momentum)
    return axes[:, 2], M, np.cross(M, axes[:, 2]) if some.rolling == "rubber" else M


def energy(some: Parameters, gamma: Array, M: Array) -> Array:
    omega = some.angular_velocity(tuple(M.T), tuple(gamma.T))
    spinning = some.rolling == "classical"
    return np.asarray(eq.energy(omega, tuple(gamma.T), some.Omega, some.A, some.d, spinning))


@pytest.mark.parametrize("seed", range(2))
def test_each_ball_keeps_the_others_energy(seed: int) -> None:
    """J along both motions, to the tolerance of the steps: measured 2.9e-15 of J at most.

    2E = J of the rubber ball and 2E' = ℓ²/d' - sJ of the classical one: measured 2e-15 of them.
    With one moment of A' off by 1 %, a control, J changes by 0.005.
    """
    partner = classical_partner(RUBBER, 0.9, 0.5)
    gamma, M, level = states(RUBBER, seed)
    J = shared_integral(RUBBER, gamma, level)
    assert np.ptp(J) < 1e-14 * J[0]
    assert 2 * energy(RUBBER, gamma, M) == pytest.approx(J, rel=2e-14)
    gamma, M, level = states(partner, seed)
    J = shared_integral(RUBBER, gamma, level)
    assert np.ptp(J) < 1e-14 * J[0]
    assert 2 * energy(partner, gamma, M) == pytest.approx(25.0 / 0.9 - 0.5 * J, rel=2e-14)
    A = np.array(partner.A) * [1.0, 1.01, 1.0]
    gamma, _, level = states(replace(partner, I=as_vector(1 / A - partner.d)), 1)
    J = shared_integral(RUBBER, gamma, level)
    assert np.ptp(J) > 3e-3 * J[0]


def test_the_catalogs_two_balls_are_partners_on_one_torus() -> None:
    """The same A', the same γ and ℓ at the start, to rounding."""
    rubber, classical = load_scene("rubber_chaplygin_ball"), load_scene("chaplygin_ball_same_tori")
    partner = classical_partner(rubber.parameters, classical.parameters.d, 0.5)
    assert pytest.approx(partner.A, abs=1e-15) == classical.parameters.A
    vectors = []
    for scene in (rubber, classical):
        axes = rotation_matrix(scene.start.attitude)
        M, gamma = axes.T @ scene.start.momentum, axes[2]
        vectors.append([gamma, np.cross(M, gamma) if scene is rubber else M])
    assert np.subtract(*vectors) == pytest.approx(np.zeros((2, 3)), abs=1e-14)

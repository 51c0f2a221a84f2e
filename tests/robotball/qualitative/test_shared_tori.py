"""The rubber and the classical Chaplygin ball on the same tori: introduction, 3."""

from dataclasses import replace

import numpy as np
import pytest

from robotball import equations as eq
from robotball import load_scene
from robotball.engines.ensembles.orbits import orbits
from robotball.equations import Parameters, as_vector
from robotball.qualitative.tori import shared_integral
from robotball.rotations import Array, rotation_matrix
from robotball.scene import along_momentum, section_state
from tests.figures import ball

RUBBER = ball((0.8, 0.6, 0.7), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


def classical_partner(rubber: Parameters, d: float, s: float) -> Parameters:
    """The classical Chaplygin ball with A' = E/d - sA and this d [kg m²], A the rubber ball's."""
    A = 1 / d - s * np.array(rubber.A)
    return Parameters("classical", as_vector(1 / A - d), d, rubber.a, rubber.Omega, rubber.K)


def states(some: Parameters, seed: int) -> tuple[Array, Array, Array]:
    """γ, M and ℓ (500, 3) along a motion of 50 s from a random start with (ℓ, γ) = 0."""
    random = np.random.default_rng(seed)
    gamma, level = section_state(random.uniform(-4, 4), random.uniform(-3, 3), 0.0, 25.0)
    M = np.cross(gamma, level) if some.rolling == "rubber" else level
    start = along_momentum(gamma, M)
    times = np.linspace(0.0, 50.0, 500)
    found = orbits(some, start.attitude[None], start.momentum[None], times)
    axes = rotation_matrix(found.attitudes[0])
    M = np.einsum("nji,j->ni", axes, start.momentum)
    return axes[:, 2], M, np.cross(M, axes[:, 2]) if some.rolling == "rubber" else M


def energy(some: Parameters, gamma: Array, M: Array) -> Array:
    omega = some.angular_velocity(tuple(M.T), tuple(gamma.T))
    spinning = some.rolling == "classical"
    return np.asarray(eq.energy(omega, tuple(gamma.T), some.Omega, some.A, some.d, spinning))


@pytest.mark.parametrize("seed", range(4))
def test_each_ball_keeps_the_others_energy(seed: int) -> None:
    """J along both motions, to the tolerance of the steps: measured 2.7e-14 of J at most."""
    partner = classical_partner(RUBBER, 0.9, 0.5)
    for some in (RUBBER, partner):
        gamma, _, level = states(some, seed)
        J = shared_integral(RUBBER, gamma, level)
        assert np.ptp(J) < 1e-13 * J[0]


def test_the_energies_are_halves_of_it() -> None:
    """2E = J of the rubber ball, 2E' = ℓ²/d' - sJ of the classical: measured 2e-15 of them."""
    partner = classical_partner(RUBBER, 0.9, 0.5)
    gamma, M, level = states(RUBBER, 1)
    assert 2 * energy(RUBBER, gamma, M) == pytest.approx(
        shared_integral(RUBBER, gamma, level), rel=2e-14
    )
    gamma, M, level = states(partner, 1)
    expected = 25.0 / 0.9 - 0.5 * shared_integral(RUBBER, gamma, level)
    assert 2 * energy(partner, gamma, M) == pytest.approx(expected, rel=2e-14)


def test_another_classical_ball_does_not_keep_it() -> None:
    """A control: with one moment of A' off by 1 % J changes, measured 0.005."""
    partner = classical_partner(RUBBER, 0.9, 0.5)
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
        vectors.append((gamma, np.cross(M, gamma) if scene is rubber else M))
    assert vectors[0][0] == pytest.approx(vectors[1][0], abs=1e-14)
    assert vectors[0][1] == pytest.approx(vectors[1][1], abs=1e-14)

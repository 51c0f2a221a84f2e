"""Straight-line motions: their properties, their number, and their stability."""

from dataclasses import replace

import numpy as np
import pytest

from robotball.dynamics.straight_motions import (
    StraightMotion,
    name_of_line,
    stability_limit,
    straight_motion,
    straight_motions,
)
from robotball.errors import InputError
from robotball.robot.formulas import Parameters, as_vector
from robotball.robot.scene import along_momentum
from robotball.theory.ensembles.orbits import orbit
from tests.figures import CLASSICAL, ball, from_rest
from tests.messages import naming

FIG10 = ball((0.5, 0.3, 0.6), (0.0, 0.0, 1.0), (4.0, 5.0, 0.0), d=0.1)
GAMMA = np.array([0.6, 0.48, 0.64])


@pytest.mark.parametrize(
    ("parameters", "motion"),
    [
        pytest.param(FIG10, straight_motions(FIG10, 3.0)[1], id="rubber"),
        pytest.param(CLASSICAL, straight_motion(CLASSICAL, GAMMA), id="classical"),
    ],
)
def test_the_ball_rolls_straight_at_constant_speed(
    parameters: Parameters, motion: StraightMotion
) -> None:
    """At a|γ×Ω| along one line; rounding grows to 1e-14.

    The eigenvalues add up to the divergence at γ and are the roots of the polynomial.
    """
    start = along_momentum(motion.gamma, motion.momentum)
    path = orbit(parameters, start.attitude, start.momentum, np.linspace(0.0, 2.0, 11))[:, 4:]
    steps = np.diff(path, axis=0)
    assert np.abs(steps - steps[0]).max() < 1e-12
    assert np.linalg.norm(steps[0]) / 0.2 == pytest.approx(motion.speed, rel=1e-12)
    across = np.linalg.norm(np.cross(parameters.Omega, motion.gamma))
    assert motion.speed == pytest.approx(parameters.a * across, rel=1e-15)
    divergence = parameters.divergence(as_vector(motion.gamma))
    assert motion.eigenvalues.sum() == pytest.approx(divergence, abs=1e-13)
    assert np.abs(np.polyval(motion.polynomial, motion.eigenvalues)).max() < 1e-12


def test_straight_motions_have_the_names_of_proposition_3() -> None:
    """(K, γ) and (K×Ω, γ) have the signs of c₁ and c₂ for a rubber ball with (K, Ω) = 0."""
    named = {
        name_of_line(FIG10, motion.gamma): motion.gamma for motion in straight_motions(FIG10, 3.0)
    }
    signs = {"σ₊": (1, 1), "σ₋": (-1, 1), "δ₊": (1, -1), "δ₋": (-1, -1)}
    # K = (4, 5, 0), K×Ω = (5, -4, 0).
    along = {name: (gamma @ (4, 5, 0), gamma @ (5, -4, 0)) for name, gamma in named.items()}
    assert {name: tuple(np.sign(parts)) for name, parts in along.items()} == signs
    tilted, still = replace(FIG10, K=(4.0, 5.0, 3.0)), replace(FIG10, Omega=(0.0, 0.0, 0.0))
    for other in (tilted, still, replace(FIG10, rolling="classical")):
        assert name_of_line(other, named["σ₊"]) == ""


def test_there_are_four_straight_motions_on_a_level() -> None:
    """Σ¹ meets M² = f in σ₊, σ₋, δ₊ and δ₋ if 0 < f < K², and otherwise not."""
    motions = straight_motions(FIG10, 3.0)
    assert len(motions) == 4
    for motion in motions:
        assert motion.momentum @ motion.momentum == pytest.approx(3.0, rel=1e-12)
        assert motion.gamma @ FIG10.Omega == pytest.approx(0.0, abs=1e-15)
    apart = [np.linalg.norm(a.gamma - b.gamma) for a in motions for b in motions if a is not b]
    assert min(apart) > 0.1
    assert straight_motions(FIG10, 41.1) == []
    # If K has a component along Ω, f has a lower bound, too: here 50 - 41.
    tilted = replace(FIG10, K=(4.0, 5.0, 3.0))
    assert [len(straight_motions(tilted, f)) for f in (8.9, 9.1)] == [0, 4]


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_the_stability_region_of_fig9_agrees_with_the_eigenvalues(axis: int) -> None:
    """For 30 random balls with Ω along each axis, the closed form and the eigenvalues agree.

    At f = 0.01, 0.99 and 1.01 of the limit, which the eigenvalues resolve, and at f = K²/2.
    """
    rng = np.random.default_rng(9)
    stable = 0
    for _ in range(30):
        A, Omega, K = rng.uniform(0.2, 1.0, 3), np.zeros(3), rng.uniform(-5.0, 5.0, 3)
        Omega[axis], K[axis] = rng.uniform(-3.0, 3.0), 0.0
        parameters = ball(as_vector(A), as_vector(Omega), as_vector(K), d=0.01)
        limit = stability_limit(parameters)
        assert limit is not None
        for f in (float(K @ K) / 2, 0.01 * limit, 0.99 * limit, 1.01 * limit):
            for motion in straight_motions(parameters, f) if f > 0 else []:
                side = (motion.momentum @ Omega) * (motion.gamma @ K)
                assert motion.is_stable == (f < limit and side < 0)
                stable += motion.is_stable
    assert stable > 30


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_the_polynomial_for_K_not_orthogonal_to_omega(axis: int) -> None:
    """With Ω along an axis and any K, c₁ has the extra term -Ω_lK_l beside a_lp², to 1e-9.

    So stability depends on Ω_lK_l and M_l² = f - K_l² only: the limit is 1.8132 for the ball of
    Fig. 10 at a product of 2, and 1.9461 at 1.
    """
    rng, (j, k) = np.random.default_rng(4), ((axis + 1) % 3, (axis + 2) % 3)
    for _ in range(20):
        A, Omega, K = rng.uniform(0.2, 1.0, 3), np.zeros(3), rng.uniform(-5.0, 5.0, 3)
        Omega[axis] = rng.uniform(-3.0, 3.0)
        parameters = ball(as_vector(A), as_vector(Omega), as_vector(K), d=0.01)
        for motion in straight_motions(
            parameters, float(K[axis] ** 2 + rng.uniform(0.0, K[j] ** 2))
        ):
            gamma, p, m = motion.gamma, motion.gamma @ K, motion.momentum[axis]
            N, turning, both = gamma @ (A * gamma), Omega[axis], A[j] * A[k]
            formula = [
                N,
                turning * (A[j] - A[k]) * gamma[j] * gamma[k],
                both * (A[axis] * p * p - turning * K[axis]),
                -turning * both * A[axis] * p * m,
            ]
            assert motion.polynomial * N == pytest.approx(formula, abs=1e-9)
    for Omega3, K3, limit in ((1.0, 2.0, 1.8132), (4.0, 0.5, 1.8132), (1.0, 1.0, 1.9461)):
        parameters = replace(FIG10, Omega=(0.0, 0.0, Omega3), K=(4.0, 5.0, K3))
        for m, stable in ((limit - 1e-4, 2), (limit + 1e-4, 0)):
            assert sum(line.is_stable for line in straight_motions(parameters, K3**2 + m)) == stable


def test_balls_without_a_stability_limit() -> None:
    """None is stable for one sign of K₁K₂; a classical ball or other K have no formula."""
    assert stability_limit(replace(FIG10, K=(4.0, -5.0, 0.0))) == 0.0
    for parameters in (CLASSICAL, from_rest(0.3), replace(FIG10, K=(4.0, 5.0, 0.1))):
        assert stability_limit(parameters) is None


def test_impossible_straight_motions_are_refused() -> None:
    """A rubber ball whose Ω has a vertical component; levels of a ball with Ω = 0."""
    with pytest.raises(InputError, match=naming("straight")):
        straight_motion(FIG10, GAMMA)
    with pytest.raises(InputError, match=naming("Omega")):
        straight_motions(replace(FIG10, Omega=(0.0, 0.0, 0.0)), 3.0)


def test_at_most_two_of_four_straight_motions_are_stable() -> None:
    """60 random balls with f between (K, Ω)²/Ω² and K²: four lines, of which 0 or 2 are stable.

    Along the circle (Ω, γ) = 0 an eigenvalue changes its sign where M² is extremal.
    """
    rng, counts = np.random.default_rng(1), set()
    for _ in range(60):
        A, Omega, K = rng.uniform(0.2, 1.0, 3), rng.normal(size=3), 3 * rng.normal(size=3)
        f = float(rng.uniform((K @ Omega) ** 2 / (Omega @ Omega), K @ K))
        parameters = ball(as_vector(A), as_vector(Omega), as_vector(K), d=0.01)
        lines = straight_motions(parameters, f)
        product = [np.sign(line.polynomial[-1]) for line in lines]
        assert sorted(product) == [-1, -1, 1, 1]
        counts.add(sum(line.is_stable for line in lines))
    assert counts == {0, 2}

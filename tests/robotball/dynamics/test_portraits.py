"""Phase portraits of the motion from rest, and the map of the sphere on which they are drawn."""

import numpy as np
import pytest

from robotball.dynamics.cycles import involute, limit_cycles
from robotball.dynamics.equilibria import closed_form_points
from tests.figures import ball, from_rest


def test_with_time_reversed_the_multiplier_of_the_cycle_is_inverted() -> None:
    """For Fig. 8's ball; the cycle then attracts."""
    (backwards,) = limit_cycles(ball((0.5, 0.4, 0.3), (-4.0, -2.0, -1.0), (0.0, 0.0, -3.0)))
    (forwards,) = limit_cycles(from_rest(3.0))
    assert abs(backwards.multipliers[0]) < 1
    assert backwards.multipliers[0] * forwards.multipliers[0] == pytest.approx(1, abs=1e-8)


def test_a_closed_orbit_of_an_integrable_ball_is_not_a_limit_cycle() -> None:
    """With K = 0 and Ω = 0 there are families of closed orbits, which do not count."""
    assert limit_cycles(from_rest(0.0)) == []
    assert limit_cycles(ball((0.5, 0.4, 0.3), (0.0, 0.0, 0.0), (1.0, 2.0, 0.5))) == []


def test_a_cycle_that_attracts_no_start_is_found_once_with_its_period() -> None:
    """It closes after 0.65913 s, and is not reported with multiples or fractions of the period."""
    rng = np.random.default_rng(5)
    A, Omega, K = rng.uniform(0.25, 1, 3), 2 * rng.normal(size=3), rng.normal(size=3)
    parameters = ball(tuple(A), tuple(Omega), tuple(K * 10 ** rng.uniform(-1.5, 1)), d=0.01)
    (cycle,) = limit_cycles(parameters, 60.0)
    assert cycle.period == pytest.approx(0.659134, abs=1e-6)
    assert cycle.multipliers[0].real == pytest.approx(1.0264, abs=1e-4)


def test_a_search_with_zero_correction_ends_without_a_cycle() -> None:
    """The correction from half a period is exactly zero here; it was once divided by."""
    cycles = limit_cycles(ball((0.5, 0.4, 0.3), (4.0, 2.0, 0.869565), (0.0, 0.0, 1.95652)))
    assert [cycle.period for cycle in cycles] == [pytest.approx(8.577869, abs=1e-5)]


# Unrolling the sphere ----------------------------------------------------------------------


def test_the_map_shows_fig_6s_points_where_the_paper_does() -> None:
    """θ and δ are a quarter of a turn apart."""
    points = closed_form_points(from_rest(0.3))
    expected = {"δ₁": 1.25, "δ₂": 0.25, "δ₃": 0.25, "δ₄": 1.25,
                "θ₁": 1.75, "θ₂": 0.75, "θ₃": 0.75, "θ₄": 1.75}  # fmt: skip
    phi = {name: involute(points[name])[0] / np.pi for name in expected}
    assert phi == pytest.approx(expected)


def test_the_involute_preserves_areas() -> None:
    gamma = np.random.default_rng(0).normal(size=(40_000, 3))
    gamma /= np.linalg.norm(gamma, axis=1, keepdims=True)
    phi, height = np.array([involute(v) for v in gamma]).T
    counts = np.histogram2d(phi, height, bins=4, range=((0, 2 * np.pi), (-1, 1)))[0]
    assert counts == pytest.approx(2500, abs=200)  # four standard errors of 50


def test_a_line_on_the_involute_is_cut_and_not_drawn_across() -> None:
    turn = np.linspace(0.0, 2 * np.pi, 200)
    phi = involute(np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1))[:, 0]
    assert np.isnan(phi).sum() == 1
    assert np.nanmax(np.abs(np.diff(phi))) < 0.05

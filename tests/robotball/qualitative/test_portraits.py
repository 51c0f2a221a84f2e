"""Phase portraits of the motion from rest, and the unrolled sphere on which they are drawn."""

import numpy as np
import pytest

from robotball.qualitative.equilibria import closed_form_points
from robotball.qualitative.portraits import involute
from tests.figures import from_rest

# Unrolling the sphere ----------------------------------------------------------------------


def test_the_involute_has_the_points_of_fig_6_where_the_paper_has_them() -> None:
    """θ and δ stand a quarter turn apart."""
    points = closed_form_points(from_rest(0.3))
    expected = {"δ₁": 1.25, "δ₂": 0.25, "δ₃": 0.25, "δ₄": 1.25,
                "θ₁": 1.75, "θ₂": 0.75, "θ₃": 0.75, "θ₄": 1.75}  # fmt: skip
    phi = {name: involute(points[name])[0] / np.pi for name in expected}
    assert phi == pytest.approx(expected)


def test_the_involute_preserves_areas() -> None:
    gamma = np.random.default_rng(0).normal(size=(40_000, 3))
    gamma /= np.linalg.norm(gamma, axis=1, keepdims=True)
    phi, height = np.array([involute(each) for each in gamma]).T
    counts = np.histogram2d(phi, height, bins=4, range=((0, 2 * np.pi), (-1, 1)))[0]
    assert counts == pytest.approx(2500, abs=200)  # four standard errors of 50


def test_a_line_on_the_involute_is_cut_and_not_drawn_across() -> None:
    turn = np.linspace(0.0, 2 * np.pi, 200)
    phi = involute(np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1))[:, 0]
    assert np.isnan(phi).sum() == 1
    assert np.nanmax(np.abs(np.diff(phi))) < 0.05

"""The manifolds of the saddles of (4.1)."""

import numpy as np

from robotball.qualitative.equilibria import fixed_points, flow
from robotball.qualitative.portraits import separatrices
from tests.figures import from_rest


def test_every_saddle_has_four_manifolds_along_the_flow() -> None:
    """They leave the saddle by 1e-4, and dγ/dt is along them, or against them where stable."""
    ball = from_rest(0.3)
    points = fixed_points(ball)
    found = separatrices(ball, points, 100.0)
    assert len(found) == 4 * sum(point.kind == "saddle" for point in points)
    for each in found:
        assert np.linalg.norm(each.path[0] - each.saddle.gamma) < 1.1e-4
        middle = len(each.path) // 2
        step = each.path[middle + 1] - each.path[middle - 1]
        rate = np.array(flow(ball, tuple(each.path[middle])))
        if np.linalg.norm(rate) > 1e-3:
            along = step @ rate / np.linalg.norm(step) / np.linalg.norm(rate)
            assert along * (-1 if each.stable else 1) > 0.99


def test_without_saddles_there_are_none() -> None:
    """Fig. 8: K₃ = 3."""
    ball = from_rest(3.0)
    assert separatrices(ball, fixed_points(ball), 10.0) == []

"""The phase portrait of (4.1): limit cycles, and the manifolds of the saddles."""

import numpy as np
import pytest

from robotball.engines.ensembles.orbits import orbit
from robotball.equations import as_vector
from robotball.qualitative.equilibria import attitude_at, fixed_points, flow
from robotball.qualitative.portraits import limit_cycles, separatrices
from robotball.rotations import rotation_matrix
from tests.figures import from_rest


def test_a_cycles_multiplier_is_how_its_neighbours_part() -> None:
    """Fig. 8: a neighbour 1e-6 away is 2.28 times as far off after a period, to 1e-4."""
    some = from_rest(3.0)
    (cycle,) = limit_cycles(some)
    rate = np.array(flow(some, as_vector(cycle.gamma)))
    across = np.cross(cycle.gamma, rate / np.linalg.norm(rate))
    ends, times = [], np.array([0.0, cycle.period])
    for gamma in (cycle.gamma, cycle.gamma + 1e-6 * across):
        attitude = attitude_at(gamma / np.linalg.norm(gamma))
        ends.append(rotation_matrix(orbit(some, attitude, np.zeros(3), times)[0])[-1, 2])
    assert np.abs(ends[0] - cycle.gamma).max() < 1e-10
    assert (ends[1] - ends[0]) @ across / 1e-6 == pytest.approx(cycle.multipliers[0].real, rel=1e-4)


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
    # Fig. 8's ball has no saddle.
    assert separatrices(from_rest(3.0), fixed_points(from_rest(3.0)), 10.0) == []

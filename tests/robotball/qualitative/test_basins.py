"""Which attractor a start reaches, told in two ways."""

import numpy as np
import pytest

from robotball.qualitative.basins import CHAOS, LINE, LOST, TORUS, basins
from robotball.qualitative.long_run import drift
from robotball.qualitative.sections import section_starts
from robotball.rotations import Array
from tests.figures import CHAOTIC, REGULAR, F, ball


def some_starts(n: int) -> tuple[Array, Array]:
    """Attitudes (n, 4) and momenta (n, 3) all over the section g = 0."""
    rng = np.random.default_rng(2)
    return section_starts(rng.uniform(-4.9, 4.9, n), rng.uniform(0, 6.28, n), F)


@pytest.mark.slow
def test_fig11a_has_two_attractors() -> None:
    """Some 40 % of the starts reach the cycle, the rest the torus; each drifts as its attractor.

    Along OX at 3.65907 and 3.66517 m/s: a mean over 1e4 s tells them apart, to 3e-4.
    """
    starts = some_starts(64)
    found = basins(REGULAR, *starts)
    assert [cycle.period for cycle in found.cycles] == pytest.approx([8.7432614], abs=1e-6)
    assert 0.2 < found.share(0) < 0.6
    assert found.share(0) + found.share(TORUS) == 1
    speeds = drift(REGULAR, *starts, duration=1e4, transient=3000.0).velocities[:, 0]
    assert np.abs(speeds[found.labels == 0] - 3.65907).max() < 1e-3
    assert np.abs(speeds[found.labels == TORUS] - 3.66517).max() < 1e-3


def test_fig11b_has_one_strange_attractor() -> None:
    """Every start ends in the chaos."""
    assert basins(CHAOTIC, *some_starts(32)).share(CHAOS) == 1


@pytest.mark.parametrize(("f", "label"), [(2.0, LINE), (3.0, LOST)])
def test_fig10s_ball_ends_on_a_straight_line_while_that_is_stable(f: float, label: int) -> None:
    """Below f = 2.0806 every start does; above, it moves near one and never crosses g = 0."""
    some = ball((0.5, 0.3, 0.6), (0.0, 0.0, 1.0), (4.0, 5.0, 0.0))
    rng = np.random.default_rng(3)
    starts = section_starts(rng.uniform(-1, 1, 12) * np.sqrt(f), rng.uniform(0, 6.28, 12), f)
    assert basins(some, *starts).share(label) == 1

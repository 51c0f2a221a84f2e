"""Which attractor each of some starts reaches."""

import numpy as np
import pytest

from robotball.qualitative.basins import CHAOS, LINE, LOST, TORUS, basins
from robotball.qualitative.long_run import drift
from robotball.qualitative.sections import section_starts
from tests.figures import CHAOTIC, REGULAR, ball, spread_starts


def test_fig11a_has_two_attractors() -> None:
    """Of 8 starts some reach the cycle, the rest the torus, and each drifts as its attractor.

    Along OX, 6 mm/s apart; a mean over 2000 s tells them apart, and the cycle's is its period's.
    """
    starts = spread_starts(2, 8, most=4.9)
    found = basins(REGULAR, *starts)
    (cycle,) = found.cycles
    assert 0 < found.share(0) < 1
    assert found.share(0) + found.share(TORUS) == 1
    once = drift(REGULAR, cycle.attitude[None], cycle.momentum[None], cycle.period, cycle.period)
    assert once.mean[1] == pytest.approx(0.0, abs=1e-8)
    means = drift(REGULAR, *starts, duration=2000.0, transient=3000.0)
    near = np.abs(means.velocities[:, 0] - once.mean[0]) < 2e-3
    assert np.array_equal(near, found.labels == 0)
    assert means.error == pytest.approx(np.std(means.velocities, axis=0, ddof=1) / np.sqrt(8))


def test_fig11b_has_one_strange_attractor() -> None:
    """Every start ends in the chaos."""
    assert basins(CHAOTIC, *spread_starts(2, 8, most=4.9)).share(CHAOS) == 1


@pytest.mark.parametrize(("f", "label"), [(2.0, LINE), (3.0, LOST)])
def test_fig10s_ball_ends_on_a_straight_line_while_that_is_stable(f: float, label: int) -> None:
    """Below f = 2.0806 every start does; above, it moves near one and never crosses g = 0."""
    some = ball((0.5, 0.3, 0.6), (0.0, 0.0, 1.0), (4.0, 5.0, 0.0))
    rng = np.random.default_rng(3)
    starts = section_starts(rng.uniform(-1, 1, 4) * np.sqrt(f), rng.uniform(0, 6.28, 4), f)
    assert basins(some, *starts).share(label) == 1

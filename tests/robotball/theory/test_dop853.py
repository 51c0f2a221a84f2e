"""The integrator's own rounding, and its table."""

from functools import partial

import numpy as np
import pytest
from scipy.integrate import DOP853

from robotball.theory import dop853
from robotball.theory.dop853 import Compensated, one_by_one

pytestmark = pytest.mark.core


def test_a_long_sum_rounds_once() -> None:
    """A path of a thousand steps, a million away from zero, ends within half its last place.

    A plain sum is five places (5.8e-10) off there.
    """
    far = np.array([1e6])
    path = Compensated(
        partial(one_by_one, lambda t, _: np.array([np.cos(t)])),
        0.0,
        10.0,
        far,
        1.0,
        np.ones(1),
        longest=0.01,
    )
    while path.t < path.end:
        path.step()
    assert abs(path.state[0] - (1e6 + np.sin(10.0))) <= np.spacing(1e6) / 2


def test_the_table_is_that_of_scipy() -> None:
    """To the last bit: nodes and weights of all stages, both errors and the interpolant."""
    nodes = [*DOP853.C[1:], 1.0, *DOP853.C_EXTRA, *np.zeros(6)]
    rows = [*DOP853.A[1:], DOP853.B, *DOP853.A_EXTRA, DOP853.E5, DOP853.E3, *DOP853.D]
    padded = [[*row, *np.zeros(16 - len(row))] for row in rows]
    np.testing.assert_array_equal(dop853._TABLE, np.column_stack([nodes, padded]))

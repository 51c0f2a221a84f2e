"""The integrator's own rounding."""

from functools import partial

import numpy as np
import pytest

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

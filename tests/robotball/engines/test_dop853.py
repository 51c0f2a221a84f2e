"""DOP853 with a compensated sum: order, and rounding that does not grow."""

import numpy as np
import pytest

from robotball.engines import Compensated
from robotball.rotations import Array

pytestmark = pytest.mark.core


def turn(_: float, state: Array) -> Array:
    return np.array([-state[1], state[0]])


def on_circle(t: float) -> Array:
    return np.array([np.cos(t), np.sin(t)])


def error_after(duration: float, tolerance: float, max_step: float = np.inf) -> float:
    motion = Compensated(turn, (0.0, duration), on_circle(0.0), tolerance, np.ones(2), max_step)
    while motion.running:
        assert motion.step() is None
    return float(np.linalg.norm(motion.state - on_circle(duration)))


def test_steps_of_one_length_are_of_order_eight() -> None:
    """Measured 7.98: the errors at steps of 1/2 and 1/4, far above rounding."""
    coarse, fine = (error_after(10.0, 1e3, step) for step in (0.5, 0.25))
    assert np.log2(coarse / fine) == pytest.approx(8.0, abs=0.05)


def test_a_long_sum_rounds_once() -> None:
    """A path of a thousand steps, a million away from zero, ends within half its last place.

    A plain sum is five places (5.8e-10) off there.
    """
    far = np.array([1e6])
    path = Compensated(
        lambda t, _: np.array([np.cos(t)]), (0.0, 10.0), far, 1.0, np.ones(1), max_step=0.01
    )
    while path.running:
        path.step()
    assert abs(path.state[0] - (1e6 + np.sin(10.0))) <= np.spacing(1e6) / 2

"""The compiled step: its order, and the conditions that its numbers satisfy."""

from fractions import Fraction

import numpy as np
import pytest

from robotball.rotations import Array
from robotball.theory.ensembles import steppers
from robotball.theory.ensembles.orbits import Starts
from robotball.theory.ensembles.steppers import EIGHTH, NINTH, PATH, STAGES, Level, State
from tests.figures import REGULAR, spread_starts

pytestmark = pytest.mark.core


def test_the_step_and_its_estimate_are_of_order_9() -> None:
    """The error of fixed steps falls as their ninth power: measured 9.3, the estimated one 9.0."""
    attitudes, momenta = spread_starts(7, 1, g=1.0)
    level = Level(m=float(np.linalg.norm(momenta)), c=0.0)
    begin = [*Starts(REGULAR, attitudes, momenta).attitudes[0], 0.0, 0.0]

    def rate(state: State) -> State:
        return PATH.rate(state, REGULAR, level)

    def end(steps: int) -> tuple[Array, float]:
        state, per_squared = begin, []
        for _ in range(steps):
            state, each = steppers.runge_kutta(rate, state, rate(state), 2.0 / steps, PATH.allowed)
            per_squared.append(each)
        return np.array(state), float(max(per_squared)) ** -0.5

    def order(errors: list[float]) -> float:
        return float(-np.polyfit(np.log(steps), np.log(errors), 1)[0])

    steps, right = np.array([20, 28, 40]), end(120)[0]
    assert order([np.abs(end(n)[0] - right).max() for n in steps]) == pytest.approx(9, abs=0.4)
    assert order([end(n)[1] for n in steps]) == pytest.approx(9, abs=0.2)


@pytest.mark.parametrize(("weights", "order"), [(NINTH, 9), (EIGHTH, 8)])
def test_verners_numbers_satisfy_the_conditions_of_their_order(
    weights: tuple[float, ...], order: int
) -> None:
    """Quadrature of exactly the powers below the order, and the conditions on the stages.

    Evaluated in fractions, so only the rounding of the coefficients remains.
    """
    rows = [(*row, *[0.0] * (16 - len(row))) for row in ((), *STAGES)]
    A = np.array([[Fraction(number) for number in row] for row in rows])
    c, b = A.sum(axis=1), np.array([Fraction(number) for number in weights])
    gaps = np.array([b @ c**k - Fraction(1, k + 1) for k in range(order + 1)])
    assert np.abs(gaps[:-1]).max() < 2e-15  # 1.3e-15
    assert abs(gaps[-1]) > 1e-6
    # Stages: order 2 from the third on, order 3 from the fourth; stages of lower order have no
    # weight.
    assert np.abs((A @ c - c**2 / 2)[2:]).max() < 5e-15  # 3.3e-15
    assert np.abs((A @ c**2 - c**3 / 3)[3:]).max() < 6e-15  # 4.8e-15
    assert np.abs(b[1:3]).max() == 0
    assert np.abs(b @ A - b * (1 - c)).max() < 1e-15  # 4.9e-16

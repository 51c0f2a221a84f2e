"""Long motions: exponents compared with neighbouring motions, and attractors."""

from functools import partial

import numpy as np
import pytest

from robotball.dynamics.cycles import monodromy_of
from robotball.dynamics.long_run import LINE, LOST, Exponents, basins, exponents_of
from robotball.dynamics.sections import section_starts
from robotball.errors import InputError
from robotball.robot.formulas import Parameters
from robotball.rotations import conjugate, multiply, rotation_matrix
from robotball.theory.ensembles.orbits import Starts, orbit
from robotball.theory.ensembles.steppers import DEVIATION
from tests.figures import BALLS, REGULAR, ball, spread_starts
from tests.messages import naming

pytestmark = pytest.mark.core

some_starts = partial(spread_starts, 5)


@pytest.mark.parametrize(("ball", "c"), BALLS)
def test_a_deviation_is_the_difference_of_neighbouring_motions(ball: Parameters, c: float) -> None:
    """ξ and its growth after 5 s, compared with starts rotated by ±1e-5 ξ.

    Measured 1.7e-8 of 11: the error of the difference. The volume of three rotations changes as ∫
    div, apart from the density of Remark 5 at both ends: measured 1.8e-12, the steps' error.
    """
    (attitude,), (momentum,) = some_starts(1, c)
    xi, step, times = np.array([0.6, 0.48, 0.64]), 1e-5, np.array([0.0, 5.0])
    starts = Starts(ball, attitude[None], momentum[None])
    end = starts.march(DEVIATION, np.array([[*xi, 0, 0]]), times[1:], 1e-14)[0][0, 0]
    ends = []
    for side in (xi, -xi):
        turn = np.array([1.0, *(step / 2 * side)])
        ahead = multiply(attitude, turn / np.linalg.norm(turn))
        ends.append(orbit(ball, ahead, momentum, times)[-1, :4])
    w, *parted = multiply(conjugate(ends[1]), ends[0])
    expected = np.sign(w) * np.array(parted) / step
    assert np.exp(end[7]) * end[4:7] == pytest.approx(expected, abs=5e-8)
    later, monodromy, volume = monodromy_of(ball, attitude, momentum, times[1])
    verticals = (rotation_matrix(q)[2] for q in (attitude, later))
    weights = [v * ball.A @ v - (c > 0) / ball.d for v in verticals]
    grown = volume + np.log(weights[1] / weights[0]) / 2
    assert np.linalg.slogdet(monodromy)[1] == pytest.approx(grown, abs=6e-12)


def test_means_over_runs_have_standard_errors() -> None:
    """Exponents of three runs: mean, standard error and the section's dimension.

    1 + λ₁/|λ₆| is 2 for a flow that preserves volume, and 0 without chaos.
    """
    found = Exponents(
        np.array([[0.0, 0.2], [0.2, 0.2], [0.2, 0.4]]), np.array([-0.1, -0.2, -0.3]), 1.0
    )
    assert found.mean == pytest.approx((0.2, -0.4))
    assert found.error == pytest.approx((0.1 / np.sqrt(3), 0.2 / np.sqrt(3)))
    assert found.dimension == pytest.approx(1.5)
    assert found.dimension_error == pytest.approx(0, abs=1e-15)
    assert Exponents(np.array([[0.1, 0.1]]), np.array([0.0]), 1.0).dimension == 2.0
    assert Exponents(np.array([[-0.1, -0.1]]), np.array([-0.3]), 1.0).dimension == 0.0


def test_exponents_need_a_momentum_and_a_duration() -> None:
    with pytest.raises(InputError, match=naming("M")):
        exponents_of(REGULAR, np.eye(4)[:1], np.zeros((1, 3)), duration=10.0)
    with pytest.raises(InputError, match="positive"):
        exponents_of(REGULAR, *some_starts(1), duration=0.0)


# Basins ------------------------------------------------------------------------------------


@pytest.mark.parametrize(("f", "label"), [(2.0, LINE), (3.0, LOST)])
def test_fig10s_ball_ends_on_a_straight_line_while_that_is_stable(f: float, label: int) -> None:
    """For f < 2.0806 from every start; above, it moves near the line and never crosses g = 0."""
    parameters = ball((0.5, 0.3, 0.6), (0.0, 0.0, 1.0), (4.0, 5.0, 0.0))
    rng = np.random.default_rng(3)
    starts = section_starts(rng.uniform(-1, 1, 4) * np.sqrt(f), rng.uniform(0, 6.28, 4), f)
    assert basins(parameters, *starts).share(label) == 1

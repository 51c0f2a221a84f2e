"""Periodic motions: their derivative, their multipliers, and how they are closed."""

import numpy as np
import pytest

from robotball.dynamics.cycles import (
    by_turn,
    close,
    level_vectors,
    monodromy_of,
    multipliers_of,
)
from robotball.errors import InputError
from robotball.robot.formulas import Parameters
from robotball.rotations import rotation_matrix, turned
from robotball.theory.ensembles.orbits import orbits
from tests.figures import BALLS, REGULAR, spread_starts
from tests.messages import naming

pytestmark = pytest.mark.core


@pytest.mark.parametrize(("ball", "c"), BALLS)
def test_the_monodromy_maps_rotations_of_the_start_to_the_end(ball: Parameters, c: float) -> None:
    """Compared with differences of motions that start ±1e-6 rad apart."""
    (attitude,), (momentum,) = spread_starts(2, 1, c, g=1.0)
    end, monodromy, volume = monodromy_of(ball, attitude, momentum, 1.0)
    times, actual = np.array([0.0, 1.0]), np.empty((3, 3))
    for i, axis in enumerate(np.eye(3)):
        both = np.array([turned(attitude, sign * 1e-6 * axis) for sign in (1, -1)])
        ends = orbits(ball, both, np.tile(momentum, (2, 1)), times).attitudes[:, 1]
        ahead, behind = (rotation_matrix(end).T @ rotation_matrix(q) for q in ends)
        turn = (ahead - behind) / 4e-6
        actual[:, i] = turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]
    assert np.abs(actual - monodromy).max() < 1e-8 * np.abs(monodromy).max()  # measured 9e-10
    assert np.isfinite(volume)
    assert np.abs(monodromy - np.eye(3)).max() > 0.1


def test_by_turn_is_the_derivative_of_fixed_vectors_in_the_frame() -> None:
    """Compared with finite differences: dv = v × turn for each vector."""
    (attitude,), (momentum,) = spread_starts(4, 1, 1.0, g=1.0)
    turn = np.array([0.3, -0.5, 0.2])
    ahead, behind = (level_vectors(turned(attitude, s * turn), momentum) for s in (1e-6, -1e-6))
    actual = by_turn(level_vectors(attitude, momentum)) @ turn
    assert np.abs((ahead - behind).ravel() / 2e-6 - actual).max() < 1e-9


def test_multipliers_leave_out_the_one_along_the_motion() -> None:
    """It is 1 up to rounding; the others are sorted, largest first. If M = 0 one is left."""
    V = np.array([[1.0, 0.2, 0.0], [0.3, 1.0, -0.4], [0.1, 0.0, 1.0]])
    for pair in ([0.5, -2.0], [0.9, 0.2]):
        whole = V @ np.diag([1 + 1e-9, *pair]) @ np.linalg.inv(V)
        actual = multipliers_of(whole, 0.0, np.array([1.0, 0.0, 0.0]))
        assert actual == pytest.approx(sorted(pair, key=lambda z: -abs(z)), rel=1e-9)
    rest = multipliers_of(np.eye(3), np.log(0.25), np.zeros(3))
    assert rest == pytest.approx([0.25])


def test_a_motion_that_does_not_close_is_refused() -> None:
    """No period near the given one closes a motion near the start."""
    attitudes, momenta = spread_starts(7, 1, g=1.0)
    with pytest.raises(InputError, match=naming("Newton")):
        close(REGULAR, attitudes[0], momenta[0], 1e-3)

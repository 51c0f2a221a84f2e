"""Periodic motions: their derivative by differences, their multipliers, and how they are closed."""

import numpy as np
import pytest

from robotball.dynamics.cycles import (
    by_turn,
    close,
    level_vectors,
    monodromy_of,
    multipliers_of,
    nearest,
)
from robotball.errors import InputError
from robotball.robot.formulas import Parameters
from robotball.rotations import rotation_matrix, turned
from robotball.theory.ensembles.orbits import orbits
from tests.figures import BALLS, REGULAR, spread_starts
from tests.messages import naming

pytestmark = pytest.mark.core


@pytest.mark.parametrize(("ball", "c"), BALLS)
def test_the_monodromy_is_the_end_by_the_start(ball: Parameters, c: float) -> None:
    """By turns of 1e-6 rad either way, and its determinant by the divergence along the motion.

    Turns keep M, γ and their product, so of the determinant's factor is left what they bring.
    """
    (attitude,), (momentum,) = spread_starts(2, 1, c, g=1.0)
    end, monodromy, volume = monodromy_of(ball, attitude, momentum, 1.0)
    times, found = np.array([0.0, 1.0]), np.empty((3, 3))
    for i, axis in enumerate(np.eye(3)):
        both = np.array([turned(attitude, sign * 1e-6 * axis) for sign in (1, -1)])
        ends = orbits(ball, both, np.tile(momentum, (2, 1)), times).attitudes[:, 1]
        ahead, behind = (rotation_matrix(end).T @ rotation_matrix(each) for each in ends)
        turn = (ahead - behind) / 4e-6
        found[:, i] = turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]
    assert np.abs(found - monodromy).max() < 1e-8 * np.abs(monodromy).max()  # measured 9e-10
    assert np.isfinite(volume)
    assert np.abs(monodromy - np.eye(3)).max() > 0.1


def test_by_turn_is_how_fixed_vectors_move_in_the_frame() -> None:
    """By differences: dv = v × turn, for each of the vectors."""
    (attitude,), (momentum,) = spread_starts(4, 1, 1.0, g=1.0)
    turn = np.array([0.3, -0.5, 0.2])
    ahead, behind = (level_vectors(turned(attitude, s * turn), momentum) for s in (1e-6, -1e-6))
    found = by_turn(level_vectors(attitude, momentum)) @ turn
    assert np.abs((ahead - behind).ravel() / 2e-6 - found).max() < 1e-9


def test_multipliers_leave_out_the_motions_own() -> None:
    """It is 1 but for rounding; largest first, a pair too; where M = 0 the determinant is all."""
    V = np.array([[1.0, 0.2, 0.0], [0.3, 1.0, -0.4], [0.1, 0.0, 1.0]])
    for pair in ([0.5, -2.0], [0.9, 0.2]):
        whole = V @ np.diag([1 + 1e-9, *pair]) @ np.linalg.inv(V)
        found = multipliers_of(whole, 0.0, np.array([1.0, 0.0, 0.0]))
        assert found == pytest.approx(sorted(pair, key=lambda z: -abs(z)), rel=1e-9)
    rest = multipliers_of(np.eye(3), np.log(0.25), np.zeros(3))
    assert rest == pytest.approx([0.25])


def test_a_motion_that_does_not_come_back_is_refused() -> None:
    """With what happened: no period near the one given is one of a motion near the start."""
    attitudes, momenta = spread_starts(7, 1, g=1.0)
    with pytest.raises(InputError, match=naming("Newton")):
        close(REGULAR, attitudes[0], momenta[0], 1e-3)


def test_the_nearest_of_points() -> None:
    """Of each point of the first set, to any of the second."""
    points, others = np.array([[0.0, 0.0], [3.0, 4.0]]), np.array([[0.0, 1.0], [3.0, 2.0]])
    assert nearest(points, others).tolist() == [1.0, 2.0]

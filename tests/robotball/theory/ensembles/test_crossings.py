"""The compiled search for crossings, against the zeros along a motion that is closely sampled."""

import numpy as np
import pytest
from scipy.interpolate import CubicHermiteSpline

from robotball.dynamics.sections import crossings
from robotball.robot.formulas import Parameters
from robotball.rotations import Array, rotation_matrix
from robotball.theory.ensembles.flatten import LANES
from robotball.theory.ensembles.orbits import (
    DONE,
    TOO_MANY_STEPS,
    Integers,
    Starts,
    orbits,
)
from robotball.theory.ensembles.steppers import ARC
from tests.figures import CHAOTIC, REGULAR, spread_starts

pytestmark = pytest.mark.core

NORMAL, MIDDLE = np.array([0.6, 0.0, 0.8]), np.array([0.0, 1.0, 0.0])
ORBITS, COUNT = LANES + 1, 4  # more than the lanes, so that one takes another when it is done


def found(
    ball: Parameters, attitudes: Array, momenta: Array, direction: int = 0
) -> tuple[Array, Integers, Array]:
    """Times, directions (n, COUNT) and γ (n, COUNT, 3) where γ crosses half of a great circle."""
    starts = Starts(ball, attitudes, momenta)
    numbers = np.tile([*NORMAL, *MIDDLE], (len(attitudes), 1))
    times, states, directions, number, status = crossings(
        starts, ARC, numbers, COUNT, direction, 1e-13
    )
    assert (number == COUNT).all()
    assert (status == DONE).all()
    return times, directions, rotation_matrix(starts.to_world(states))[..., 2, :]


def test_crossings_are_the_zeros_of_a_motion_that_is_closely_sampled() -> None:
    """All of them, in their order, with their directions; on the circle's other half there is none.

    By cubics between samples that are 2 ms apart. Measured 4e-14 of γ's distance from the circle.
    """
    attitudes, momenta = spread_starts(3, ORBITS, g=1.0)
    times, directions, gamma = found(CHAOTIC, attitudes, momenta)
    assert np.abs(gamma @ NORMAL).max() < 2e-13
    assert (gamma @ MIDDLE).min() > 0
    samples = np.arange(0.0, times.max() + 0.01, 2e-3)
    motions = rotation_matrix(orbits(CHAOTIC, attitudes, momenta, samples, 1e-13).attitudes)
    for i in range(ORBITS):
        axes = motions[i][:, 2]
        moved = np.einsum("nij,j->ni", motions[i].transpose(0, 2, 1), momenta[i])
        omega = np.array(CHAOTIC.angular_velocity(tuple(moved.T), tuple(axes.T))).T
        rate = np.cross(axes, omega)
        value = CubicHermiteSpline(samples, axes @ NORMAL, rate @ NORMAL)
        zeros = value.roots(extrapolate=False)
        zeros = zeros[CubicHermiteSpline(samples, axes @ MIDDLE, rate @ MIDDLE)(zeros) > 0][:COUNT]
        assert np.abs(zeros - times[i]).max() < 1e-9
        assert np.sign(value(zeros, 1)).tolist() == directions[i].tolist()


def test_one_direction_is_every_other_crossing() -> None:
    """Of a circle that is crossed to and fro; the other direction has the rest."""
    attitudes, momenta = spread_starts(5, ORBITS, g=1.0)
    both, directions, _ = found(REGULAR, attitudes, momenta)
    for direction in (1, -1):
        alone, own, _ = found(REGULAR, attitudes, momenta, direction)
        assert (own == direction).all()
        for i in range(ORBITS):
            expected = both[i][directions[i] == direction]
            assert np.abs(alone[i][: len(expected)] - expected).max(initial=0.0) < 1e-12
    assert {*np.unique(directions)} == {1, -1}


def test_what_is_beyond_the_horizon_is_not_found() -> None:
    """A motion's crossings up to there are those of a longer look; the rest is NaN."""
    attitudes, momenta = spread_starts(3, ORBITS, g=1.0)
    whole = found(REGULAR, attitudes, momenta)[0]
    horizon = float(np.median(whole[:, -1]))
    starts = Starts(REGULAR, attitudes, momenta)
    numbers = np.tile([*NORMAL, *MIDDLE], (ORBITS, 1))
    times, *_, number, status = crossings(starts, ARC, numbers, COUNT, 0, 1e-13, horizon)
    assert (status[number < COUNT] == TOO_MANY_STEPS).all()
    assert 0 < (number < COUNT).sum() < ORBITS
    for i in range(ORBITS):
        # The step that passes the horizon may find one behind it.
        assert number[i] >= (whole[i] < horizon).sum()
        assert np.abs(times[i, : number[i]] - whole[i, : number[i]]).max(initial=0.0) < 1e-12
        assert np.isnan(times[i, number[i] :]).all()

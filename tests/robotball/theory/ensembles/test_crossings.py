"""The compiled search for crossings, compared with zeros of a densely sampled motion."""

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
ORBITS, COUNT = LANES + 1, 4  # one more than the lanes, so that a lane is reused


def crossings_of(
    ball: Parameters, attitudes: Array, momenta: Array, direction: int = 0
) -> tuple[Array, Integers, Array]:
    """Return times, directions (n, COUNT) and γ (n, COUNT, 3) at crossings of half a circle."""
    starts = Starts(ball, attitudes, momenta)
    numbers = np.tile([*NORMAL, *MIDDLE], (len(attitudes), 1))
    times, states, directions, number, status = crossings(
        starts, ARC, numbers, COUNT, direction, 1e-13
    )
    assert (number == COUNT).all()
    assert (status == DONE).all()
    return times, directions, rotation_matrix(starts.to_world(states))[..., 2, :]


def test_crossings_are_the_zeros_of_a_densely_sampled_motion() -> None:
    """All zeros, in order, with their directions, on one half of the circle.

    The zeros are from cubics between samples 2 ms apart. Measured distance of γ from the circle:
    4e-14.
    """
    attitudes, momenta = spread_starts(3, ORBITS, g=1.0)
    times, directions, gamma = crossings_of(CHAOTIC, attitudes, momenta)
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


def test_the_crossings_in_each_direction_make_up_all_crossings() -> None:
    """The circle is crossed in both directions, alternately."""
    attitudes, momenta = spread_starts(5, ORBITS, g=1.0)
    both, directions, _ = crossings_of(REGULAR, attitudes, momenta)
    for direction in (1, -1):
        alone, own_directions, _ = crossings_of(REGULAR, attitudes, momenta, direction)
        assert (own_directions == direction).all()
        for i in range(ORBITS):
            expected = both[i][directions[i] == direction]
            assert np.abs(alone[i][: len(expected)] - expected).max(initial=0.0) < 1e-12
    assert {*np.unique(directions)} == {1, -1}


def test_the_search_stops_at_the_horizon() -> None:
    """Crossings up to the horizon equal the crossings of a longer search; the rest is NaN."""
    attitudes, momenta = spread_starts(3, ORBITS, g=1.0)
    whole = crossings_of(REGULAR, attitudes, momenta)[0]
    horizon = float(np.median(whole[:, -1]))
    starts = Starts(REGULAR, attitudes, momenta)
    numbers = np.tile([*NORMAL, *MIDDLE], (ORBITS, 1))
    times, *_, number, status = crossings(starts, ARC, numbers, COUNT, 0, 1e-13, horizon)
    assert (status[number < COUNT] == TOO_MANY_STEPS).all()
    assert 0 < (number < COUNT).sum() < ORBITS
    for i in range(ORBITS):
        # The last step may pass the horizon and find a crossing beyond it.
        assert number[i] >= (whole[i] < horizon).sum()
        assert np.abs(times[i, : number[i]] - whole[i, : number[i]]).max(initial=0.0) < 1e-12
        assert np.isnan(times[i, number[i] :]).all()

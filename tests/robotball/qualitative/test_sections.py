"""Sections without angles and periodic orbits: by (5.5), heyoka's events and the motions."""

from functools import partial

import numpy as np
import pytest

from robotball.engines.ensembles.orbits import TOO_MANY_STEPS, orbit
from robotball.equations import Parameters
from robotball.errors import InputError
from robotball.qualitative.cycles import close
from robotball.qualitative.sections import section, section_starts
from robotball.rotations import Array, rotation_matrix
from robotball.scene import section_state
from tests.figures import BALLS, CHAOTIC, CLASSICAL, REGULAR, F, ball, spread_starts

pytestmark = pytest.mark.core

some_starts = partial(spread_starts, 11, most=4.99)


def in_frame(attitudes: Array, momentum: Array) -> tuple[Array, Array]:
    """γ and M (m, 3) in frame axes."""
    axes = rotation_matrix(attitudes)
    return axes[:, 2], momentum @ axes


@pytest.mark.parametrize("g", [0.0, 0.7, -2.5])
@pytest.mark.parametrize(("ball", "c"), BALLS)
def test_points_are_on_the_section_and_have_its_coordinates(
    ball: Parameters, c: float, g: float
) -> None:
    """γ and M of a crossing are those of its (l, L) at g by (5.5).

    The residual of the search is larger as an angle near L = ±√f: measured 8.5e-14/√(1 - L²/f)
    under every kernel.
    """
    attitudes, momenta = some_starts(4, c, g)
    found = section(ball, attitudes, momenta, count=20, g=g)
    assert (found.found == 20).all()
    for i in range(4):
        gamma, M = in_frame(found.attitudes[i], momenta[i])
        for k in range(20):
            expected = section_state(found.L[i, k], found.l[i, k], g, F, c)
            across = np.sqrt(1 - found.L[i, k] ** 2 / F)
            assert np.abs(gamma[k] - expected[0]).max() < 2.5e-13 / across
            assert np.abs(M[k] - expected[1]).max() < 2.5e-13 / across


@pytest.mark.parametrize(("ball", "c", "horizon"), [(CHAOTIC, 0.0, 40.0), (CLASSICAL, 3.0, 18.0)])
def test_no_crossing_is_missed_or_invented(ball: Parameters, c: float, horizon: float) -> None:
    """heyoka's event detection sees the same crossings: times, directions, and how many.

    As long as the two integrators agree: times to 2e-10, by the growth of round-off.
    """
    hy = pytest.importorskip("heyoka")
    from validation.bench.kernels import batch, level_equations

    attitudes, momenta = some_starts(8, c)
    found = section(ball, attitudes, momenta, count=60)
    assert found.times[:, -1].min() > horizon
    axes = rotation_matrix(attitudes)
    level = np.concatenate([axes[:, 2], np.einsum("nij,ni->nj", axes, momenta)], axis=1)
    equations = level_equations(ball)
    gamma, M = [pair[0] for pair in equations[:3]], [pair[0] for pair in equations[3:]]
    seen: list[list[tuple[float, int]]] = [[] for _ in range(8)]

    def crossed(ta: object, time: float, sign: int, lane: int) -> None:
        ta.update_d_output(np.full(8, time))  # type: ignore[attr-defined]
        state = ta.d_output[:, lane]  # type: ignore[attr-defined]
        if state[2] - c / F * state[5] < 0 and time > 1e-9:
            seen[lane].append((time, sign))

    event = hy.nt_event_batch(M[1] * gamma[0] - M[0] * gamma[1], crossed)
    batch(equations, level, None, 1e-16, nt_events=[event]).propagate_until(horizon)
    for lane in range(8):
        ours = found.times[lane] < horizon
        times, signs = np.array(seen[lane]).T
        assert len(times) == ours.sum() > 5
        assert np.abs(times - found.times[lane, ours]).max() < 1e-8
        assert np.array_equal(signs, found.directions[lane, ours])


@pytest.mark.parametrize(("ball", "c", "horizon"), [(CHAOTIC, 0.0, 40.0), (CLASSICAL, 3.0, 15.0)])
def test_two_crossings_in_one_step_are_seen(ball: Parameters, c: float, horizon: float) -> None:
    """With steps of 0.1 s and of 0.03 s the same crossings are found, while the motions agree.

    Of 2700 crossings of the rubber ball 25 follow another by less than 0.1 s, of 4797 of the
    classical ball 166: about so often two fall into one of the longer steps. In ten times as many
    crossings one of the classical ball was lost at the tolerance of 1e-9, and none at 1e-12.
    """
    attitudes, momenta = some_starts(256, c)
    coarse, fine = (
        section(ball, attitudes, momenta, count=75, tolerance=t).times for t in (1e-9, 1e-14)
    )
    assert fine[:, -1].min() > horizon
    close_pairs = 0
    for early, late in zip(coarse, fine, strict=True):
        early, late = early[early < horizon], late[late < horizon]
        assert len(early) == len(late)
        assert np.abs(early - late).max() < 1e-3
        close_pairs += int((np.diff(late) < 0.1).sum())
    assert close_pairs > 10


def test_each_direction_can_be_asked_for_alone() -> None:
    """The crossings of both directions, sorted, are those of the one and those of the other."""
    attitudes, momenta = some_starts(2, 0.0)
    both = section(REGULAR, attitudes, momenta, count=20)
    for direction in (1, -1):
        alone = section(REGULAR, attitudes, momenta, count=20, direction=direction)
        for i in range(2):
            expected = both.times[i, both.directions[i] == direction]
            assert len(expected) > 2
            assert np.abs(alone.times[i, : len(expected)] - expected).max() < 1e-10


def test_the_section_needs_a_momentum_and_an_orbit_that_comes_back() -> None:
    """M = 0 is refused; an orbit at rest, ω = 0 of the classical ball, is given up."""
    with pytest.raises(InputError, match="M other than zero"):
        section(REGULAR, np.eye(4)[:1], np.zeros((1, 3)), count=1)
    slow = ball((0.8, 0.6, 0.7), (0.0, 0.0, 2.0), (2.0, 3.0, 0.0), "classical")
    q = np.array([[1.0, 0.0, 0.0, 0.0]])
    M = np.array([slow.momentum((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))])
    found = section(slow, q, M, count=1, g=0.3)
    assert found.status[0] == TOO_MANY_STEPS
    assert found.found[0] == 0
    assert np.isnan(found.times[0, 0])


# Periodic orbits ---------------------------------------------------------------------------


def test_unstable_periodic_orbits_of_the_chaos_close() -> None:
    """From a guess of the period within a half second, and they do repeat: 1e-10 after a period.

    Closed to 1e-11, times how far a period parts neighbours. Within a tenth of a second no motion
    repeats, and Newton's method says so.
    """
    attitudes, momenta = section_starts(0.0, 0.6, F)
    for guess in (3.3, 7.0):
        cycle = close(CHAOTIC, attitudes[0], momenta[0], guess)
        assert abs(cycle.multipliers[0]) > 1
        times = np.array([0.0, cycle.period])
        end = orbit(CHAOTIC, cycle.attitude, cycle.momentum, times)[0][-1]
        begin, end = (in_frame(q[None], cycle.momentum) for q in (cycle.attitude, end))
        assert np.abs(np.subtract(begin, end)).max() < 1e-9
    with pytest.raises(InputError, match="does not converge"):
        close(CHAOTIC, attitudes[0], momenta[0], 0.1)

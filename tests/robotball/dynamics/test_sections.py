"""Sections, periodic orbits and invariant curves, compared with (5.5) and with motions."""

from functools import partial

import numpy as np
import pytest

import robotball as rb
from robotball.dynamics.cycles import close
from robotball.dynamics.sections import (
    crossings_of_motion,
    section_starts,
    sections_of,
)
from robotball.errors import InputError
from robotball.robot import formulas as eq
from robotball.robot.formulas import Parameters
from robotball.robot.scene import along_momentum, section_state
from robotball.rotations import Array, multiply, rotation_matrix
from robotball.theory.ensembles.orbits import TOO_MANY_STEPS, orbit
from tests.figures import BALLS, CHAOTIC, CLASSICAL, REGULAR, F, ball, spread_starts
from tests.invariant_curves import invariant_curve, shared_integral
from tests.messages import naming

pytestmark = pytest.mark.core

some_starts = partial(spread_starts, 11, most=4.99)


def in_frame(attitudes: Array, momentum: Array) -> tuple[Array, Array]:
    """Return γ and M (m, 3) in frame axes."""
    axes = rotation_matrix(attitudes)
    return axes[:, 2], momentum @ axes


@pytest.mark.parametrize("g", [0.0, 0.7, -2.5])
@pytest.mark.parametrize(("ball", "c"), BALLS)
def test_points_are_on_the_section_and_have_its_coordinates(
    ball: Parameters, c: float, g: float
) -> None:
    """γ and M of a crossing follow from its (l, L) at g by (5.5).

    As an angle, the residual of the search is larger near L = ±√f: measured 8.5e-14/√(1 - L²/f)
    with every OpenBLAS kernel.
    """
    attitudes, momenta = some_starts(4, c, g)
    found = sections_of(ball, attitudes, momenta, count=20, g=g)
    assert (found.found == 20).all()
    for i in range(4):
        gamma, M = in_frame(found.attitudes[i], momenta[i])
        for k in range(20):
            expected = section_state(found.L[i, k], found.l[i, k], g, F, c)
            across = np.sqrt(1 - found.L[i, k] ** 2 / F)
            assert np.abs(gamma[k] - expected[0]).max() < 2.5e-13 / across
            assert np.abs(M[k] - expected[1]).max() < 2.5e-13 / across


@pytest.mark.parametrize(("ball", "c", "horizon"), [(CHAOTIC, 0.0, 40.0), (CLASSICAL, 3.0, 15.0)])
def test_two_crossings_within_one_step_are_both_found(
    ball: Parameters, c: float, horizon: float
) -> None:
    """Steps of 0.1 s and of 0.03 s give the same crossings, as long as the motions agree.

    25 of 2700 crossings of the rubber ball, and 166 of 4797 of the classical ball, follow another
    within 0.1 s, so about as often two fall into one long step. In ten times as many crossings, one
    of the classical ball was lost at a tolerance of 1e-9, but not at 1e-12.
    """
    attitudes, momenta = some_starts(256, c)
    coarse, fine = (
        sections_of(ball, attitudes, momenta, count=75, tolerance=t).times for t in (1e-9, 1e-14)
    )
    assert fine[:, -1].min() > horizon
    close_pairs = 0
    for early, late in zip(coarse, fine, strict=True):
        early, late = early[early < horizon], late[late < horizon]
        assert len(early) == len(late)
        assert np.abs(early - late).max() < 1e-3
        close_pairs += int((np.diff(late) < 0.1).sum())
    assert close_pairs > 10


def test_each_direction_can_be_requested_alone() -> None:
    """Merged and sorted they equal the crossings for direction 0."""
    attitudes, momenta = some_starts(2, 0.0)
    both = sections_of(REGULAR, attitudes, momenta, count=20)
    for direction in (1, -1):
        alone = sections_of(REGULAR, attitudes, momenta, count=20, direction=direction)
        for i in range(2):
            expected = both.times[i, both.directions[i] == direction]
            assert len(expected) > 2
            assert np.abs(alone.times[i, : len(expected)] - expected).max() < 1e-10


def test_a_section_needs_a_momentum_and_an_orbit_that_returns() -> None:
    """M = 0 is refused; an orbit at rest (classical, ω = 0) reaches the step limit."""
    with pytest.raises(InputError, match=naming("M")):
        sections_of(REGULAR, np.eye(4)[:1], np.zeros((1, 3)), count=1)
    slow = ball((0.8, 0.6, 0.7), (0.0, 0.0, 2.0), (2.0, 3.0, 0.0), "classical")
    q = np.array([[1.0, 0.0, 0.0, 0.0]])
    M = np.array([slow.momentum((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))])
    found = sections_of(slow, q, M, count=1, g=0.3)
    assert found.status[0] == TOO_MANY_STEPS
    assert found.found[0] == 0
    assert np.isnan(found.times[0, 0])


# Periodic orbits ---------------------------------------------------------------------------


def test_unstable_periodic_orbits_in_the_chaos_are_closed() -> None:
    """From a guess of the period within half a second; they repeat to 1e-10 after a period.

    They close to 1e-11, times the growth of a neighbour's distance. Near a tenth of a second no
    motion repeats, and Newton's method fails.
    """
    attitudes, momenta = section_starts(0.0, 0.6, F)
    for guess in (3.3, 7.0):
        cycle = close(CHAOTIC, attitudes[0], momenta[0], guess)
        assert abs(cycle.multipliers[0]) > 1
        times = np.array([0.0, cycle.period])
        last = orbit(CHAOTIC, cycle.attitude, cycle.momentum, times)[-1, :4]
        begin, end = (in_frame(q[None], cycle.momentum) for q in (cycle.attitude, last))
        assert np.abs(np.subtract(begin, end)).max() < 1e-9
    with pytest.raises(InputError, match=naming("converge")):
        close(CHAOTIC, attitudes[0], momenta[0], 0.1)


def test_many_section_starts_are_those_of_each_point() -> None:
    """To the last bit, with g and c; one impossible point is refused with its L."""
    L, l = np.linspace(-4.0, 4.0, 7), np.linspace(0.0, 6.0, 7)
    attitudes, momenta = section_starts(L, l, F, 0.3, 1.0)
    for i in range(len(L)):
        start = along_momentum(*section_state(L[i], l[i], 0.3, F, 1.0))
        np.testing.assert_array_equal(attitudes[i], start.attitude)
        np.testing.assert_array_equal(momenta[i], start.momentum)
    with pytest.raises(InputError, match=naming("|L|~=~5.1 sqrt(f)~=~5")):
        section_starts([1.0, -5.1], [0.0, 0.0], F)


# Invariant curves -----------------------------------------------------------------------------


def orbit_of(parameters: Parameters, L: float, l: float) -> Array:
    """Return γ and M/|M| (400, 6) at the crossings in one direction."""
    attitudes, momenta = section_starts(L, l, F)
    return sections_of(parameters, attitudes, momenta, count=400, direction=1).states[0]


def test_an_integrable_ball_has_invariant_curves_and_a_chaotic_ball_has_none() -> None:
    """Held-out points are on the curve, and so are the next 200, which the fit did not use.

    Measured 4.0e-7 and 9.7e-7 (unit vectors): omitted harmonics, and the error of ρ times the
    number of iterates. Fig. 14's held-out points are as far off as the section is wide.
    """
    chaplygin = ball((0.7, 0.6, 0.8), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), "classical")
    points = orbit_of(chaplygin, 3.6, 0.6)
    curve = invariant_curve(points[:200])
    assert curve.residual < 1.2e-6
    later = curve.at(curve.rotation * np.arange(200.0, 400.0))
    assert np.abs(later - points[200:]).max() < 3e-6
    ends = curve.at(np.array([0.0, 1.0]))
    assert np.abs(ends[1] - ends[0]).max() < 2e-15  # measured 2e-16
    assert invariant_curve(orbit_of(CHAOTIC, 0.0, 0.6)[:200]).residual > 0.5


def test_the_rotation_number_of_a_known_curve_is_recovered() -> None:
    """A deformed circle rotated by 0.381966… per step: ρ and the curve agree to rounding."""
    rho = (3 - np.sqrt(5)) / 2
    phase = 2 * np.pi * rho * np.arange(150)
    circle = [np.cos(phase) + 0.2 * np.cos(2 * phase), np.exp(np.sin(phase))]
    curve = invariant_curve(np.stack(circle, axis=1))
    assert curve.rotation == pytest.approx(rho, abs=1e-13)
    assert curve.residual < 2.5e-12  # measured 8.4e-13


@pytest.mark.parametrize(
    ("points", "facts"),
    [
        (np.ones((99, 2)), "100 finite"),
        (np.full((200, 2), np.nan), "100 finite"),
        (np.ones((200, 2)), "equal"),
    ],
)
def test_points_of_no_curve_are_refused(points: Array, facts: str) -> None:
    with pytest.raises(InputError, match=naming(facts)):
        invariant_curve(points)


def test_the_shared_integral_is_twice_the_rubber_balls_energy() -> None:
    """Along 20 s with Ω = K = 0. The classical ball is tested with the claims of the paper."""
    rubber = ball((0.8, 0.6, 0.7), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    start = along_momentum(*section_state(1.0, 2.0, 0.0, F))
    axes = rotation_matrix(
        orbit(rubber, start.attitude, start.momentum, np.linspace(0.0, 20.0, 200))[:, :4]
    )
    gamma, M = axes[:, 2], start.momentum @ axes
    omega = rubber.angular_velocity(tuple(M.T), tuple(gamma.T))
    E = eq.energy(omega, tuple(gamma.T), rubber.Omega, rubber.A, rubber.d, False)
    J = shared_integral(rubber, gamma, np.cross(M, gamma))
    # Measured 2e-15 and 2.9e-15: the tolerance of the steps.
    assert 2 * np.asarray(E) == pytest.approx(J, rel=2e-14)
    assert np.ptp(J) < 1e-14 * J[0]


@pytest.mark.parametrize(
    ("name", "g"), [("fig12", 0.0), ("fig14", 0.3), ("classical_chaotic", -0.5)]
)
def test_a_sampled_motion_crosses_where_the_equations_do(name: str, g: float) -> None:
    """Cubics through samples 5 ms apart give time and place; the compiled section is the reference.

    The cubics have an error of h⁴/384 times a fourth derivative of about 1000 1/s⁴.
    """
    scene = rb.load_scene(name)
    found = crossings_of_motion(rb.integrate(scene, rb.sample_times(20.0, 5e-3)), scene, g)
    attitude = multiply(scene.start.attitude, scene.principal_quaternion)
    momentum = scene.start.momentum
    exact = sections_of(scene.parameters, attitude[None], momentum[None], len(found.times), g)
    assert len(found.times) >= 4
    assert np.array_equal(found.directions, exact.directions[0])
    # Measured 7e-10 s, 1.7e-8 kg m²/s and 3e-9 at most (classical_chaotic).
    assert np.abs(found.times - exact.times[0]).max() < 1e-8
    assert np.abs(found.L - exact.L[0]).max() < 1e-7
    assert np.abs(np.sin((found.l - exact.l[0]) / 2)).max() < 1e-7

"""Motion from rest, section 4: fixed points, their types, limit cycles."""

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import root

from robotball import integrate, load_scene
from robotball.engines.ensembles.orbits import orbit
from robotball.equations import Parameters, Vector, as_vector
from robotball.errors import InputError
from robotball.qualitative.cycles import Cycle
from robotball.qualitative.equilibria import (
    ContactPath,
    FixedPoint,
    attitude_at,
    contact_path,
    first_lyapunov_value,
    fixed_point_at,
    fixed_points,
    flow,
    jacobian,
    proposition_2,
    rate_scale,
    tangents,
)
from robotball.qualitative.portraits import limit_cycles, reversed_in_time, spread_points
from robotball.rotations import Array, rotation_matrix
from robotball.scene import Start
from tests.figures import CLASSICAL, ball, from_rest


def kinds(points: list[FixedPoint]) -> Counter[str]:
    return Counter(point.kind for point in points)


def followed(some: Parameters, gamma: Array, times: Array) -> Array:
    """γ (m, 3) at the times, from the direction of γ (3,)."""
    attitude = attitude_at(gamma / np.linalg.norm(gamma))
    return rotation_matrix(orbit(some, attitude, np.zeros(3), times)[0])[:, 2]


@pytest.mark.slow
def test_no_fixed_point_is_missed() -> None:
    """Of 40 random balls: every list passes the check by indices, and no solver finds more.

    The solver starts from 100 points of the sphere; zeros of the list are zeros to 1e-13.
    """
    rng = np.random.default_rng(4)
    numbers = set()
    for _ in range(40):
        A, Omega, K = rng.uniform(0.2, 1.0, 3), rng.normal(size=3), 0.3 * rng.normal(size=3)
        some = ball(as_vector(A), as_vector(Omega), as_vector(K), d=0.01)
        known = np.array([point.gamma for point in fixed_points(some)])
        numbers.add(len(known))
        assert max(np.abs(flow(some, as_vector(g))).max() for g in known) < 1e-13 * rate_scale(some)
        for start in spread_points(100):
            gamma = solved_from(some, start)
            if gamma is not None:
                assert np.linalg.norm(known - gamma, axis=1).min() < 1e-6
    assert numbers == {2, 6, 10}


def solved_from(some: Parameters, start: Array) -> Array | None:
    """The fixed point (3,) that scipy's solver finds from γ (3,), if it does."""
    basis = tangents(start)

    def rate(x: Array) -> Array:
        return basis @ np.array(flow(some, as_vector(start + x @ basis)))

    gamma = start + root(rate, np.zeros(2), tol=1e-13).x @ basis
    gamma /= np.linalg.norm(gamma)
    return gamma if np.abs(flow(some, as_vector(gamma))).max() < 1e-11 * rate_scale(some) else None


def test_eigenvalues_are_those_of_the_flow() -> None:
    """The Jacobian by dual numbers is the one by differences, 1e-9."""
    some = from_rest(0.3)
    for point in fixed_points(some):
        basis, h = tangents(point.gamma), 1e-6
        columns = [
            np.array(flow(some, as_vector(point.gamma + h * e)))
            - np.array(flow(some, as_vector(point.gamma - h * e)))
            for e in basis
        ]
        differences = basis @ np.array(columns).T / (2 * h)
        assert np.abs(jacobian(some, point.gamma) - differences).max() < 1e-8


def test_a_slow_focus_attracts_as_its_first_lyapunov_value_says() -> None:
    """dr/dt = value r³: from r = 0.02 the distance falls to 0.0187 in 500 turns, as by the law.

    Within 0.23 %: the distance is the law's r but for terms in r².
    """
    some = from_rest(0.3)
    gamma = np.array([0.0, 0.0, 1.0])
    value = first_lyapunov_value(some, gamma)
    assert value < 0
    values, vectors = np.linalg.eig(jacobian(some, gamma))
    nu, v = abs(values[0].imag), vectors[:, np.argmax(values.imag)]
    axes = np.stack([v.imag, v.real], axis=1)
    start = gamma + tangents(gamma).T @ (axes @ [0.02, 0.0])
    times = np.linspace(0.0, 500 * 2 * np.pi / nu, 501)
    path = followed(some, start, times)
    r = np.linalg.norm(np.linalg.solve(axes, tangents(gamma) @ (path / path[:, 2:]).T), axis=0)
    law = 0.02 / np.sqrt(1 - 2 * value * 0.02**2 * times)
    assert r[-1] < 0.95 * r[0]
    assert np.abs(r / law - 1).max() < 0.005


def test_the_axis_of_k_is_a_saddle_or_a_weak_focus_by_proposition_2() -> None:
    """Of 200 random balls, by A₁A₂ and by B/A₁: the eigenvalues and the value of third order."""
    rng, found = np.random.default_rng(12), Counter[str]()
    for _ in range(200):
        A, Omega, K3 = rng.uniform(0.2, 1.0, 3), rng.normal(size=3), rng.normal()
        some = ball(as_vector(A), as_vector(Omega), (0.0, 0.0, K3), d=0.01)
        A1, A2, B = proposition_2(some)
        focus = "slow stable focus" if B / A1 < 0 else "slow unstable focus"
        for side in (1.0, -1.0):
            kind = fixed_point_at(some, np.array([0.0, 0.0, side])).kind
            assert kind == ("saddle" if A1 * A2 < 0 else focus)
            found[kind] += 1
    assert len(found) == 3
    assert min(found.values()) > 40


@pytest.mark.parametrize("index", range(10))
def test_at_rest_in_the_frame_the_contact_point_runs_on_a_circle(index: int) -> None:
    """Fig. 6, all ten fixed points, 2 s from the start: radius, turning, direction.

    The integrator's error, in metres of 9 m: measured 4.3e-13.
    """
    scene = load_scene("fig06")
    gamma = fixed_points(scene.parameters)[index].gamma
    path = contact_path(scene.parameters, gamma)
    start = Start(attitude_at(scene.principal_axes @ gamma), np.zeros(3))
    times = np.linspace(0.0, 2.0, 21)
    motion = integrate(replace(scene, start=start), times)
    axes = rotation_matrix(start.attitude)
    v = axes[:2] @ scene.principal_axes @ np.cross(gamma, scene.parameters.Omega)
    heading, turned = np.arctan2(v[1], v[0]), path.turning * times
    # v turned by s t, integrated: a circle through the start with its centre to the left.
    x = path.radius * np.sign(path.turning) * (np.sin(heading + turned) - np.sin(heading))
    y = path.radius * np.sign(path.turning) * (np.cos(heading) - np.cos(heading + turned))
    moved = motion.contact_point - motion.contact_point[0]
    assert np.abs(moved - np.stack([x, y], axis=1)).max() < 1e-11


def test_a_circle_is_asked_for_at_a_fixed_point() -> None:
    """Elsewhere, and for a classical ball, it is refused; without turning the path is a line."""
    gamma = np.array([0.6, 0.48, 0.64])
    with pytest.raises(InputError, match="only where gamma is a fixed point"):
        contact_path(from_rest(0.3), gamma)
    with pytest.raises(InputError, match="rubber"):
        contact_path(CLASSICAL, gamma)
    sideways = ball((0.5, 0.4, 0.3), (0.0, 2.0, 0.0), (0.0, 0.0, 0.0))
    assert contact_path(sideways, np.array([1.0, 0.0, 0.0])) == ContactPath(2.0, 0.0)
    assert contact_path(sideways, np.array([1.0, 0.0, 0.0])).radius == np.inf


def test_degenerate_flows_are_refused() -> None:
    """A classical ball, a ball that nothing drives, and a whole circle of fixed points."""
    with pytest.raises(InputError, match="rubber"):
        fixed_points(CLASSICAL)
    with pytest.raises(InputError, match="rests at every"):
        fixed_points(ball((0.5, 0.4, 0.3), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)))
    with pytest.raises(InputError, match="three different moments"):
        fixed_points(ball((0.5, 0.5, 0.5), (0.0, 0.0, 1.0), (0.0, 0.0, 0.0)))
    # Within 1e-9 of a moment, far from rounding.
    for first in (0.5, 0.5 + 1e-12):
        with pytest.raises(InputError, match="fill a curve"):
            fixed_points(ball((first, 0.5, 0.3), (0.0, 0.0, 1.0), (0.0, 0.0, -0.1)))
    assert len(fixed_points(ball((0.5 + 1e-6, 0.5, 0.3), (0.0, 0.0, 1.0), (0.0, 0.0, -0.1)))) == 10


@pytest.mark.parametrize(
    ("A", "Omega", "K"),
    [
        ((0.5, 0.5, 0.3), (0.0, 0.0, 1.0), (0.0, 0.0, 0.1)),
        ((0.5, 0.5, 0.3), (0.0, 0.0, 1.0), (0.0, 0.0, -1.34)),
        ((0.5, 0.3, 0.5), (0.3, 0.0, 1.0), (0.0, 2.0, 0.0)),
        ((0.5, 0.5, 0.5), (0.1, 0.2, 1.0), (0.3, -0.2, 0.1)),
        ((0.5, 0.4, 0.25), (-0.5, 0.8, -0.5), (1.0, -2.0, 2.0)),
    ],
)
def test_a_curve_of_complex_fixed_points_is_no_curve(A: Vector, Omega: Vector, K: Vector) -> None:
    """Two equal moments, a uniform ball and Ω = -AK: ±AK alone rest, found to 1e-13.

    The resultant is singular, so that its eigenvalues are rounding.
    """
    points = fixed_points(ball(A, Omega, K))
    assert kinds(points) == {"centre": 2}
    along = np.multiply(A, K) / np.linalg.norm(np.multiply(A, K))
    assert np.abs(np.abs([point.gamma @ along for point in points]) - 1).max() < 1e-13


@pytest.mark.parametrize("K3", [-1.33, -0.7, -0.01])
def test_two_equal_moments_rest_on_a_circle(K3: float) -> None:
    """At γ₃² = a₁a₃K₃/((a₃ - a₁)Ω₃), where that is between 0 and 1: down to K₃ = -4/3 here."""
    some = ball((0.5, 0.5, 0.3), (0.0, 0.0, 1.0), (0.0, 0.0, K3))
    third = np.sqrt(-0.75 * K3)
    assert np.abs(flow(some, (np.sqrt(1 - third**2), 0.0, third))).max() < 1e-15
    with pytest.raises(InputError, match="fill a curve"):
        fixed_points(some)


# Limit cycles ------------------------------------------------------------------------------


def only_cycle(some: Parameters) -> Cycle:
    cycles = limit_cycles(some)
    assert len(cycles) == 1
    return cycles[0]


@pytest.mark.parametrize(("K3", "period"), [(0.52, 60.0086320), (3.0, 6.0909390)])
def test_unstable_limit_cycles_of_figs_7_and_8(K3: float, period: float) -> None:
    """Periods 60.0086320 and 6.0909390 to 1e-6, measured 60.00863199 and 6.09093898."""
    cycle = only_cycle(from_rest(K3))
    assert cycle.period == pytest.approx(period, abs=1e-6)
    assert cycle.multipliers[0].real > 1


def test_a_cycles_multiplier_is_how_its_neighbours_part() -> None:
    """Fig. 8: a neighbour 1e-6 away is 2.28 times as far off after a period, to 1e-4."""
    some = from_rest(3.0)
    cycle = only_cycle(some)
    rate = np.array(flow(some, as_vector(cycle.gamma)))
    across = np.cross(cycle.gamma, rate / np.linalg.norm(rate))
    near = cycle.gamma + 1e-6 * across
    times = np.array([0.0, cycle.period])
    ends = [followed(some, gamma, times)[-1] for gamma in (cycle.gamma, near)]
    assert np.abs(ends[0] - cycle.gamma).max() < 1e-10
    assert (ends[1] - ends[0]) @ across / 1e-6 == pytest.approx(cycle.multipliers[0].real, rel=1e-4)


@pytest.mark.slow
def test_fig6_has_no_limit_cycle() -> None:
    """At K₃ = 0.3 everything comes to rest in both directions of time, but on slow foci."""
    assert limit_cycles(from_rest(0.3)) == []


def test_reversed_ball_goes_back() -> None:
    """Ω and K turned round give the flow back in time, exactly."""
    some, gamma = from_rest(0.3), (0.6, 0.48, 0.64)
    assert flow(reversed_in_time(some), gamma) == tuple(-x for x in flow(some, gamma))

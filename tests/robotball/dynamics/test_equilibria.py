"""Motion from rest, section 4: fixed points of (4.1), their circle, cycles and manifolds."""

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from robotball import integrate, load_scene
from robotball.dynamics.cycles import limit_cycles, separatrices
from robotball.dynamics.equilibria import (
    ContactPath,
    FixedCircle,
    attitude_at,
    closed_form_points,
    contact_path,
    fixed_circle,
    fixed_point_at,
    fixed_points,
    flow,
    index_sum,
    jacobian,
    name_of,
    rate_scale,
)
from robotball.errors import InputError
from robotball.robot.formulas import Parameters, Vector, as_vector
from robotball.robot.scene import Start
from robotball.rotations import Array, on_circle, rotation_matrix
from robotball.theory.ensembles.orbits import orbit
from tests.figures import CLASSICAL, ball, from_rest, proposition_2
from tests.messages import naming

A: Vector = (0.5, 0.4, 0.3)
OMEGA: Vector = (4.0, 2.0, 1.0)
NOTHING: Vector = (0.0, 0.0, 0.0)
GAMMA = np.array([0.6, 0.48, 0.64])


# All of them -------------------------------------------------------------------------------


def random_ball(rng: np.random.Generator, K: Vector) -> Parameters:
    return ball(as_vector(rng.uniform(0.2, 1.0, 3)), as_vector(rng.uniform(-4, 4, 3)), K, d=0.01)


def test_the_resultant_finds_the_points_of_the_closed_form() -> None:
    """It agrees with the formulas of section 4.1 on Figs 6 to 8 and on 30 random balls.

    Measured 2.5e-15 on 200 balls: rounding of a rate over the smaller eigenvalue, which vanishes
    where points merge.
    """
    rng = np.random.default_rng(6)
    balls = [from_rest(K3) for K3 in (0.3, 0.52, 3.0)]
    balls += [random_ball(rng, (0.0, 0.0, rng.uniform(-2, 2))) for _ in range(30)]
    numbers = []
    for parameters in balls:
        searched = np.array([point.gamma for point in fixed_points(parameters)])
        formula = np.array(list(closed_form_points(parameters).values()))
        apart = np.linalg.norm(searched[:, None] - formula, axis=2)
        assert len(searched) == len(formula)
        assert max(apart.min(axis=0).max(), apart.min(axis=1).max()) < 1e-11
        numbers.append(len(searched))
    assert numbers[:3] == [10, 6, 2]
    assert set(numbers[3:]) == {2, 6, 10}


@pytest.mark.parametrize(
    ("moments", "Omega", "K"),
    [
        ((0.5, 0.5, 0.3), (0.0, 0.0, 1.0), (0.0, 0.0, 0.1)),
        ((0.5, 0.5, 0.3), (0.0, 0.0, 1.0), (0.0, 0.0, -1.34)),
        ((0.5, 0.3, 0.5), (0.3, 0.0, 1.0), (0.0, 2.0, 0.0)),
        ((0.5, 0.5, 0.5), (0.1, 0.2, 1.0), (0.3, -0.2, 0.1)),
        ((0.5, 0.4, 0.25), (-0.5, 0.8, -0.5), (1.0, -2.0, 2.0)),
    ],
)
def test_a_curve_of_complex_fixed_points_is_ignored(
    moments: Vector, Omega: Vector, K: Vector
) -> None:
    """Two equal moments or a uniform ball with Ω = -AK: only ±AK are fixed, found to 1e-13.

    The resultant is singular there, so its eigenvalues are rounding.
    """
    points = fixed_points(ball(moments, Omega, K))
    assert Counter(point.kind for point in points) == {"centre": 2}
    along = np.multiply(moments, K) / np.linalg.norm(np.multiply(moments, K))
    assert np.abs(np.abs([point.gamma @ along for point in points]) - 1).max() < 1e-13


def symmetric(K3: float, first: float = 0.5) -> Parameters:
    """Return a ball with the circle of fixed points γ₃² = a₁a₃K₃/((a₃ - a₁)Ω₃), -4/3 < K₃ < 0."""
    return ball((first, 0.5, 0.3), (0.0, 0.0, 1.0), (0.0, 0.0, K3))


@pytest.mark.parametrize(
    ("find", "parameters", "facts"),
    [
        (fixed_points, CLASSICAL, "rubber"),
        (fixed_points, ball(A, NOTHING, NOTHING), "rests"),
        (fixed_points, ball((0.5, 0.5, 0.3), OMEGA, NOTHING), "three different moments"),
        (fixed_points, symmetric(-1.33), "curve"),
        (fixed_points, symmetric(-0.01), "curve"),
        (fixed_points, symmetric(-0.1, 0.5 + 1e-12), "curve"),
        (closed_form_points, CLASSICAL, "rubber K"),
        (closed_form_points, replace(from_rest(0.3), K=(0.1, 0.0, 0.3)), "rubber K"),
        (closed_form_points, ball((0.5, 0.5, 0.3), OMEGA, (0.0, 0.0, 0.3)), "three different"),
        (closed_form_points, ball(A, (4.0, 0.0, 0.0), (0.0, 0.0, 0.3)), "nonzero"),
        (partial(contact_path, gamma=GAMMA), from_rest(0.3), "gamma"),
        (partial(contact_path, gamma=GAMMA), CLASSICAL, "rubber"),
    ],
)
def test_balls_without_isolated_points_or_a_formula_are_refused(
    find: Callable[[Parameters], object], parameters: Parameters, facts: str
) -> None:
    with pytest.raises(InputError, match=naming(facts)):
        find(parameters)


def test_a_refused_curve_is_really_fixed_and_almost_equal_moments_are_solved() -> None:
    """The flow vanishes on the circle; with moments 1e-6 apart there are ten points."""
    third = np.sqrt(0.75 * 0.7)
    assert np.abs(flow(symmetric(-0.7), (np.sqrt(1 - third**2), 0.0, third))).max() < 1e-15
    assert len(fixed_points(symmetric(-0.1, 0.5 + 1e-6))) == 10


# Their types and names ---------------------------------------------------------------------

TYPES = {
    "slow stable focus": "Γ₅ Γ₆",
    "unstable node": "δ₁ δ₂",
    "saddle": "δ₃ δ₄ θ₁ θ₂",
    "stable focus": "θ₃ θ₄",
}


def test_fixed_points_have_the_papers_names_and_types() -> None:
    """Fig. 6's ten points are named as in section 4.2; a pair is a point and its opposite.

    If K = 0, points off the circle have the names of (4.4); with K off the axes they have no name.
    """
    parameters = from_rest(0.3)
    found = {name_of(parameters, point.gamma): point for point in fixed_points(parameters)}
    assert len(found) == 10
    for kind, names in TYPES.items():
        assert {found[name].kind for name in names.split()} == {kind}
    for first, second in (("δ₁", "δ₂"), ("δ₃", "δ₄"), ("θ₁", "θ₂"), ("θ₃", "θ₄"), ("Γ₅", "Γ₆")):
        assert found[first].gamma == pytest.approx(-found[second].gamma, abs=1e-14)
    assert "".join(closed_form_points(from_rest(0.0))) == "Γ₁Γ₂Γ₃Γ₄Γ₅Γ₆"
    assert "".join(closed_form_points(ball(A, (4.0, 2.0, 0.0), NOTHING))) == "Γ₁Γ₂Γ₃Γ₄"
    assert name_of(from_rest(0.0), np.array([0.0, -1.0, 0.0])) == "Γ₄"
    assert name_of(from_rest(0.3), GAMMA) == ""
    assert name_of(replace(from_rest(0.3), K=(0.1, 0.0, 0.3)), np.array([0.0, 0.0, 1.0])) == ""


def test_the_axis_of_k_is_a_saddle_or_a_weak_focus_by_proposition_2() -> None:
    """A₁A₂ and B/A₁ agree with the eigenvalues and third-order values of 60 random balls."""
    rng, found = np.random.default_rng(12), Counter[str]()
    for _ in range(60):
        parameters = random_ball(rng, (0.0, 0.0, rng.normal()))
        A1, A2, B = proposition_2(parameters)
        focus = "slow stable focus" if B / A1 < 0 else "slow unstable focus"
        for side in (1.0, -1.0):
            kind = fixed_point_at(parameters, np.array([0.0, 0.0, side])).kind
            assert kind == ("saddle" if A1 * A2 < 0 else focus)
            found[kind] += 1
    assert len(found) == 3
    assert min(found.values()) > 10


@pytest.mark.parametrize("name", ["θ₃", "δ₂"])
def test_the_contact_point_of_a_fixed_point_moves_on_a_circle(name: str) -> None:
    """Radius, turning and direction agree with Fig. 6's motion over 2 s.

    Measured 4.3e-13 m of 9 m: the integrator's error.
    """
    scene = load_scene("fig06")
    gamma = closed_form_points(scene.parameters)[name]
    path = contact_path(scene.parameters, gamma)
    start = Start(attitude_at(scene.principal_axes @ gamma), np.zeros(3))
    times = np.linspace(0.0, 2.0, 21)
    motion = integrate(replace(scene, start=start), times)
    axes = rotation_matrix(start.attitude)
    v = (axes[:2] @ scene.principal_axes @ np.cross(gamma, scene.parameters.Omega)) @ [1, 1j]
    assert path.speed == pytest.approx(abs(v))
    assert path.radius == pytest.approx(abs(v / path.turning))
    # v, rotated by s t, is integrated: a circle through the start with its centre to the left.
    expected = v * (np.exp(1j * path.turning * times) - 1) / (1j * path.turning)
    moved = (motion.contact_point - motion.contact_point[0]) @ [1, 1j]
    assert np.abs(moved - expected).max() < 1e-11
    straight = contact_path(ball(A, (0.0, 2.0, 0.0), NOTHING), np.array([1.0, 0.0, 0.0]))
    assert straight == ContactPath(2.0, 0.0)
    assert straight.radius == np.inf


# The circle of them, K = 0 -----------------------------------------------------------------


def circle_of(parameters: Parameters) -> FixedCircle:
    circle = fixed_circle(parameters)
    assert circle is not None
    return circle


def index_of(parameters: Parameters, axes: Array) -> int:
    """Return the winding number of (4.1) on a line just below the circle minus one just above.

    No other fixed point lies between these lines.
    """
    along = np.cross(*axes)
    # The other fixed points are principal axes. The line must pass below the nearest of them, with
    # samples much closer than its distance, over which the flow reverses.
    heights = np.abs(along)[np.abs(along) > 1e-9]  # of the principal axes above the circle
    height = min(0.02, float(heights.min()) / 2)
    samples = min(100_000, int(40 / height))
    angle = np.linspace(0.0, 2 * np.pi, samples + 1)
    out, ahead = on_circle(axes, angle), on_circle(axes, angle + np.pi / 2)
    turns = []
    for sign in (-1.0, 1.0):
        gamma = np.sqrt(1 - height**2) * out + sign * height * along
        rate = np.stack(flow(parameters, tuple(gamma.T)), axis=1)
        direction = np.unwrap(np.arctan2(rate @ along, (rate * ahead).sum(axis=1)))
        turns.append(round(float(direction[-1] - direction[0]) / (2 * np.pi)))
    return turns[0] - turns[1]


@pytest.mark.parametrize(
    ("Omega", "kinds", "circle"),
    [
        (OMEGA, {"centre": 4, "saddle": 2}, 0),
        ((4.0, 2.0, 0.01), {"centre": 4, "saddle": 2}, 0),
        ((4.0, 2.0, 0.0), {"centre": 2, "saddle": 2}, 2),  # Γ₅ and Γ₆ lie on the circle
        ((4.0, 0.0, 1.0), {"centre": 4}, -2),  # Γ₃ and Γ₄ do
        ((0.0, 0.0, 2.0), {"centre": 2}, 0),
    ],
)
def test_indices_of_points_and_circle_add_up_to_2(
    Omega: Vector, kinds: dict[str, int], circle: int
) -> None:
    """The circle's index, which completes the sum to 2, is also that of the flow beside it."""
    parameters = ball(A, Omega, NOTHING)
    points = fixed_points(parameters)
    assert Counter(point.kind for point in points) == kinds
    circle_found = circle_of(parameters)
    assert circle_found.index == index_of(parameters, circle_found.axes) == circle
    assert index_sum(points) + circle == 2


def test_every_point_of_the_circle_is_fixed_and_attracts_at_its_rate() -> None:
    """Measured 1.4e-17 of the rates and 5.6e-16 1/s of the eigenvalues: rounding.

    As a control, the flow beside the circle is not zero.
    """
    parameters = from_rest(0.0)
    circle = circle_of(parameters)
    gamma = circle.at(np.linspace(0.1, 6.2, 40))
    assert np.abs(flow(parameters, tuple(gamma.T))).max() < 1e-16 * rate_scale(parameters)
    beside = gamma + 0.01 * np.cross(*circle.axes)
    assert np.linalg.norm(flow(parameters, tuple(beside.T)), axis=0).max() > 1e-3 * rate_scale(
        parameters
    )
    for point, rate in zip(gamma, circle.rate(gamma), strict=True):
        values = np.sort(np.linalg.eigvals(jacobian(parameters, point)).real)
        assert values == pytest.approx(np.sort([0.0, rate]), abs=2e-15)


def test_the_circle_is_found_despite_rounding_of_K() -> None:
    """Fig. 5's K is computed from bodies: its rounding counts as zero, 1e-9 does not."""
    scene = load_scene("fig05b").parameters
    for K in (scene.K, (3e-16, -1e-16, 4e-16)):
        assert fixed_circle(replace(scene, K=K)) is not None
        assert len(fixed_points(replace(scene, K=K))) == 6
    for parameters in (replace(scene, K=(0.0, 0.0, 1e-9)), ball(A, NOTHING, NOTHING), CLASSICAL):
        assert fixed_circle(parameters) is None


# Limit cycles and manifolds ----------------------------------------------------------------


def test_a_cycles_multiplier_is_the_growth_of_a_neighbours_distance() -> None:
    """Fig. 8: a distance of 1e-6 grows by a factor of 2.28 in a period, to 1e-4."""
    parameters = from_rest(3.0)
    (cycle,) = limit_cycles(parameters)
    rate = np.array(flow(parameters, as_vector(cycle.gamma)))
    across = np.cross(cycle.gamma, rate / np.linalg.norm(rate))
    ends, times = [], np.array([0.0, cycle.period])
    for gamma in (cycle.gamma, cycle.gamma + 1e-6 * across):
        attitude = attitude_at(gamma / np.linalg.norm(gamma))
        ends.append(rotation_matrix(orbit(parameters, attitude, np.zeros(3), times)[:, :4])[-1, 2])
    assert np.abs(ends[0] - cycle.gamma).max() < 1e-10
    assert (ends[1] - ends[0]) @ across / 1e-6 == pytest.approx(cycle.multipliers[0].real, rel=1e-4)


def test_every_saddle_has_four_separatrices_along_the_flow() -> None:
    """They start 1e-4 from the saddle; dγ/dt is along them, or against them if stable."""
    ball = from_rest(0.3)
    points = fixed_points(ball)
    found = separatrices(ball, points, 100.0)
    assert len(found) == 4 * sum(point.kind == "saddle" for point in points)
    for one, other in zip(found[::2], found[1::2], strict=True):
        # Halves begin on opposite sides: measured 1e-8, the square of the offset.
        assert np.abs(one.path[0] + other.path[0] - 2 * one.saddle.gamma).max() < 3e-8
    for separatrix in found:
        assert np.linalg.norm(separatrix.path[0] - separatrix.saddle.gamma) < 1.1e-4
        middle = len(separatrix.path) // 2
        step = separatrix.path[middle + 1] - separatrix.path[middle - 1]
        rate = np.array(flow(ball, tuple(separatrix.path[middle])))
        if np.linalg.norm(rate) > 1e-3:
            along = step @ rate / np.linalg.norm(step) / np.linalg.norm(rate)
            assert along * (-1 if separatrix.stable else 1) > 0.99
    # Fig. 8's ball has no saddle.
    assert separatrices(from_rest(3.0), fixed_points(from_rest(3.0)), 10.0) == []

"""Continuation of normal forms and of the paper's balls, checked with independent computations."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from robotball.dynamics.continuation import (
    BRANCH,
    DOUBLING,
    DRIFT,
    FOLD,
    HOPF,
    Branch,
    Point,
    explore,
    steady,
)
from robotball.dynamics.cycles import (
    Cycle,
    close,
    level_vectors,
    limit_cycles,
    reversed_in_time,
    separatrices,
)
from robotball.dynamics.equilibria import (
    attitude_at,
    closed_form_points,
    fixed_points,
    kappa,
    linear_part,
    lyapunov_value,
)
from robotball.dynamics.long_run import basins
from robotball.dynamics.motion_branches import (
    Family,
    born_cycles,
    cycling,
    growth,
    resting,
)
from robotball.dynamics.straight_motions import stability_limit, straight_motions
from robotball.robot.scene import along_momentum
from robotball.rotations import Array
from robotball.theory.ensembles.orbits import LONG_RUN_TOLERANCE, orbits
from tests.figures import CHAOTIC, CLASSICAL, ball, from_rest, proposition_2, spread_starts
from tests.messages import untold

FIG10 = ball((0.5, 0.3, 0.6), (0.0, 0.0, 1.0), (4.0, 5.0, 0.0), d=0.1)
REST, ALONG_X = np.zeros(3), np.array([-1.0, 0.0, 0.0])


def over_K3(low: float, high: float) -> Family:
    """Return the family of Figs 6 to 8 over K₃."""
    return Family(from_rest(0.3), REST, "K3", low, high)


def special_values(family: Family, branches: Sequence[Branch], *kinds: str) -> list[float]:
    """Return the values at the special points of the given kinds, by default all, in order."""
    points = [point for branch in branches for point in branch.special(*kinds)]
    return sorted(family.value(point.x[-1]) for point in points)


def passing(branches: Sequence[Branch], s: float) -> int:
    """Return the number of solutions at s, which must not be the s of a point."""
    above = [np.array([point.x[-1] > s for point in branch.points]) for branch in branches]
    return sum(int(np.count_nonzero(sides[1:] != sides[:-1])) for sides in above)


# Normal forms ----------------------------------------------------------------------------------

FORMS: dict[str, tuple[Callable[[Any, float], Sequence[Any]], list[str]]] = {
    # of x and p: the function and its derivative by x
    "fold": (lambda x, p: (p + x * x, 2 * x), [FOLD]),
    "no fold": (lambda x, p: (p + x + x**3, 1 + 3 * x * x), []),
    "pitchfork": (lambda x, p: (p * x - x**3, p - 3 * x * x), [BRANCH, BRANCH]),
    "transcritical": (lambda x, p: (p * x - x * x, p - 2 * x), [BRANCH, BRANCH]),
    "imperfect": (lambda x, p: (p * x - x**3 + 0.01, p - 3 * x * x), [FOLD]),
    "Hopf": (lambda x, p: (x, p + 1j), [HOPF]),
    "doubling": (lambda x, p: (x, p + 1j * np.pi), [DOUBLING]),
    "no crossing": (lambda x, p: (x, p), []),
}


@pytest.mark.parametrize("name", FORMS)
def test_special_points_of_normal_forms_are_found(name: str) -> None:
    """At p = 0 to 1e-9 (measured 2e-10, from differences of 1e-7) on every branch, or nowhere.

    The imperfect pitchfork has only a fold, at p = 3 (0.01/2)^(2/3).
    """
    form, kinds = FORMS[name]

    def residual(u: Array, s: float) -> Array:
        return np.array([form(u[0], 2 * s - 1)[0]])

    def exponents(u: Array, s: float) -> Array:
        value = complex(form(u[0], 2 * s - 1)[1])
        return np.array([value, value.conjugate()] if value.imag == 1 else [value])

    roots = np.linspace(-1.5, 1.5, 31)
    starts = []
    for s in (0.0, 1.0):
        sizes = [abs(residual(np.array([x]), s)[0]) for x in roots]
        starts += [np.array([x, s]) for x, size in zip(roots, sizes, strict=True) if size < 0.06]
    branches = explore(steady(residual, exponents), starts, [])
    points = [point for branch in branches for point in branch.special()]
    assert [point.kind for point in points] == kinds
    at = 3 * 0.005 ** (2 / 3) if name == "imperfect" else 0.0
    assert [2 * point.x[-1] - 1 for point in points] == pytest.approx([at] * len(points), abs=1e-9)


@pytest.mark.parametrize(
    ("form", "start", "closed", "kind", "count"),
    [
        pytest.param(lambda x, p: p * x - x**3 + 3e-9, -0.95, 1e-9, BRANCH, 2, id="its error"),
        pytest.param(lambda x, p: p * x - x**3 + 3e-9, -0.95, 1e-13, FOLD, 1, id="no error"),
        pytest.param(lambda x, p: p * x - x**3 + 3e-5, -0.95, 1e-9, FOLD, 1, id="more"),
        pytest.param(lambda x, p: x * x - 1e-3 * p, -0.03, 1e-9, FOLD, 1, id="a flat fold"),
    ],
)
def test_an_imperfect_pitchfork_within_the_error_of_the_equations_is_a_branch_point(
    form: Callable[[Any, float], Any], start: float, closed: float, kind: str, count: int
) -> None:
    """The error explains the gap between its branches, which is 1.1e-3.

    It moves the point by 4e-6. Beyond a flat fold the equations have no solution.
    """

    def residual(u: Array, s: float) -> Array:
        return np.array([form(u[0], 2 * s - 1)])

    def exponents(u: Array, s: float) -> Array:
        return np.array([form(u[0] + 1e-30j, 2 * s - 1).imag / 1e-30 + 0j])

    problem = replace(steady(residual, exponents), closed=closed)
    branches = [*explore(problem, [np.array([start, 0.95])], [])]
    points = [point for branch in branches for point in branch.special()]
    assert [point.kind for point in points] == [kind] * count
    # 0 for the flat fold, 1.8e-3 = 3 (3e-5/2)^(2/3) for the last pitchfork, otherwise 3.9e-6.
    assert [2 * point.x[-1] - 1 for point in points] == pytest.approx([0.0] * count, abs=2e-3)


@pytest.mark.parametrize(("differ", "count"), [(0.0, 1), (1.0, 2)])
def test_solutions_that_differ_by_a_free_direction_are_identified(
    differ: float, count: int
) -> None:
    """Two headings on x² + y² = 1 + s are the same solution unless their exponents differ."""

    def residual(u: Array, s: float) -> Array:
        off = u[0] ** 2 + u[1] ** 2 - 1 - s
        return np.array([off * u[0], off * u[1], u[2]])

    def exponents(u: Array, s: float) -> Array:
        return np.array([-2 * (1 + s), differ * u[0] / np.sqrt(1 + s) - 2])

    starts = [np.array([np.cos(a), np.sin(a), 0.0, 0.0]) for a in (0.3, 1.8)]
    assert len([*explore(steady(residual, exponents), starts, [])]) == count


@pytest.mark.parametrize(
    ("neutral", "turning"), [(0.0, 0.0), (1e-7, 0.0), (-1e-7, 0.0), (0.0, 1.0)]
)
def test_branches_with_a_free_direction_cross(neutral: float, turning: float) -> None:
    """An exponent besides the one of the free direction vanishes, up to any error of the latter.

    The problem is x² + y² = 1 and pz = z³, with any heading of (x, y) and p = 2s - 1. If the
    heading drifts for z ≠ 0, no solution branches off.
    """

    def residual(u: Array, s: float) -> Array:
        off, turn = u[0] ** 2 + u[1] ** 2 - 1, turning * u[2]
        rates = off * u[0] - turn * u[1], off * u[1] + turn * u[0]
        return np.array([*rates, (2 * s - 1) * u[2] - u[2] ** 3])

    def exponents(u: Array, s: float) -> Array:
        return np.array([-2.0, neutral * (1 - 4 * s), 2 * s - 1 - 3 * u[2] ** 2], dtype=complex)

    branches = [*explore(steady(residual, exponents), [np.array([0.6, 0.8, 0.0, 0.1])], [])]
    assert len(branches) == (1 if turning else 2)
    (point,) = branches[0].special()
    assert point.kind == (DRIFT if turning else BRANCH)
    assert point.x[-1] == pytest.approx(0.5, abs=1e-6)  # measured 5e-8 per 1e-7 of the error


@pytest.mark.parametrize("cubic", [-2.0, -0.5, 0.5])
def test_the_first_lyapunov_value_of_a_normal_form_is_exact(cubic: float) -> None:
    """dr/dt = cubic r³ + rz, dz/dt = r² - z gives (cubic + 1) r³ on the centre manifold.

    In the eigenvector's axes it is half of that. At cubic = -0.5 only the quadratic terms decide
    the sign.
    """
    axes = np.array([[1.0, 0.3, -0.2], [0.4, 1.1, 0.5], [-0.1, 0.2, 0.9]])

    def flow(point: Array) -> Array:
        x, y, z = np.tensordot(np.linalg.inv(axes), point, 1)
        square = x * x + y * y
        growth = cubic * square + z
        rate = np.stack([growth * x - 3 * y, growth * y + 3 * x, square - z])
        return np.asarray(np.tensordot(axes, rate, 1))

    # A unit eigenvector of the flow is a multiple of the form's (1, -i, 0).
    scale = np.linalg.norm(axes @ np.array([1.0, -1j, 0.0])) ** 2
    assert lyapunov_value(flow, 3) * scale == pytest.approx(cubic + 1, abs=1e-9)


# Fixed points from rest ------------------------------------------------------------------------


def test_folds_agree_with_the_closed_form() -> None:
    """|κ₁| = 1 at 0.51503 and |κ₂| = 1 at 2.08207, twice each, to 1e-8; no other special points."""
    family = over_K3(0.1, 2.5)
    branches = [*resting(family)]
    (O1, O2, O3), (a1, a2, a3) = from_rest(0.3).Omega, from_rest(0.3).A
    closed = [(O3 - np.hypot(O, O3)) * (a3 - a) / (2 * a * a3) for O, a in ((O2, a2), (O1, a1))]
    assert special_values(family, branches) == pytest.approx(
        [closed[0]] * 2 + [closed[1]] * 2, abs=1e-8
    )
    assert special_values(family, branches, FOLD) == special_values(family, branches)
    assert [abs(kappa(from_rest(K3), j)) for j, K3 in zip((1, 0), closed, strict=True)] == (
        pytest.approx([1.0, 1.0], rel=1e-14)
    )
    for K3, count in ((0.3, 10), (0.52, 6), (2.3, 2)):
        assert passing(branches, (K3 - 0.1) / 2.4 + 1e-9) == count
        assert len(fixed_points(from_rest(K3))) == count


def test_branches_cross_where_the_poles_change_their_type() -> None:
    """A₁A₂ = 0 (Proposition 2) at K₃ = -4/3 and -5/6 to 1e-8, on both branches."""
    family = over_K3(-1.6, -0.1)
    at = np.array(special_values(family, [*resting(family)], BRANCH))
    assert len(at) >= 8
    for K3, i, of in ((-4 / 3, 0, at < -1), (-5 / 6, 1, at > -1)):
        assert np.count_nonzero(of) >= 4
        assert np.abs(at[of] - K3).max() < 1e-8
        assert proposition_2(from_rest(K3))[i] == pytest.approx(0.0, abs=1e-14)


@pytest.mark.parametrize(
    "name", ["K1", *(pytest.param(n, marks=pytest.mark.study) for n in ("Omega12", "K31"))]
)
def test_branches_contain_all_fixed_points(name: str) -> None:
    """For a ball without symmetry, at three values in the range, compared with the resultant."""
    parameters = replace(from_rest(0.6), K=(0.2, -0.3, 0.6))
    low, high = (10.0, 80.0) if len(name.lstrip("KOmega")) > 1 else (0.3, 3.0)
    family = Family(parameters, REST, name, low, high)
    branches = [*resting(family)]
    for s in (0.217, 0.481, 0.793):
        assert passing(branches, s) == len(fixed_points(family.at(s)[0]))


# Straight lines --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("family", "count"),
    [
        pytest.param(Family(FIG10, ALONG_X * np.sqrt(3.0), "K3", -1.5, 1.0), 4, id="rubber"),
        pytest.param(
            Family(CLASSICAL, np.array([-np.sqrt(7.0), 0.0, 3.0]), "c", 2.5, 3.5), 2, id="classical"
        ),
    ],
)
def test_branches_contain_all_straight_lines(family: Family, count: int) -> None:
    """At one value in the range, compared with the closed form; M² and (M, γ) hold to 1e-12."""
    branches, s = [*resting(family)], 0.6180339
    parameters, size, c = family.at(s)
    lines = straight_motions(parameters, size**2, c * size)
    assert passing(branches, s) == len(lines) == count
    for line in lines:
        M = line.momentum
        assert [M @ M, M @ line.gamma] == pytest.approx([size**2, c * size], abs=1e-12)


def test_the_hopf_point_of_straight_lines_is_supercritical() -> None:
    """Two of four lines have it at f = 16/7.69 (Routh and Hurwitz, to 1e-8); l₁ = -0.00499 1/s.

    Above it a stable cycle is born. At f = 2.2 a motion from beside the line ends on the branch's
    cycle, with the same period to 1e-9 (measured 1e-12); at f = 2.05 it returns to the line.
    """
    family = Family(FIG10, ALONG_X * np.sqrt(2.0), "f", 1.5, 2.2)
    branches, limit = [*resting(family)], stability_limit(FIG10)
    assert special_values(family, branches, HOPF) == pytest.approx([limit, limit], abs=1e-8)
    assert special_values(family, branches) == special_values(family, branches, HOPF)
    value, born = born_cycles(family, branches[0].special(HOPF)[0], 10.0, 60)
    assert value == pytest.approx(-0.00499, abs=1e-5)
    assert all(point.is_stable and point.x[-1] > born.points[0].x[-1] for point in born.points[1:])
    assert born.points[-1].x[-1] == 1.0
    ends = {}
    for f in (2.05, 2.2):
        line = max(straight_motions(FIG10, f), key=lambda motion: float(motion.polynomial[-1]))
        beside = line.gamma + np.array([0.0, 0.0, 0.02])
        start = along_momentum(beside / np.linalg.norm(beside), line.momentum)
        M = np.array([-np.sqrt(f), 0.0, 0.0])
        times = np.array([0.0, 4000.0])
        run = orbits(FIG10, start.attitude[None], M[None], times, LONG_RUN_TOLERANCE)
        ends[f] = run.attitudes[0, 1], M, line.gamma
    attitude, M, gamma = ends[2.05]  # the tolerance is the rest after 4000 s at -0.0011 1/s
    assert np.linalg.norm(level_vectors(attitude, M)[0] - gamma) < 1e-3
    cycle = close(FIG10, ends[2.2][0], M := ends[2.2][1], 1.95)
    assert np.linalg.norm(level_vectors(cycle.attitude, M)[0] - ends[2.2][2]) > 0.1
    assert cycle.period == pytest.approx(float(np.exp(born.points[-1].x[-2])), rel=1e-9)
    (back,) = cycling(family, [(cycle, 1.0)], 10.0)
    assert untold(["point", "range"], back.ends) == []
    assert family.value(back.points[0].x[-1]) == pytest.approx(limit, abs=1e-5)  # 6e-8


def test_born_cycles_grow_as_the_first_lyapunov_value_predicts() -> None:
    """r² = -(dRe λ/ds)(s - s*)/l₁ for both signs of l₁, over K₃ at f = 3, to 1 % (measured 0.3 %).

    With K outside the plane orthogonal to Ω, the two ends of the unstable range differ: at K₃ =
    -0.89 stable cycles are born, at 1.03 unstable ones. There the real parts of the pair vanish to
    1e-8 (measured 2e-9, which counts as zero beside 3 rad/s).
    """
    family = Family(FIG10, ALONG_X * np.sqrt(3.0), "K3", -1.7, 1.7)
    branch = next(candidate for candidate in resting(family) if candidate.special(HOPF))
    values = []
    for hopf in branch.special(HOPF):
        u, s = hopf.x[:-1], hopf.x[-1]
        value, born = born_cycles(family, hopf, 10.0, 2)
        values.append(value)
        flow, size = family.flow(u, s)
        roots, vectors = np.linalg.eig(linear_part(flow, size))
        assert np.abs(roots.real).min() < 1e-8
        # The flow's coordinates are half of a rotation ξ, which moves γ and μ by v×ξ.
        pair = 2 * vectors[:, np.argmax(roots.imag)].real
        out = np.concatenate([np.cross(v, pair) for v in u.reshape(-1, 3)])
        r = (born.points[1].x[:6] - u) @ out / (out @ out)
        at = [point is hopf for point in branch.points].index(True)
        near = branch.points[at - 3 : at + 4]
        leading = [point.exponents[np.argmax(point.exponents.imag)].real for point in near]
        slope = np.polyfit([point.x[-1] - s for point in near], leading, 3)[-2]
        law = -slope * (born.points[1].x[-1] - s) / value
        assert r**2 == pytest.approx(law, rel=0.01)
        assert born.points[1].is_stable == (value < 0)
    assert np.sign(values).tolist() == [-1.0, 1.0]


# Cycles ----------------------------------------------------------------------------------------


def long_cycle() -> Cycle:
    """Return the unstable cycle at K₃ = 0.51, closed backwards in time, beside ten fixed points."""
    beside = attitude_at(np.array([-0.0247, 0.8990, -0.4373]))
    back = close(reversed_in_time(from_rest(0.51)), beside, REST, 82.006)
    return replace(back, multipliers=1 / back.multipliers)


def test_the_cycle_exists_before_the_folds_of_fixed_points() -> None:
    """The paper: it "arises from the closed contour" at |κ₁| = 1. But at K₃ = 0.51 both exist.

    Its period is 82.00639 s, also according to the search; at K₃ = 0.5 there are ten points and no
    cycle.
    """
    searched = limit_cycles(from_rest(0.51), 100.0, 16)
    assert [cycle.period for cycle in searched] == pytest.approx([82.00639], abs=1e-5)
    assert long_cycle().period == pytest.approx(searched[0].period, rel=1e-10)
    assert len(fixed_points(from_rest(0.51))) == 10
    assert limit_cycles(from_rest(0.5), 300.0) == []


def test_the_cycle_ends_at_a_saddle_connection() -> None:
    """At K₃ = 0.503566, where the manifolds of δ₃ and δ₄ meet, to 1e-5 (measured 1.2e-6 at 300 s).

    The period grows logarithmically (power 0); at a saddle-node on the cycle the power would be
    1/2.
    """
    family = over_K3(0.495, 0.51)
    (branch,) = cycling(family, [(long_cycle(), 1.0)], 300.0)
    assert branch.ends[0].startswith("its period passes 300 s")
    assert all(not point.is_stable for point in branch.points)
    s, power = growth(branch.points[::-1])
    assert power == 0.0

    def is_below(K3: float) -> bool:
        """Return whether δ₄'s unstable manifold ends at two different points, θ₃ and θ₄."""
        parameters = from_rest(K3)
        saddle = closed_form_points(parameters)["δ₄"]
        ends = [
            line.end.gamma
            for line in separatrices(parameters, fixed_points(parameters), 200.0)
            if line.end and not line.stable and np.abs(line.saddle.gamma - saddle).max() < 1e-6
        ]
        return bool(np.abs(ends[0] - ends[1]).max() > 1e-6)

    low, high = 0.5035, 0.5037
    while high - low > 1e-7:
        middle = (low + high) / 2
        low, high = (middle, high) if is_below(middle) else (low, middle)
    assert family.value(s) == pytest.approx(low, abs=1e-5)


def test_a_cycle_of_double_period_branches_off_at_a_multiplier_of_minus_one() -> None:
    """The ball of Figs 11b and 14 with K₂ from 4 to 3.85: at 3.892931, by bisection to 1e-6.

    The new branch has cycles of twice the period, which do not close after half of it.
    """
    attitudes, momenta = spread_starts(0, 10)
    (single, *_) = basins(replace(CHAOTIC, K=(2.0, 4.0, 0.0)), attitudes, momenta, 1500.0).cycles
    family = Family(replace(CHAOTIC, K=(2.0, 4.0, 0.0)), momenta[0], "K2", 3.85, 4.0)
    branch, double = cycling(family, [(single, 1.0)], 20.0)
    (at,) = special_values(family, [branch], DOUBLING)
    low, high = 3.85, 4.0
    cycle = single
    while high - low > 1e-7:
        middle = (low + high) / 2
        ball_there = replace(CHAOTIC, K=(2.0, middle, 0.0))
        cycle = close(ball_there, cycle.attitude, single.momentum, cycle.period)
        low, high = (middle, high) if cycle.multipliers[0].real < -1 else (low, middle)
    assert at == pytest.approx(low, abs=1e-6)
    end = double.points[-1].x
    gamma, M = end[:3], 5.0 * end[3:6]
    start = along_momentum(gamma, M)
    there, period = family.at(end[-1])[0], float(np.exp(end[-2]))
    assert close(there, start.attitude, start.momentum, period).period == pytest.approx(period)
    half_way = orbits(there, start.attitude[None], start.momentum[None], np.array([0, period / 2]))
    apart = level_vectors(half_way.attitudes[0, 1], start.momentum)[0] - gamma
    assert np.linalg.norm(apart) > 0.01
    assert period / 2 == pytest.approx(cycle.period, rel=0.05)


def test_the_growth_law_of_a_period_is_recovered() -> None:
    """s* to 1e-6 and p, for T = |s - 0.2|^-1/2, and for T = -10 ln |s - 0.2| with p = 0."""
    laws: list[tuple[Callable[[Any], Any], float, Array]] = [
        (lambda T: 0.2 + T**-2, 0.5, np.geomspace(10.0, 200.0, 30)),
        (lambda T: 0.2 + np.exp(-T / 10), 0.0, np.geomspace(10.0, 100.0, 60)),
    ]
    for law, power, T in laws:
        slopes = (law(T * 1.00001) - law(T / 1.00001)) / 2e-5
        points = [
            Point(np.array([0.0, np.log(t), law(t)]), np.array([0.0, 1.0, slope]), np.zeros(1))
            for t, slope in zip(T, slopes, strict=True)
        ]
        s, found_power = growth(points)
        assert s == pytest.approx(0.2, abs=1e-6)
        assert found_power == pytest.approx(power, abs=1e-3)

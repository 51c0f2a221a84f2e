"""Continuation: normal forms, the bifurcations of the paper's balls, each by a second computation."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest

from robotball.engines.ensembles.orbits import LONG_RUN_TOLERANCE, orbits
from robotball.equations import Parameters
from robotball.qualitative.continuation import (
    BRANCH,
    DOUBLING,
    FOLD,
    HOPF,
    Branch,
    explore,
    steady,
)
from robotball.qualitative.cycles import Cycle, close
from robotball.qualitative.equilibria import attitude_at, fixed_points, kappa, proposition_2
from robotball.qualitative.motion_branches import (
    Family,
    born_cycles,
    cycling,
    growth,
    resting,
    vectors_of,
)
from robotball.qualitative.normal_forms import lyapunov_value
from robotball.qualitative.portraits import limit_cycles, reversed_in_time, separatrices
from robotball.qualitative.straight_motions import stability_limit, straight_motions
from robotball.rotations import Array
from tests.figures import CLASSICAL, ball, from_rest

FIG10 = ball((0.5, 0.3, 0.6), (0.0, 0.0, 1.0), (4.0, 5.0, 0.0), d=0.1)
REST, ALONG_X = np.zeros(3), np.array([-1.0, 0.0, 0.0])


def over_K3(low: float, high: float) -> Family:
    """Figs 6 to 8."""
    return Family(from_rest(0.3), REST, "K3", low, high)


def found(family: Family, branches: Sequence[Branch], *kinds: str) -> list[float]:
    """The values of special points of some kinds, or of all, in their order."""
    points = [point for each in branches for point in each.special(*kinds)]
    return sorted(family.value(point.x[-1]) for point in points)


def passing(branches: Sequence[Branch], s: float) -> int:
    """How many solutions the branches have at an s that is no point's."""
    above = [np.array([point.x[-1] > s for point in each.points]) for each in branches]
    return sum(int(np.count_nonzero(each[1:] != each[:-1])) for each in above)


# Normal forms ----------------------------------------------------------------------------------

FORMS: dict[str, tuple[Callable[[Array, float], Sequence[complex]], list[str]]] = {
    # of x and p: the function and its derivative by x
    "fold": (lambda x, p: (p + x * x, 2 * x), [FOLD]),
    "no fold": (lambda x, p: (p + x + x**3, 1 + 3 * x * x), []),
    "pitchfork": (lambda x, p: (p * x - x**3, p - 3 * x * x), [BRANCH, BRANCH]),
    "transcritical": (lambda x, p: (p * x - x * x, p - 2 * x), [BRANCH, BRANCH]),
    "imperfect": (lambda x, p: (p * x - x**3 + 0.01, p - 3 * x * x), [FOLD]),
    "Hopf": (lambda x, p: (x, p + 1j), [HOPF]),
    "doubling": (lambda x, p: (x, p + 1j * np.pi), [DOUBLING]),
}


@pytest.mark.parametrize("name", FORMS)
def test_normal_forms_have_their_special_points(name: str) -> None:
    """At p = 0 to 1e-9 (2e-10, by differences of 1e-7) on every branch, or nowhere.

    The imperfect pitchfork has a fold alone, at p = 3 (0.01/2)^(2/3).
    """
    form, kinds = FORMS[name]

    def residual(u: Array, s: float) -> Array:
        return np.array([form(u[0], 2 * s - 1)[0]])

    def exponents(u: Array, s: float) -> Array:
        value = complex(form(u[0], 2 * s - 1)[1])
        return np.array([value, value.conjugate()] if value.imag else [value])

    roots = np.linspace(-1.5, 1.5, 31)
    starts = []
    for s in (0.0, 1.0):
        sizes = [abs(residual(np.array([x]), s)[0]) for x in roots]
        starts += [np.array([x, s]) for x, size in zip(roots, sizes, strict=True) if size < 0.06]
    points = [p for each in explore(steady(residual, exponents), starts) for p in each.special()]
    assert [point.kind for point in points] == kinds
    at = 3 * 0.005 ** (2 / 3) if name == "imperfect" else 0.0
    assert [2 * point.x[-1] - 1 for point in points] == pytest.approx([at] * len(points), abs=1e-9)


@pytest.mark.parametrize("cubic", [-2.0, -0.5, 0.5])
def test_the_first_lyapunov_value_of_a_normal_form(cubic: float) -> None:
    """dr/dt = cubic r³ + rz, dz/dt = r² - z: (cubic + 1) r³ on the centre manifold, in any axes.

    In the eigenvector's axes half of that. At -0.5 its sign is the quadratic terms' alone.
    """
    axes = np.array([[1.0, 0.3, -0.2], [0.4, 1.1, 0.5], [-0.1, 0.2, 0.9]])

    def flow(point: Array) -> Array:
        x, y, z = np.tensordot(np.linalg.inv(axes), point, 1)
        square = x * x + y * y
        growth = cubic * square + z
        rate = np.stack([growth * x - 3 * y, growth * y + 3 * x, square - z])
        return np.asarray(np.tensordot(axes, rate, 1))

    # A unit eigenvector of the flow is the form's (1, -i, 0) times a factor.
    scale = np.linalg.norm(axes @ np.array([1.0, -1j, 0.0])) ** 2
    assert lyapunov_value(flow, 3) * scale == pytest.approx(cubic + 1, abs=1e-9)


# Fixed points from rest ------------------------------------------------------------------------


def test_folds_are_where_the_closed_form_has_them() -> None:
    """|κ₁| = 1 at 0.51503, |κ₂| = 1 at 2.08207: to 1e-8, twice each; nothing else is special."""
    family = over_K3(0.1, 2.5)
    branches = resting(family)
    (O1, O2, O3), (a1, a2, a3) = from_rest(0.3).Omega, from_rest(0.3).A
    closed = [
        (O3 - np.hypot(O, O3)) * (a3 - a) / (2 * a * a3) for O, a in ((O2, a2), (O1, a1))
    ]
    assert found(family, branches) == pytest.approx([closed[0]] * 2 + [closed[1]] * 2, abs=1e-8)
    assert found(family, branches, FOLD) == found(family, branches)
    assert [abs(kappa(from_rest(K3), j)) for j, K3 in zip((1, 0), closed, strict=True)] == (
        pytest.approx([1.0, 1.0], rel=1e-14)
    )
    for K3, count in ((0.3, 10), (0.52, 6), (2.3, 2)):
        assert passing(branches, (K3 - 0.1) / 2.4 + 1e-9) == count
        assert len(fixed_points(from_rest(K3))) == count


def test_branches_cross_where_the_types_of_the_poles_change() -> None:
    """A₁A₂ = 0 of Proposition 2, K₃ = -4/3 and -5/6, to 1e-8, at Γ₅ and Γ₆ each."""
    family = over_K3(-1.6, -0.1)
    at = found(family, resting(family), BRANCH)
    assert at[:2] + at[-2:] == pytest.approx([-4 / 3] * 2 + [-5 / 6] * 2, abs=1e-8)
    for K3, i in ((at[0], 0), (at[-1], 1)):
        assert proposition_2(from_rest(K3))[i] == pytest.approx(0.0, abs=1e-8)


@pytest.mark.parametrize("name", ["K1", "Omega2", "Omega12", "K31"])
def test_branches_pass_as_many_points_as_there_are(name: str) -> None:
    """Of a ball with no symmetry, at three values within the range, by the resultant."""
    some = replace(from_rest(0.6), K=(0.2, -0.3, 0.6))
    low, high = (10.0, 80.0) if len(name.lstrip("KOmega")) > 1 else (0.3, 3.0)
    family = Family(some, REST, name, low, high)
    branches = resting(family)
    for s in (0.217, 0.481, 0.793):
        assert passing(branches, s) == len(fixed_points(family.at(s)[0]))


# Straight lines --------------------------------------------------------------------------------


def test_the_hopf_point_of_straight_lines_is_supercritical() -> None:
    """At f = 16/7.69 by Routh and Hurwitz, to 1e-8, of two of the four; l₁ = -0.00499 1/s.

    Above it a stable cycle is born: at f = 2.2 the motion from beside the line ends on one with the
    branch's period, to 1e-6; at f = 2 it returns to the line.
    """
    family = Family(FIG10, ALONG_X * np.sqrt(2.0), "f", 1.5, 2.2)
    branches = resting(family)
    limit = stability_limit(FIG10)
    assert found(family, branches) == pytest.approx([limit, limit], abs=1e-8)
    (hopf,) = branches[0].special() or branches[1].special()
    assert hopf.kind == HOPF
    value, born = born_cycles(family, hopf, 100)
    assert value == pytest.approx(-0.00499, abs=1e-5)
    assert all(point.is_stable for point in born.points[1:])
    assert [family.value(point.x[-1]) > limit for point in born.points[1:]] == [True] * (
        len(born.points) - 1
    )
    assert born.points[-1].x[-1] == 1.0
    for f, s in ((2.2, 1.0), (2.0, 0.0)):
        line = straight_motions(FIG10, f)
        stable = max(line, key=lambda each: -each.eigenvalues.real.sum())
        assert stable is not None

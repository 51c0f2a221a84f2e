"""Section 4.2: how the fixed points of Figs 6 to 8 depend on K₃, and the limit cycles."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.optimize import brentq

from robotball.dynamics import equilibria
from robotball.dynamics.cycles import Cycle, limit_cycles
from robotball.rotations import Array, tangents
from tests.paper import formulas as f
from tests.paper.captions import CAPTIONS
from tests.paper.formulas import Numbers, count, paper_scene
from tests.paper.test_section_4_2_with_k import DELTA, THETA, growth_in_a_turn, kappa, points

FIG6 = CAPTIONS["fig06"].n


def with_K3(K3: float) -> Numbers:
    """Return the ball of Figs 6 to 8 with another K₃."""
    return replace(FIG6, K=np.array([0.0, 0.0, K3]))


@cache
def number(K3: float, starts: int = 150) -> int:
    """Return the number of fixed points of (4.1) that a search from `starts` points finds."""
    return len(f.zeros(f.from_rest(with_K3(K3)), starts))


def test_without_K3_alone_there_is_a_circle_of_fixed_points() -> None:
    """Section 4.2: for K₃ ≠ 0, (Ω,γ) = 0 does not consist of fixed points."""

    def fastest(name: str) -> float:
        n = CAPTIONS[name].n
        rates = f.from_rest(n)(f.sigma(n, np.linspace(0.0, 2 * np.pi, 100)).T)
        return float(np.linalg.norm(rates, axis=0).max())

    assert fastest("fig06") >= 0.05  # 1/s; measured 0.09
    assert fastest("fig05b") < 1e-14  # control: K₃ = 0, 4e-17


def test_delta_and_theta_exist_if_kappa_is_below_one() -> None:
    """Section 4.2: Δ if and only if |κ₁| < 1, Θ if and only if |κ₂| < 1; by a search."""

    def wrong(sign: float) -> list[bool]:
        wrong_cases = []
        for K3 in (-3.0, -1.2, -0.5, -0.1, 0.2, 0.5, 1.0, 2.5):
            kappas = [kappa(with_K3(K3), j, sign) for j in (DELTA, THETA)]
            wrong_cases.append(number(K3) != 2 + 4 * sum(abs(k) < 1 for k in kappas))
        return wrong_cases

    assert count(wrong(+1)) == 0  # of 8
    assert count(wrong(-1)) >= 2  # control: the sign of K₃, 4


def test_the_absolute_values_of_kappa_decide_the_number_of_points() -> None:
    """Section 4.2, E12: 10 if |κ₂| < |κ₁| < 1, 6 if |κ₂| < 1 < |κ₁|, 2 if 1 < |κ₂| < |κ₁|.

    The paper prints the conditions without absolute values.
    """

    def wrong(size: Callable[[float], float], sign: float = 1.0) -> list[bool]:
        wrong_cases = []
        for K3 in (0.3, 0.52, 3.0):  # Figs 6 to 8
            one, two = (size(kappa(with_K3(K3), j, sign)) for j in (DELTA, THETA))
            cases = {10: 0 < two < one < 1, 6: two < 1 < one, 2: 1 < two < one}
            wrong_cases.append([points for points, holds in cases.items() if holds] != [number(K3)])
        return wrong_cases

    assert count(wrong(abs)) == 0  # of 3
    assert count(wrong(float)) == 3  # printed
    assert count(wrong(abs, sign=-1)) == 3  # control: the sign of K₃


@pytest.mark.parametrize(
    ("j", "K3", "more"), [(DELTA, 0.51503, 10), (THETA, 2.08207, 6)], ids=["Δ", "Θ"]
)
def test_the_points_disappear_where_kappa_is_one(j: int, K3: float, more: int) -> None:
    """Section 4.2: |κ₁| = 1 or |κ₂| = 1; the search finds four fewer points above it."""

    def vanish(at: float, side: float, starts: int = 150) -> bool:
        return (number(at - side, starts), number(at + side, starts)) == (more, more - 4)

    def solve(factor: float) -> float:
        return float(brentq(lambda x: abs(kappa(with_K3(x), j, factor)) - 1, K3 / 2, 2 * K3))

    assert vanish(solve(1.0), 0.01)
    assert not vanish(solve(0.9), 0.01)  # control: the factor of K₃
    assert vanish(K3, 1e-4, starts=200)
    assert not vanish(1.01 * K3, 1e-4, starts=200)  # control: K₃ by a hundredth


# Fig. 6 --------------------------------------------------------------------------------------


def named() -> dict[str, Array]:
    """Return the fixed points of Fig. 6 by name."""
    made = {"Γ₅": f.E[2], "Γ₆": -f.E[2]}
    for letter, j in (("δ", DELTA), ("θ", THETA)):
        names = [letter + index for index in "₁₂₃₄"]
        made |= dict(zip(names, points(FIG6, j), strict=True))
    return made


def kind(n: Numbers, gamma: Array) -> str:
    """Return the type of a fixed point from its eigenvalues, or from a turn about a weak focus."""
    values = f.eigenvalues(f.from_rest(n), gamma)
    if abs(values.imag).max() == 0:
        if values[0].real * values[1].real < 0:
            return "saddle"
        return "stable node" if values[1].real < 0 else "unstable node"
    if abs(values.real).max() < 1e-12:
        return "slow stable focus" if growth_in_a_turn(n, 0.01) < 0 else "slow unstable focus"
    return "stable focus" if values[1].real < 0 else "unstable focus"


KINDS = {
    "saddle": ("θ₁", "θ₂", "δ₃", "δ₄"),
    "stable focus": ("θ₃", "θ₄"),
    "unstable node": ("δ₁", "δ₂"),
    "slow stable focus": ("Γ₅", "Γ₆"),
}


def test_the_ten_points_of_fig_6_have_their_types() -> None:
    """Fig. 6, from a search and eigenvalues; robotball's points, types and names too."""
    zeros, ours = f.zeros(f.from_rest(FIG6)), equilibria.fixed_points(f.ball(FIG6))
    assert len(zeros) == len(ours) == 10
    wrong = 0
    for name, at in named().items():
        assert min(np.linalg.norm(at - zero) for zero in zeros) < 1e-9
        (point,) = [p for p in ours if np.linalg.norm(at - p.gamma) < 1e-9]
        assert equilibria.name_of(f.ball(FIG6), at) == name
        assert point.kind == kind(FIG6, at)
        assert name in KINDS[point.kind]
        wrong += name.translate(str.maketrans("δθ", "θδ")) not in KINDS[point.kind]
    assert wrong == 8  # control: δ and θ exchanged


def branches_off(sense: float) -> int:
    """Count the branches of δ₃ and δ₄, of four, that do not end at δ₁ or δ₂.

    sense: 1 for their unstable manifolds, -1 for the stable ones, which are followed back in time.
    """
    field, at, off = f.from_rest(FIG6), named(), 0
    for saddle in (at["δ₃"], at["δ₄"]):
        basis = tangents(saddle)
        values, vectors = np.linalg.eig(basis @ f.jacobian(field, saddle) @ basis.T)
        leaving = basis.T @ vectors[:, np.argmax(sense * values.real)].real
        for side in (1e-5, -1e-5):
            start, times = saddle + side * leaving, np.array([0.0, 300.0])
            end = f.followed(lambda x: sense * field(x), start, times, rtol=1e-9)[-1]
            off += bool(min(np.linalg.norm(end - at[node]) for node in ("δ₁", "δ₂")) > 1e-5)
    return off


def test_the_stable_manifolds_of_two_saddles_form_the_closed_contour_of_fig_6() -> None:
    """Fig. 6, section 4.2, E27. The paper prints the stable and unstable manifolds of δ₃ and δ₄."""
    assert branches_off(-1) == 0  # of 4
    assert branches_off(+1) == 4  # printed: these too; and the control: these alone


# Limit cycles --------------------------------------------------------------------------------


def test_the_limit_cycle_exists_before_delta_disappears() -> None:
    """After Fig. 6, E28: at K₃ = 0.51, |κ₁| < 1. The paper prints that it arises at |κ₁| = 1."""

    def cycles(K3: float) -> int:
        return len(limit_cycles(f.ball(with_K3(K3)), 100.0, starts=4))  # its period is 82 s

    assert (cycles(0.51), number(0.51)) == (1, 10)  # printed: no cycle beside the ten points
    assert cycles(0.5) == 0  # control: below K₃ = 0.5036


@cache
def cycles_of(name: str) -> list[Cycle]:
    """Return the limit cycles of a figure with periods up to twice the known one."""
    longest = 12.0 if name == "fig08" else 120.0  # s
    return limit_cycles(paper_scene(name).parameters, longest, starts=16)


@pytest.mark.parametrize(
    ("name", "period", "bound"), [("fig07", 60.0086, 1e-4), ("fig08", 6.09094, 1e-5)]
)
def test_figs_7_and_8_have_one_limit_cycle_and_it_is_unstable(
    name: str, period: float, bound: float
) -> None:
    """Figs 7 and 8; its multiplier from the divergence along it. The periods are not printed."""
    (cycle,) = cycles_of(name)
    assert abs(cycle.period - period) <= bound  # s; measured 3e-5 and 1.0e-6: its last digit
    field = f.from_rest(CAPTIONS[name].n)
    # Back in time the cycle attracts, and errors of the integration decay.
    times = np.linspace(0.0, cycle.period, 4001)
    path = f.followed(lambda x: -field(x), cycle.gamma, times)
    J = f.jacobian(field, path[1:].T)
    # The divergence on the sphere is the trace without the component along γ.
    rates = np.trace(J, axis1=1, axis2=2) - np.einsum("ni,nij,nj->n", path[1:], J, path[1:])
    growth = float(np.exp(cycle.period * np.mean(rates)))
    assert np.linalg.norm(path[-1] - cycle.gamma) < 1e-8
    assert growth >= 1.01  # in a period; measured 7.4e8 and 2.28
    assert abs(cycle.multipliers[0] / growth - 1) < 1e-6
    assert cycles_of("fig06") == []  # control: the K₃ of Fig. 6

"""Section 4.2, motion from rest with K = (0, 0, K₃): fixed points and Proposition 2."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest
from numpy import arcsin, arctan2, pi, sqrt

from robotball.dynamics import equilibria
from robotball.dynamics.equilibria import flow_near, lyapunov_value
from robotball.robot.formulas import as_vector
from robotball.rotations import Array
from tests import figures
from tests.paper import formulas as f
from tests.paper.formulas import Errors, Numbers, count, worst
from tests.robotball.dynamics.test_equilibria import random_ball

DELTA, THETA = 1, 0  # the index j of the γⱼ that is not zero beside γ₃


@cache
def balls() -> tuple[Numbers, ...]:
    """Return 200 random balls; K₃ of either sign, |Ω₃| < 1 so that the printed arcsin exists."""
    random, made = np.random.default_rng(51), []
    for _ in range(200):
        A, K3 = random.uniform(0.2, 1.0, 3), random.uniform(-3.0, 3.0)
        Omega = random.uniform(-1.0, 1.0, 3) * [4.0, 4.0, 1.0]
        made.append(f.with_A(tuple(A), Omega, np.array([0.0, 0.0, K3])))
    return tuple(made)


def A1_A2(n: Numbers) -> tuple[float, float]:
    """Return a₁a₃K₃ + (a₁ - a₃)Ω₃ and a₂a₃K₃ + (a₂ - a₃)Ω₃ of Prop. 2."""
    (a1, a2, a3), K3, Omega3 = n.moments, n.K[2], n.Omega[2]
    return a1 * a3 * K3 + (a1 - a3) * Omega3, a2 * a3 * K3 + (a2 - a3) * Omega3


def test_of_the_isolated_fixed_points_two_stay() -> None:
    """(4.6): Γ₅ and Γ₆, on the axis of K."""

    def wrong(along: int) -> Errors:
        for n in balls():
            field = f.from_rest(f.with_A(tuple(n.moments), n.Omega, n.K[2] * f.E[along]))
            for i, gamma in enumerate(f.E):
                yield (np.linalg.norm(field(gamma)) < 1e-14) != (i == 2)

    assert count(wrong(along=2)) == 0  # of 600
    assert count(wrong(along=0)) == 400  # control: K along e₁


def test_no_fixed_point_is_missed() -> None:
    """Not in the paper: a search finds no point that robotball's list of 12 random balls lacks."""
    rng = np.random.default_rng(4)
    numbers = set()
    for _ in range(12):
        ball = random_ball(rng, as_vector(0.3 * rng.normal(size=3)))
        known, scale = equilibria.fixed_points(ball), equilibria.rate_scale(ball)
        gammas = np.array([point.gamma for point in known])
        numbers.add(len(known))
        assert (
            max(np.abs(equilibria.flow(ball, as_vector(g))).max() for g in gammas) < 1e-13 * scale
        )
        for gamma in f.zeros(f.from_rest(f.numbers(ball)), 60):
            assert np.linalg.norm(gammas - gamma, axis=1).min() < 1e-6
    assert numbers == {2, 6, 10}


# Proposition 2: near Γ₅ and Γ₆ ---------------------------------------------------------------


def test_gamma_5_is_a_saddle_or_a_weak_focus() -> None:
    """Prop. 2: a saddle if A₁A₂ < 0, imaginary eigenvalues if A₁A₂ > 0."""

    def wrong(sign: float) -> Errors:
        for n in balls():
            values, (A1, A2) = f.eigenvalues(f.from_rest(n), f.E[2]), A1_A2(n)
            saddle = values[0].real < 0 < values[1].real and abs(values.imag).max() == 0
            centre = abs(values.real).max() < 1e-12 * abs(values.imag).max()
            yield not (saddle if sign * A1 * A2 < 0 else centre)

    assert count(wrong(+1)) == 0  # of 200
    assert count(wrong(-1)) == 200  # control: the sign of A₁A₂


def criterion(n: Numbers, sign: float = 1.0) -> float:
    """Return B/A₁ with B = Ω₁Ω₂((a₂-a₃)²A₁² - (a₁-a₃)²A₂²), or with another sign in B."""
    (a1, a2, a3), (Omega1, Omega2, _) = n.moments, n.Omega
    A1, A2 = A1_A2(n)
    B = Omega1 * Omega2 * ((a2 - a3) ** 2 * A1**2 - sign * (a1 - a3) ** 2 * A2**2)
    return float(B / A1)


def growth_in_a_turn(n: Numbers, r: float) -> float:
    """Return the change of γ₁ = r during a turn of (4.1) about Γ₅."""
    field, (A1, A2) = f.from_rest(n), A1_A2(n)
    start = np.array([r, 0.0, sqrt(1 - r * r)])
    duration = 1.1 * 2 * np.pi * n.moments[2] / sqrt(A1 * A2)  # the period near Γ₅, and more
    side = np.sign(field(start)[1]) * f.E[1]
    passed = f.returns(field, start, side, duration, rtol=1e-13)
    return float(passed[0][0] - r) if len(passed) else 0.0


@cache
def foci() -> tuple[tuple[Numbers, float], ...]:
    """Return the 84 balls of 100 with a focus whose growth scipy resolves, and the growth."""
    some = [n for n in balls()[:100] if np.prod(A1_A2(n)) > 0.01]
    growths = [(n, growth_in_a_turn(n, 0.01)) for n in some]
    return tuple((n, growth) for n, growth in growths if abs(growth) > 1e-10)


def test_the_focus_is_stable_if_and_only_if_B_over_A1_is_negative() -> None:
    """Prop. 2, E6. The paper prints that it is stable if B/A₁ > 0. robotball's kind too."""

    def wrong(sign: float) -> Errors:
        for n, growth in foci():
            yield (sign * criterion(n) < 0) != (growth < 0)

    assert len(foci()) == 84
    assert count(wrong(+1)) == 0
    assert count(wrong(-1)) == 84  # printed, and the control
    for n, growth in foci():
        kind = f"slow {'stable' if growth < 0 else 'unstable'} focus"
        assert equilibria.fixed_point_at(f.ball(n), f.E[2]).kind == kind


def test_B_does_not_have_the_factor_K3() -> None:
    """Prop. 2, E7: B = Ω₁Ω₂((a₂-a₃)²A₁² - (a₁-a₃)²A₂²). The paper prints K₃Ω₁Ω₂(…)."""

    def wrong(value: Callable[[Numbers], float]) -> Errors:
        for n, growth in foci():
            yield (value(n) < 0) != (growth < 0)

    def by_robotball(n: Numbers) -> float:
        A1, _, B = figures.proposition_2(f.ball(n))
        return B / A1

    assert count(wrong(criterion)) == count(wrong(by_robotball)) == 0  # of 84
    assert count(wrong(lambda n: n.K[2] * criterion(n))) > 20  # printed: 40
    assert count(wrong(lambda n: criterion(n, sign=-1))) > 20  # control: the sign in B, 38


def test_the_focus_grows_with_the_first_lyapunov_value() -> None:
    """Not in the paper: dr/dt = l₁r³, l₁ = B/(8a₃A₁A₂(A₁ + A₂)); robotball's l₁ too."""

    def errors(sign: float) -> Errors:
        for n, _ in foci()[:6]:
            A1, A2, B = figures.proposition_2(f.ball(n))
            value = B / (8 * n.moments[2] * A1 * A2 * (A1 + sign * A2))
            # With an eigenvector of length 1 the amplitude of γ₁ is √(A₂/(A₁ + A₂)) r.
            period, share = 2 * np.pi * n.moments[2] / np.sqrt(A1 * A2), A2 / (A1 + A2)
            # The mean of both sides has no r⁴.
            growth = (growth_in_a_turn(n, 0.01) - growth_in_a_turn(n, -0.01)) / 2
            ours = lyapunov_value(flow_near(f.ball(n), f.E[2]), 2)
            for l1 in (value, ours if sign > 0 else value):
                yield growth * share / (period * 0.01**3 * l1) - 1

    assert worst(errors(+1)) <= 2e-2  # measured 2.2e-3: r⁵
    assert worst(errors(-1)) > 0.5  # control: the sign of A₂, 1.6


def taylor(n: Numbers, top: float) -> Array:
    """Return coefficients (2, 3, 3) of γ₁ⁱγ₂ʲ in dγ₁/dt, dγ₂/dt at γ₃ = top √(1 - γ₁² - γ₂²).

    Computed with Cauchy's integrals over circles of complex γ₁ and γ₂.
    """
    # Aliasing is of order radius^count; rounding of 1e-16/radius² at second order.
    number, radius = 16, 0.05
    circle = radius * np.exp(2j * np.pi * np.arange(number) / number)
    x, y = np.repeat(circle, number), np.tile(circle, number)
    values = f.from_rest(n)(np.array([x, y, top * sqrt(1 - x * x - y * y)]))[:2]
    powers = radius ** np.add.outer(np.arange(3), np.arange(3))
    return np.fft.fft2(values.reshape(2, number, number))[:, :3, :3].real / number**2 / powers


def expansion(n: Numbers, quadratic: float = 1.0, printed: bool = False) -> Array:
    """Return Prop. 2's expansion (2, 3, 3), its quadratic terms times a sign."""
    (a1, a2, a3), (Omega1, Omega2, _) = n.moments, n.Omega
    A1, A2 = A1_A2(n)
    terms = np.zeros((2, 3, 3))
    terms[0, 0, 1] = -A2 / a3
    terms[0, 1, 1], terms[0, 0, 2] = -(a2 - a3) * Omega1 / a3, -(a2 - a3) * Omega2 / a3
    mixed, square = (Omega1, Omega2) if printed else (Omega2, Omega1)
    terms[(1, 0, 1) if printed else (1, 1, 0)] = A1 / a3
    terms[1, 1, 1], terms[1, 2, 0] = (a1 - a3) * mixed / a3, (a1 - a3) * square / a3
    terms[:, [1, 0, 2], [1, 2, 0]] *= quadratic
    return terms


ORDER_2 = np.add.outer(np.arange(3), np.arange(3)) <= 2


def expansion_error(row: int | slice, top: float, quadratic: float, printed: bool = False) -> float:
    """Return the error of dγ₁/dt (row 0) or dγ₂/dt (row 1) at Γ₅ (top 1) or Γ₆ (-1)."""
    off = [taylor(n, top) - expansion(n, quadratic, printed) for n in balls()[:20]]
    return worst(terms[row][..., ORDER_2] for terms in off)


def test_the_expansion_of_the_first_component_at_gamma_5() -> None:
    """Prop. 2: dγ₁/dt = -A₂γ₂/a₃ - (a₂-a₃)(Ω₁γ₁γ₂ + Ω₂γ₂²)/a₃."""
    assert expansion_error(0, top=1, quadratic=+1) <= 2e-14  # 1/s; measured 1.6e-15: rounding
    assert expansion_error(0, top=1, quadratic=-1) > 1.0  # control: the quadratic signs, 12


def test_the_expansion_of_the_second_component_at_gamma_5() -> None:
    """Prop. 2, E8: dγ₂/dt = (A₁γ₁ + (a₁-a₃)(Ω₂γ₁γ₂ + Ω₁γ₁²))/a₃.

    The paper prints A₁γ₂ + (a₁-a₃)(Ω₁γ₁γ₂ + Ω₂γ₁²).
    """
    assert expansion_error(1, top=1, quadratic=+1) <= 2e-14  # 1/s; measured 3.6e-15: rounding
    assert expansion_error(1, top=1, quadratic=+1, printed=True) > 1.0  # printed: 6.2
    assert expansion_error(1, top=1, quadratic=-1) > 1.0  # control: the quadratic signs, 12


def test_the_quadratic_signs_at_gamma_6_are_opposite_to_those_at_gamma_5() -> None:
    """Prop. 2, E9. The paper prints the signs of Γ₅ for Γ₆."""
    both = slice(None)
    assert expansion_error(both, top=-1, quadratic=-1) <= 2e-14  # 1/s; measured 2.7e-15: rounding
    assert expansion_error(both, top=-1, quadratic=+1) > 1.0  # printed, and the control: 12


def test_the_scaled_expansion_at_gamma_5() -> None:
    """Prop. 2: x' and y' in γ₁ = √(A₁A₂)x/A₁, γ₂ = y, t = a₃τ/√(A₁A₂)."""

    def errors(sign: float) -> Errors:
        for n, _ in foci()[:20]:
            (a1, a2, a3), (Omega1, Omega2, _), (A1, A2) = n.moments, n.Omega, A1_A2(n)
            root, terms = sqrt(A1 * A2), np.zeros((2, 3, 3))
            terms[0, 0, 1], terms[1, 1, 0] = -1.0, 1.0
            terms[0, 1, 1], terms[0, 0, 2] = -(a2 - a3) * Omega1 / root, -(a2 - a3) * Omega2 / A2
            terms[1, 1, 1] = (a1 - a3) * Omega2 / A1
            terms[1, 2, 0] = sign * (a1 - a3) * Omega1 * A2 / (root * A1)
            scaled = taylor(n, 1.0) * (root / A1) ** np.arange(3)[:, None] * a3 / root
            scaled[0] *= A1 / root
            yield (scaled - terms)[:, ORDER_2]

    assert worst(errors(+1)) <= 2e-14  # measured 3.1e-15: rounding
    assert worst(errors(-1)) > 1.0  # control: the sign of x² in y', 13


# The fixed points Δ and Θ --------------------------------------------------------------------


def kappa(n: Numbers, j: int, sign: float = 1.0) -> float:
    """Return κ₁ (j = 1) or κ₂ (j = 0)."""
    a, a3, Omega3 = n.moments[j], n.moments[2], n.Omega[2]
    root = sqrt(n.Omega[j] ** 2 + Omega3**2)
    return float(((a - a3) * Omega3 + sign * 2 * a * a3 * n.K[2]) / (root * (a3 - a)))


def nu(n: Numbers, j: int) -> float:
    """Return ν₁ (j = 1) or ν₂ (j = 0): atan2(Ω₃, Ω₂) or atan2(Ω₃, Ω₁)."""
    return float(arctan2(n.Omega[2], n.Omega[j]))


def point(j: int, phi: float) -> Array:
    """Return γ with γⱼ = sin φ and γ₃ = cos φ."""
    gamma = np.zeros(3)
    gamma[j], gamma[2] = np.sin(phi), np.cos(phi)
    return gamma


def points(n: Numbers, j: int, sign: float = 1.0, shift: float | None = None) -> list[Array]:
    """Return δ₁ … δ₄ (j = 1) or θ₁ … θ₄ (j = 0), or no points if |κ| > 1."""
    k, shift = kappa(n, j, sign), nu(n, j) if shift is None else shift
    if abs(k) > 1 or abs(kappa(n, j)) > 1:
        return []
    one, other = (arcsin(k) - shift) / 2, -(arcsin(k) + shift) / 2
    return [point(j, phi) for phi in (one, one + pi, other + pi / 2, other + 3 * pi / 2)]


@pytest.mark.parametrize("j", [DELTA, THETA], ids=["Δ", "Θ"])
def test_the_angles_of_the_fixed_points_have_the_arctangent_of_omega(j: int) -> None:
    """Section 4.2, E10: ν = atan2(Ω₃, Ωⱼ). The paper prints arcsin(Ω₃²/√(Ωⱼ² + Ω₃²))."""

    def printed(n: Numbers) -> float:
        return float(arcsin(n.Omega[2] ** 2 / sqrt(n.Omega[j] ** 2 + n.Omega[2] ** 2)))

    def rates(sign: float = 1.0, shift: Callable[[Numbers], float] = lambda n: nu(n, j)) -> Errors:
        for n in balls():
            yield from (f.from_rest(n)(gamma) for gamma in points(n, j, sign, shift(n)))

    def rates_at_robotballs() -> Errors:
        for n in (n for n in balls() if abs(kappa(n, j)) < 1):
            ours = equilibria.closed_form_points(f.ball(n))
            yield from (f.from_rest(n)(ours["θδ"[j] + index]) for index in "₁₂₃₄")

    assert worst(rates()) <= 3e-14  # 1/s; measured 4.3e-15: rounding
    assert worst(rates_at_robotballs()) <= 3e-14
    assert worst(rates(shift=printed)) > 0.5  # printed: 3.3 and 3.2
    assert worst(rates(sign=-1)) > 0.5  # control: the sign of K₃, 3.5 and 3.2


def test_the_angle_of_theta_3_has_half_pi_added() -> None:
    """Section 4.2, E11: φ = -(arcsin κ₂ + ν₂)/2 + π/2. The paper prints -(…)/2 · π."""
    some = [n for n in balls() if abs(kappa(n, THETA)) < 1]

    def rates(angle: Callable[[float], float]) -> Errors:
        for n in some:
            half = -(arcsin(kappa(n, THETA)) + nu(n, THETA)) / 2
            yield f.from_rest(n)(point(THETA, angle(half)))

    assert worst(rates(lambda half: half + pi / 2)) <= 3e-14  # 1/s; measured 1.0e-15: rounding
    assert worst(rates(lambda half: half * pi)) > 0.5  # printed: 2.7
    assert worst(rates(lambda half: half + pi / 4)) > 0.5  # control: half of it, 2.8

"""The formulas of equations.py, run unchanged on sympy and mpmath numbers.

An identity is proved either with free symbols, or, where that takes sympy too long, with exact
rational numbers at random points: a rational function that is not identically zero would vanish
at such a point with a probability below its degree over 12000, the numbers drawn from: less than
1e-2 a point, and three points each.
"""

import random

import mpmath
import numpy as np
import pytest
import sympy
from sympy import Rational

from robotball import equations as eq
from robotball.equations import Parameters, Rolling, Scalar, Vector
from tests.identities import energy_rate

pytestmark = pytest.mark.core

MODELS: tuple[Rolling, ...] = ("rubber", "classical")
SEEDS = range(3)


def symbols(name: str) -> Vector:
    x, y, z = sympy.symbols(f"{name}1:4", real=True)
    return (x, y, z)


M, N, GAMMA, OMEGA_FRAME = symbols("M"), symbols("N"), symbols("gamma"), symbols("omega")
OMEGA, K, I, D = symbols("Omega"), symbols("K"), symbols("I"), sympy.Symbol("d")
W, X, Y, Z = sympy.symbols("w x y z", real=True)
UNIT_GAMMA = [eq.dot(GAMMA, GAMMA) - 1]  # what vanishes for a unit vector


def parameters(
    rolling: Rolling, I: Vector, d: Scalar, Omega: Vector, K: Vector, a: Scalar = 1
) -> Parameters:
    return Parameters(rolling=rolling, I=I, d=d, a=a, Omega=Omega, K=K)


def symbolic(rolling: Rolling) -> Parameters:
    return parameters(rolling, I, D, OMEGA, K)


class Point:
    """Exact rational numbers for everything that a formula may need, drawn from a seed."""

    def __init__(self, rolling: Rolling, seed: int) -> None:
        self.rng = random.Random(seed)
        u, v = self.number(), self.number()
        length = 1 + u * u + v * v
        self.gamma = (2 * u / length, 2 * v / length, (1 - u * u - v * v) / length)
        self.I = (abs(self.number()), abs(self.number()), abs(self.number()))
        self.d = abs(self.number())
        self.Omega, self.Omega_rate = self.vector(), self.vector()
        self.K, self.k_rate = self.vector(), self.vector()
        self.M = eq.cross(self.gamma, self.vector()) if rolling == "rubber" else self.vector()
        self.parameters = parameters(rolling, self.I, self.d, self.Omega, self.K)
        self.omega = self.parameters.angular_velocity(self.M, self.gamma)

    def number(self) -> Scalar:
        return Rational(self.rng.choice((-1, 1)) * self.rng.randint(1, 99), self.rng.randint(1, 99))

    def vector(self) -> Vector:
        return (self.number(), self.number(), self.number())

    def rates(self, rolling: Rolling) -> tuple[Vector, Scalar]:
        """dω/dt and λ₀ by the full equations, with both drives changing in time."""
        k = eq.add(self.K, eq.scale(self.d, self.Omega))
        return eq.full_angular_acceleration(
            self.omega,
            self.gamma,
            self.Omega,
            self.Omega_rate,
            k,
            self.k_rate,
            self.I,
            self.d,
            spin_free=rolling == "rubber",
        )


def remainder(expression: Scalar, vanishing: list[Scalar]) -> Scalar:
    """What is left of a rational expression's numerator modulo one polynomial in γ."""
    numerator, _ = sympy.fraction(sympy.together(expression))
    return sympy.expand(sympy.reduced(sympy.expand(numerator), vanishing, *GAMMA)[1])


def derivative(expression: Scalar, variables: Vector, rates: Vector) -> Scalar:
    return sum(sympy.diff(expression, v) * rate for v, rate in zip(variables, rates, strict=True))


# The reduced equations ---------------------------------------------------------------------


@pytest.mark.slow
def test_rubber_ball_never_spins_on_the_spot() -> None:
    """(3.2) satisfies the constraint (2.2), (ω - Ω, γ) = 0, for free symbols, any M and γ."""
    omega = symbolic("rubber").angular_velocity(M, GAMMA)
    assert sympy.simplify(eq.dot(eq.subtract(omega, OMEGA), GAMMA)) == 0


@pytest.mark.slow
@pytest.mark.parametrize("rolling", MODELS)
def test_angular_velocity_and_momentum_are_inverse_to_each_other(rolling: Rolling) -> None:
    """M(ω(M, γ)) = M for free symbols: (3.2) inverts (3.1), and (3.3) inverts M = L."""
    given = eq.cross(GAMMA, N) if rolling == "rubber" else M  # any M with (M, γ) = 0, or any M
    omega = symbolic(rolling).angular_velocity(given, GAMMA)
    back = symbolic(rolling).momentum(omega, GAMMA)
    assert [remainder(b - m, UNIT_GAMMA) for b, m in zip(back, given, strict=True)] == [0, 0, 0]


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("rolling", MODELS)
def test_momentum_is_constant_in_space_by_the_full_equations(rolling: Rolling, seed: int) -> None:
    """dM/dt = M×ω, exact rationals: dω/dt from (2.4)-(2.5), with Ω and k changing in time."""
    p = Point(rolling, seed)
    omega_rate, _ = p.rates(rolling)
    K_rate = eq.subtract(p.k_rate, eq.scale(p.d, p.Omega_rate))
    moving = parameters(rolling, p.I, p.d, OMEGA, K).momentum(OMEGA_FRAME, GAMMA)
    here = dict(
        zip((*OMEGA_FRAME, *GAMMA, *OMEGA, *K), (*p.omega, *p.gamma, *p.Omega, *p.K), strict=True)
    )
    for component, expected in zip(moving, eq.cross(p.M, p.omega), strict=True):
        rate = (
            derivative(component, OMEGA_FRAME, omega_rate)
            + derivative(component, GAMMA, eq.cross(p.gamma, p.omega))
            + derivative(component, OMEGA, p.Omega_rate)
            + derivative(component, K, K_rate)
        )
        assert rate.subs(here) == expected


@pytest.mark.parametrize("seed", SEEDS)
def test_spin_torque_keeps_the_rubber_constraint(seed: int) -> None:
    """d/dt (ω - Ω, γ) = 0 with the λ₀ of (2.5), exact rationals; λ₀ is not zero."""
    p = Point("rubber", seed)
    omega_rate, spin_torque = p.rates("rubber")
    assert spin_torque != 0
    shell_rate = eq.subtract(omega_rate, p.Omega_rate)
    shell = eq.subtract(p.omega, p.Omega)
    assert eq.dot(shell_rate, p.gamma) + eq.dot(shell, eq.cross(p.gamma, p.omega)) == 0


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("rolling", MODELS)
def test_energy_changes_at_the_rate_at_which_the_drives_work(rolling: Rolling, seed: int) -> None:
    """dE/dt = -(Ω, (A⁻¹ω + K)×ω), exact rationals: dω/dt from (2.4)-(2.5), constant drives."""
    p = Point(rolling, seed)
    p.Omega_rate = p.k_rate = (Rational(0), Rational(0), Rational(0))
    A = p.parameters.A
    E = eq.energy(OMEGA_FRAME, GAMMA, p.Omega, A, p.d, spinning=rolling == "classical")
    rate = derivative(E, OMEGA_FRAME, p.rates(rolling)[0])
    rate += derivative(E, GAMMA, eq.cross(p.gamma, p.omega))
    here = dict(zip((*OMEGA_FRAME, *GAMMA), (*p.omega, *p.gamma), strict=True))
    expected = energy_rate(p.omega, p.Omega, p.K, A)
    assert expected != 0
    assert rate.subs(here) == expected


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("rolling", MODELS)
def test_volume_of_states_shrinks_as_the_sum_of_the_exponents_says(
    rolling: Rolling, seed: int
) -> None:
    """div(dM/dt, dγ/dt) = ∓(Aγ, γ×Ω)/D + ½ d/dt ln D, D the denominator of (3.2) or (3.3).

    The last term has no mean over a bounded motion, so the sum of the exponents is the mean of
    the first; exact rationals.
    """
    p = Point(rolling, seed)
    omega = p.parameters.angular_velocity(M, GAMMA)
    flow = (*eq.cross(M, omega), *eq.cross(GAMMA, omega))
    divergence = sum(sympy.diff(f, v) for f, v in zip(flow, (*M, *GAMMA), strict=True))
    A_gamma_gamma = eq.dot(eq.diagonal(p.parameters.A, GAMMA), GAMMA)
    sign, denominator = (
        (-1, A_gamma_gamma)
        if rolling == "rubber"
        else (1, eq.dot(GAMMA, GAMMA) / p.d - A_gamma_gamma)
    )
    work = eq.dot(eq.diagonal(p.parameters.A, GAMMA), eq.cross(GAMMA, p.Omega))
    density_rate = derivative(sympy.log(denominator), GAMMA, eq.cross(GAMMA, omega)) / 2
    here = dict(zip((*M, *GAMMA), (*p.M, *p.gamma), strict=True))
    assert divergence.subs(here) == (sign * work / denominator + density_rate).subs(here)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("rolling", MODELS)
def test_motion_is_reversible_where_the_drives_have_no_part_along_an_axis(
    rolling: Rolling, seed: int
) -> None:
    """ω(∓DM, Dγ) = Dω(M, γ) with D the reflection of an axis on which K_i = Ω_i = 0; exact.

    That is what (γ, M, t) → (Dγ, ∓DM, -t) needs to carry motions to motions.
    """
    p = Point(rolling, seed)
    flat = (1, 1, 0)
    reflection = (1, 1, -1)
    ball = parameters(rolling, p.I, p.d, eq.diagonal(flat, p.Omega), eq.diagonal(flat, p.K))
    sign = -1 if rolling == "rubber" else 1
    mirrored = ball.angular_velocity(
        eq.scale(sign, eq.diagonal(reflection, p.M)), eq.diagonal(reflection, p.gamma)
    )
    assert mirrored == eq.diagonal(reflection, ball.angular_velocity(p.M, p.gamma))


# Kinematics --------------------------------------------------------------------------------


@pytest.mark.slow
def test_space_axes_are_carried_by_the_angular_velocity() -> None:
    """dα/dt = α×ω, and so β and γ, when dq/dt = q∘(0, ω)/2; free symbols, any length of q."""
    q = (W, X, Y, Z)
    rates = eq.attitude_rate(q, OMEGA_FRAME)
    for axis in eq.space_axes(q):
        carried = eq.cross(axis, OMEGA_FRAME)
        for component, expected in zip(axis, carried, strict=True):
            rate = sum(sympy.diff(component, c) * r for c, r in zip(q, rates, strict=True))
            assert sympy.simplify(rate - expected) == 0


def test_space_axes_are_a_right_handed_orthonormal_triad() -> None:
    """(α, α) = (β, β) = 1, (α, β) = 0 and α×β = γ; free symbols, any length of q."""
    alpha, beta, gamma = eq.space_axes((W, X, Y, Z))
    residuals = (
        eq.dot(alpha, alpha) - 1,
        eq.dot(beta, beta) - 1,
        eq.dot(alpha, beta),
        *eq.subtract(eq.cross(alpha, beta), gamma),
    )
    assert all(sympy.simplify(r) == 0 for r in residuals)


def test_contact_point_does_not_slip() -> None:
    """(dX/dt, dY/dt) are the horizontal parts of v = -aγ×(ω - Ω), (2.1), for γ = α×β."""
    a = sympy.Symbol("a")
    alpha, beta, gamma = eq.space_axes((W, X, Y, Z))
    v = eq.scale(-a, eq.cross(gamma, eq.subtract(OMEGA_FRAME, OMEGA)))
    velocity = eq.contact_velocity(alpha, beta, OMEGA_FRAME, OMEGA, a)
    for axis, component in zip((alpha, beta), velocity, strict=True):
        assert sympy.simplify(eq.dot(axis, v) - component) == 0


# Momentum ----------------------------------------------------------------------------------


def test_rubber_momentum_is_the_horizontal_part_of_the_angular_momentum_turned() -> None:
    """M×γ of (3.1) is L less its vertical part: M is L's horizontal part turned by +90°."""
    L = eq.contact_angular_momentum(OMEGA_FRAME, GAMMA, OMEGA, K, I, D)
    horizontal = eq.subtract(L, eq.scale(eq.dot(L, GAMMA), GAMMA))
    turned_back = eq.cross(symbolic("rubber").momentum(OMEGA_FRAME, GAMMA), GAMMA)
    difference = eq.subtract(turned_back, horizontal)
    assert [remainder(component, UNIT_GAMMA) for component in difference] == [0, 0, 0]


def test_angular_momentum_about_the_contact_is_that_of_the_bodies() -> None:
    """L = Iω + k + m r×v, with r = aγ from the contact to the centre and v of (2.1)."""
    a, m = sympy.symbols("a m")
    v = eq.scale(-a, eq.cross(GAMMA, eq.subtract(OMEGA_FRAME, OMEGA)))
    d = m * a * a
    k = eq.add(K, eq.scale(d, OMEGA))
    moved = eq.scale(m, eq.cross(eq.scale(a, GAMMA), v))
    expected = eq.add(eq.add(eq.diagonal(I, OMEGA_FRAME), k), moved)
    L = eq.contact_angular_momentum(OMEGA_FRAME, GAMMA, OMEGA, K, I, d)
    residual = eq.subtract(L, expected)
    assert [remainder(component, UNIT_GAMMA) for component in residual] == [0, 0, 0]


# Numbers -----------------------------------------------------------------------------------


@pytest.mark.parametrize("thinness", [1e-3, 1e-6, 1e-9, 1e-15, 1e-40])
def test_a_ball_of_little_inertia_loses_no_digits(thinness: float) -> None:
    """(3.3) keeps 1e-15 for I << d, where 1/d - (Aγ,γ) as printed loses log10(d/I) digits."""
    I, d = (0.7 * thinness, 1.1 * thinness, 0.9 * thinness), 0.9
    Omega, K, M = (0.1, -0.2, 2.0), (2.0, 3.0, 0.4), (1.3, -0.8, 3.1)
    gamma = (0.36, 0.48, 0.8)
    computed = parameters("classical", I, d, Omega, K).angular_velocity(M, gamma)

    def printed(number: type) -> list[Scalar]:
        """(3.3) as the paper has it, in the arithmetic of `number`."""
        n = [number(c) for c in gamma]
        # 0.36, 0.48 and 0.8 are not quite a unit vector in binary; that is not our subject.
        unit = [c / sum(c * c for c in n) ** number(0.5) for c in n]
        A = [1 / (number(i) + number(d)) for i in I]
        M_K = [number(m) - number(k) for m, k in zip(M, K, strict=True)]
        A_M_K = [a * mk for a, mk in zip(A, M_K, strict=True)]
        above = sum((x - number(o)) * g for x, o, g in zip(A_M_K, Omega, unit, strict=True))
        below = 1 / number(d) - sum(a * g * g for a, g in zip(A, unit, strict=True))
        return [a * (mk + above / below * g) for a, mk, g in zip(A, M_K, unit, strict=True)]

    def worst(omega: list[Scalar]) -> float:
        return max(abs(float((o - e) / e)) for o, e in zip(omega, exact, strict=True))

    with mpmath.workdps(120):
        exact = printed(mpmath.mpf)
        # Rounding: measured 6.1e-16 at worst.
        assert worst(list(computed)) < 2e-15
        # Measured 6.3e-14, 8.6e-11, 3.3e-8: it must lose, or this test shows nothing. Of a ball
        # that is thinner nothing is left.
        assert thinness < 1e-9 or worst(printed(float)) > 1e-17 / thinness


@pytest.mark.parametrize("rolling", MODELS)
def test_columns_give_what_single_numbers_give(rolling: Rolling) -> None:
    """The formulas on NumPy columns equal those on floats, to the last bit."""
    rng = np.random.default_rng(1)
    M, gamma = rng.normal(size=(2, 20, 3))
    gamma /= np.linalg.norm(gamma, axis=1, keepdims=True)
    ball = parameters(rolling, (0.5, 0.7, 0.4), 0.9, (0.1, 0.2, 2.0), (2.0, 3.0, -0.4))
    columns = ball.angular_velocity(tuple(M.T), tuple(gamma.T))
    singles = [
        ball.angular_velocity(tuple(m), tuple(g))
        for m, g in zip(M.tolist(), gamma.tolist(), strict=True)
    ]
    np.testing.assert_array_equal(np.stack(columns, axis=1), singles)
    L = ball.momentum(columns, tuple(gamma.T))
    L_singles = [ball.momentum(o, tuple(g)) for o, g in zip(singles, gamma.tolist(), strict=True)]
    np.testing.assert_array_equal(np.stack(L, axis=1), L_singles)

"""Section 5.1: motions along straight lines, their stability, and Figs 9 and 10."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest
from numpy import cos, sin, sqrt
from scipy.optimize import brentq

from robotball.dynamics import straight_motions as lines
from robotball.rotations import Array
from tests.paper import formulas as f
from tests.paper.captions import line_ball
from tests.paper.engine_ball import BallMotion, mujoco_ball, mujoco_ball_from
from tests.paper.formulas import Errors, Numbers, count, cross, paper_scene, unit, worst

SIGNS = {"σ₊": (1, 1), "σ₋": (-1, 1), "δ₊": (1, -1), "δ₋": (-1, -1)}
LIMIT = 16 / 7.69  # of f in Fig. 10, (kg m²/s)²


# The family of straight lines ----------------------------------------------------------------


def roll(gamma: Array, M: Array, duration: float = 5.0) -> BallMotion:
    """Roll the ball of Fig. 10 in MuJoCo from γ and M, with OX along -M."""
    M_world = np.array([-np.linalg.norm(M), 0.0, 0.0])
    return mujoco_ball_from("fig10", gamma, -unit(M), M_world, duration)


def test_the_ball_rolls_straight_if_its_momentum_is_gamma_times_K() -> None:
    """(5.1): M = γ₀×K with (Ω,γ₀) = 0 gives ω = 0; MuJoCo."""
    n = f.numbers(paper_scene("fig10").parameters)

    def errors(sign: float) -> Errors:
        for angle in (0.3, 2.0, 4.0):
            gamma = np.array([cos(angle), sin(angle), 0.0])
            ball = roll(gamma, sign * cross(gamma, n.K))
            alpha, beta, _ = ball.axes[0]
            velocity = n.a * np.array([-beta @ n.Omega, alpha @ n.Omega])
            yield from (
                ball.omega,
                ball.motion.contact_point - ball.motion.times[:, None] * velocity,
            )

    assert worst(errors(+1)) <= 5e-11  # rad/s and m; measured 5.8e-12: MuJoCo's contact
    assert worst(errors(-1)) > 1.0  # control: the sign of M, 23


def random_lines(seed: int, number: int, direction: str = "any") -> list[tuple[Numbers, Array]]:
    """Return balls and γ₀ with (Ω,γ₀) = 0; K any, along Ω ("along") or across it ("across")."""
    random, made = np.random.default_rng(seed), []
    for _ in range(number):
        Omega, K, v = random.normal(size=(3, 3))
        K = 3 * {"any": K, "along": K[0] * Omega, "across": f.level(K, unit(Omega))}[direction]
        gamma = unit(f.level(v, unit(Omega)))
        made.append((f.with_A(tuple(random.uniform(0.2, 1.0, 3)), Omega, K), gamma))
    return made


def linear(n: Numbers, gamma: Array) -> Array:
    """Return ∂/∂(M, γ) (6, 6) of (3.2) at M = γ×K, γ."""
    state = np.concatenate([cross(gamma, n.K), gamma])
    return f.jacobian(f.reduced(f.rubber_velocity, n), state)


def P3(n: Numbers, gamma: Array, sign: float = 1.0) -> Array:
    """Return the coefficients (4,) of (5.2), highest power first."""
    N, D = n.A @ gamma @ gamma, np.linalg.det(n.A)
    turned, K_gamma = cross(gamma, n.Omega), n.K @ gamma
    middle = K_gamma**2 - n.K @ np.linalg.inv(n.A) @ n.Omega
    free = K_gamma * (n.K @ turned)
    return np.array([1.0, n.A @ gamma @ turned / N, D * middle / N, sign * D * free / N])


def P2(n: Numbers, gamma: Array, sign: float = 1.0) -> Array:
    """Return the coefficients (3,) of P₂, for K along Ω."""
    N, D = n.A @ gamma @ gamma, np.linalg.det(n.A)
    last = n.K @ np.linalg.inv(n.A) @ n.Omega
    return np.array([1.0, n.A @ gamma @ cross(gamma, n.Omega) / N, -sign * D * last / N])


@pytest.mark.parametrize(
    ("direction", "seed", "power", "polynomial"),
    [("any", 61, 3, P3), ("along", 62, 4, P2)],
    ids=["λ³P₃", "λ⁴P₂"],
)
def test_the_characteristic_polynomial_of_a_straight_line(
    direction: str, seed: int, power: int, polynomial: Callable[..., Array]
) -> None:
    """(5.2): λ³P₃(λ), and λ⁴P₂(λ) if K is along Ω; robotball's polynomial too."""
    balls = random_lines(seed, 200, direction)

    def errors(sign: float) -> Errors:
        for n, gamma in balls:
            J, expected = linear(n, gamma), polynomial(n, gamma, sign)
            # Six values determine a monic polynomial of degree 6. Its multiple zeros are only
            # known to a root of the rounding.
            for x in (0.5, -1.0, 2.0, 1j, 2j, 1 + 1j):
                scale = np.abs(x) ** power * np.polyval(np.abs(expected), np.abs(x))
                determinant = np.linalg.det(x * np.eye(6) - J)
                yield abs(determinant - x**power * np.polyval(expected, x)) / scale

    assert worst(errors(+1)) <= 1e-12  # measured 1.2e-13 and 7.4e-14: rounding
    assert worst(errors(-1)) > 1.0  # control: the free term, 76 and 80
    for n, gamma in balls:
        ours = lines.straight_motion(f.ball(n), gamma).polynomial
        assert worst(ours - np.append(polynomial(n, gamma), np.zeros(power - 3))) <= 1e-12


def test_if_K_is_along_omega_all_straight_lines_have_one_momentum() -> None:
    """Section 5.1: f = (γ₀×K)² = K² on all of Σ¹."""

    def errors(direction: str) -> Errors:
        for n, gamma in random_lines(63, 100, direction):
            yield cross(gamma, n.K) @ cross(gamma, n.K) / (n.K @ n.K) - 1

    assert worst(errors("along")) <= 4e-15  # measured 5.6e-16: rounding
    assert worst(errors("any")) > 0.5  # control: any K, 0.98


def test_the_straight_lines_cross_the_levels_of_f_where_the_free_term_is_not_zero() -> None:
    """Section 5.1: df/ds = -2(K,γ₀)(K, γ₀×Ω)/|Ω| along Σ¹, relative to K²; P₃(0) has the factor."""

    def errors(sign: float) -> Errors:
        for n, gamma in random_lines(64, 100):
            along = unit(cross(gamma, n.Omega))
            ends = [cross(cos(s) * gamma + sin(s) * along, n.K) for s in (1e-5, -1e-5)]
            slope = (ends[0] @ ends[0] - ends[1] @ ends[1]) / 2e-5
            formula = -2 * (n.K @ gamma) * (n.K @ cross(gamma, n.Omega)) / np.linalg.norm(n.Omega)
            yield (slope - sign * formula) / (n.K @ n.K)

    assert worst(errors(+1)) <= 1e-9  # measured 7.0e-11: differences
    assert worst(errors(-1)) > 0.5  # control: the sign, 2.0


# K across Ω: Propositions 3 and 4 ------------------------------------------------------------


@dataclass(frozen=True)
class Line:
    """A straight line of a ball with K ⊥ Ω: γ₀ = c₁K + c₂K×Ω (5.3)."""

    n: Numbers
    c1: float
    c2: float

    @property
    def gamma(self) -> Array:
        return self.c1 * self.n.K + self.c2 * cross(self.n.K, self.n.Omega)

    @property
    def M(self) -> Array:
        return cross(self.gamma, self.n.K)

    @property
    def rates(self) -> Array:
        """The eigenvalues (3,) of (3.2) within the level of F₀, F₁, F₂."""
        inside = np.linalg.svd(f.integral_gradients(self.M, self.gamma))[2][3:]
        return np.linalg.eigvals(inside @ linear(self.n, self.gamma) @ inside.T).astype(complex)

    @property
    def stable(self) -> bool:
        return bool(self.rates.real.max() < 0)


def line(n: Numbers, level: float, name: str) -> Line:
    """Return σ₊, σ₋, δ₊ or δ₋ of Prop. 3 at f = level."""
    square, Omega2, (s1, s2) = float(n.K @ n.K), float(n.Omega @ n.Omega), SIGNS[name]
    c1, c2 = sqrt(square - level) / square, sqrt(level) / (square * sqrt(Omega2))
    return Line(n, float(s1 * c1), float(s2 * c2))


@cache
def balls(number: int = 500) -> tuple[tuple[Numbers, float], ...]:
    """Return random balls with K ⊥ Ω, and an f < K² each."""
    random, some = np.random.default_rng(65), random_lines(66, number, "across")
    return tuple((n, random.uniform(0.0, 1.0) * float(n.K @ n.K)) for n, _ in some)


def test_gamma_and_the_momentum_are_squares_of_two_coefficients() -> None:
    """(5.3): γ² = K²(c₁² + c₂²Ω²), M² = c₂²K⁴Ω² and (Ω,γ) = 0 for any c₁ and c₂."""

    def errors(sign: float) -> Errors:
        random = np.random.default_rng(67)
        for n, _ in balls():
            motion = Line(n, *random.normal(size=2).tolist())
            K2, Omega2 = n.K @ n.K, n.Omega @ n.Omega
            square = motion.gamma @ motion.gamma - K2 * (
                motion.c1**2 + sign * motion.c2**2 * Omega2
            )
            level = motion.M @ motion.M - motion.c2**2 * K2**2 * Omega2
            yield (
                np.array([square, level, n.Omega @ motion.gamma])
                / max(float(K2 * Omega2), 1.0) ** 2
            )

    assert worst(errors(+1)) <= 3e-13  # measured 2.0e-14: rounding
    assert worst(errors(-1)) > 1.0  # control: the sign of c₂²Ω², 8.3


def test_the_coefficients_of_proposition_3_are_those_of_straight_lines() -> None:
    """Prop. 3: γ² = 1, M² = f (relative to K²) and ω = 0 of (3.2)."""

    def errors(factor: float) -> Errors:
        for n, level in balls():
            for name in SIGNS:
                motion = line(n, level, name)
                motion = replace(motion, c2=factor * motion.c2)
                omega = f.rubber_velocity(n, motion.M, motion.gamma)
                yield [
                    motion.gamma @ motion.gamma - 1,
                    (motion.M @ motion.M - level) / (n.K @ n.K),
                    *omega,
                ]

    assert worst(errors(1.0)) <= 5e-14  # measured 5.3e-15: rounding
    assert worst(errors(1.1)) > 0.1  # control: c₂ by a tenth, 0.21


def meetings(n: Numbers, level: float) -> tuple[int, int, int, int]:
    """Count where Σ¹ meets f = level, f > K², touches f = K², and meets f = 0, all around."""
    angles = np.linspace(0.0, 2 * np.pi, 2000, endpoint=False) + 0.001  # no point on a crossing
    M, K2 = np.cross(f.sigma(n, angles), n.K), float(n.K @ n.K)
    levels = (M**2).sum(axis=1)
    over = [levels > x for x in (level, 1.001 * K2)]
    meets, above = (int(np.count_nonzero(sides != np.roll(sides, 1))) for sides in over)
    tops = (levels > np.roll(levels, 1)) & (levels >= np.roll(levels, -1))
    touches = int(np.count_nonzero(tops & (levels > K2 * (1 - 1e-5))))
    # M passes zero where (γ×K, Ω) changes its sign.
    ahead = M @ n.Omega > 0
    zeros = int(np.count_nonzero((ahead != np.roll(ahead, 1)) & (levels < 1e-4 * K2)))
    return meets, above, touches, zeros


def test_there_are_four_straight_lines_below_the_largest_momentum_and_two_at_it() -> None:
    """Prop. 3: four for 0 < f < K², two for f = K² and for f = 0; robotball's lines too."""
    for n, level in balls(50):
        assert meetings(n, level) == (4, 0, 2, 2)
        along = replace(n, K=n.K + 2.0 * np.linalg.norm(n.K) * unit(n.Omega))
        assert meetings(along, level) != (4, 0, 2, 2)  # control: K not across Ω
        for ours in lines.straight_motions(f.ball(n), level):
            paper = line(n, level, lines.name_of_line(f.ball(n), ours.gamma))
            assert np.linalg.norm(ours.gamma - paper.gamma) < 1e-12
            assert ours.is_stable == paper.stable


def test_the_free_term_is_positive_if_and_only_if_the_coefficients_differ_in_sign() -> None:
    """Section 5.1: P₃(0) > 0 if and only if c₁c₂ < 0."""

    def wrong(sign: float) -> Errors:
        for n, level in balls():
            for motion in (line(n, level, name) for name in SIGNS):
                yield (P3(n, motion.gamma)[3] > 0) != (sign * motion.c1 * motion.c2 < 0)

    assert count(wrong(+1)) == 0  # of 2000
    assert count(wrong(-1)) == 2000  # control: the sign of c₁c₂


def test_sigma_plus_and_delta_minus_are_unstable() -> None:
    """Prop. 4, by eigenvalues."""

    def stable(names: Sequence[str]) -> int:
        return sum(line(n, level, name).stable for n, level in balls() for name in names)

    assert stable(("σ₊", "δ₋")) == 0  # of 1000
    assert stable(("σ₋", "δ₊")) > 10  # control: the others, 34


@cache
def candidates() -> tuple[tuple[Line, bool], ...]:
    """Return σ₋ and δ₊ of 1000 balls, and whether their eigenvalues say that they are stable."""
    some = [line(n, level, name) for n, level in balls(1000) for name in ("σ₋", "δ₊")]
    return tuple((motion, motion.stable) for motion in some)


def wrong_conditions(bracket: float = 1.0, power: int = 2) -> int:
    """Count where (5.4) misjudges σ₋ or δ₊; with ±(c₁K×Ω - c₂Ω²K), and c₁²K⁴ or c₁K⁴."""
    wrong = 0
    for motion, stable in candidates():
        n, c1, c2 = motion.n, motion.c1, motion.c2
        K2, Omega2 = n.K @ n.K, n.Omega @ n.Omega
        A_gamma = c1 * n.A @ n.K + c2 * n.A @ cross(n.K, n.Omega)
        first = A_gamma @ (bracket * (c1 * cross(n.K, n.Omega) - c2 * Omega2 * n.K))
        third = c1**power * K2**2 - n.K @ np.linalg.inv(n.A) @ n.Omega
        second = first * third + c1 * c2 * K2 * (A_gamma @ motion.gamma) * K2 * Omega2
        wrong += bool(first > 0 and second > 0) != stable
    return wrong


def test_the_second_bracket_of_the_stability_conditions() -> None:
    """(5.4), E13: c₁K×Ω - c₂Ω²K. The paper prints c₁Ω×K + c₂Ω², which is not a vector."""
    assert wrong_conditions() == 0  # of 2000
    assert wrong_conditions(bracket=-1) > 50  # printed, with the missing K, and the control: 98


def test_the_third_bracket_of_the_stability_conditions() -> None:
    """(5.4), E14: c₁²K⁴ - (K, A⁻¹Ω). The paper prints c₁K⁴ - (K, A⁻¹Ω)."""
    assert wrong_conditions() == 0  # of 2000
    assert wrong_conditions(power=1) > 50  # printed, and the control: 161


# Figs 9 and 10 -------------------------------------------------------------------------------


def test_the_region_of_stability_of_fig_9() -> None:
    """Fig. 9: K₁K₂ > 0 and (a₁/K₁)² + (a₂/K₂)² < (a₁ - a₂)²/f, at any f."""
    n = line_ball()
    a1, a2, _ = n.moments

    def wrong(sign: float) -> Errors:
        random = np.random.default_rng(68)
        for level in (0.5, 3.0, 20.0):
            sizes, angles = random.uniform([1.01, 0.0], [8.0, 2 * np.pi], (100, 2)).T
            for K1, K2 in zip(*(sqrt(level) * sizes * [cos(angles), sin(angles)]), strict=True):
                inside = (a1 / K1) ** 2 + (a2 / K2) ** 2 < (a1 - a2) ** 2 / level
                inside = inside and sign * K1 * K2 > 0
                other = replace(n, K=np.array([K1, K2, 0.0]))
                yield any(line(other, level, name).stable != inside for name in ("σ₋", "δ₊"))

    assert count(wrong(+1)) == 0  # of 300
    assert count(wrong(-1)) > 40  # control: the sign of K₁K₂, 85


@pytest.mark.parametrize("Omega3", [0.5, 1.0, 2.0, 4.0])
def test_the_lines_of_fig_10_are_stable_below_its_level_only(Omega3: float) -> None:
    """Fig. 10, E16: for f < 16/7.69. The paper prints f = 3 as stable. The same for any Ω₃."""

    def limit(factor: float) -> float:
        n = line_ball(Omega3)
        n = replace(n, K=n.K * [factor, 1.0, 1.0])

        def growth(level: float) -> float:
            return max(float(line(n, level, name).rates.real.max()) for name in ("σ₋", "δ₊"))

        return float(brentq(growth, 1.0, 3.0, xtol=1e-12))

    assert abs(limit(1.0) - LIMIT) <= 1e-9  # (kg m²/s)²; measured 3e-15; printed: 3
    assert abs(limit(1.1) - LIMIT) > 0.1  # control: K₁ by a tenth, 0.34
    assert abs((lines.stability_limit(f.ball(line_ball(Omega3))) or 0.0) - LIMIT) < 1e-12


def test_at_the_level_of_fig_10_all_four_lines_are_saddle_foci() -> None:
    """Not in the paper: at f = 3 a real rate and a pair of the opposite sign."""

    def saddle_foci(level: float) -> Errors:
        for name in SIGNS:
            rates = line(line_ball(), level, name).rates
            pair = rates[np.abs(rates.imag) > 1e-9].real
            yield len(pair) == 2 and rates.real[np.abs(rates.imag) < 1e-9][0] * pair[0] < 0

    assert count(saddle_foci(3.0)) == 4
    assert count(saddle_foci(2.0)) == 2  # control: f = 2


@pytest.mark.parametrize(
    ("name", "level", "duration"), [("fig10", 3.0, 80.0), ("fig10_stable", 2.0, 200.0)]
)
def test_the_ball_of_fig_10_turns_round(name: str, level: float, duration: float) -> None:
    """Fig. 10: from σ₊ to δ₊, which changes the velocity along OY from -a|Ω| to +a|Ω|; MuJoCo."""
    n, ball = line_ball(), mujoco_ball(name, duration, 0.05)
    velocity = np.diff(ball.motion.contact_point[-2:, 1]) / 0.05

    def errors(to: str, sign: float) -> Errors:
        yield ball.gamma[-1] - line(n, level, to).gamma
        yield velocity - sign * n.a * np.linalg.norm(n.Omega)

    assert worst(errors("δ₊", +1)) <= 1e-4  # measured 5.1e-6 and 3.6e-5: the time it has
    assert worst(errors("σ₋", -1)) > 1.0  # control: σ₋ and the way back, 2.0


def test_on_sigma_the_ball_rolls_against_OY_and_on_delta_along_it() -> None:
    """Section 5.1, E15: X = x₀, Y = ∓a|Ω|t + y₀, - for σ. The paper prints + for σ. MuJoCo, 1 s."""
    n = line_ball()
    speed = n.a * np.linalg.norm(n.Omega)
    motions = {name: line(n, 2.0, name) for name in SIGNS}
    ends = {
        name: roll(at.gamma, at.M, 1.0).motion.contact_point[-1] for name, at in motions.items()
    }

    def errors(sigma: float) -> Errors:
        for name, end in ends.items():
            yield end - [0.0, sigma * speed * SIGNS[name][1]]

    assert worst(errors(sigma=-1)) <= 3e-13  # m; measured 3.8e-14: rounding
    assert worst(errors(sigma=+1)) > 1.0  # printed, and the control: 2.0
    for name, at in motions.items():
        ours = lines.straight_motion(f.ball(n), at.gamma).speed
        assert abs(np.linalg.norm(ends[name]) - ours) <= 3e-13

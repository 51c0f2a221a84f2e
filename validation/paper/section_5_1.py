"""Section 5.1, straight-line motions: the family Σ¹ and its polynomial; K ⊥ Ω and Figs 9 and 10."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy import sqrt
from scipy.optimize import brentq

from robotball.rotations import Array, from_matrix
from robotball.scene import Start
from validation.paper import formulas as f
from validation.paper.captions import captioned_motion, line_ball
from validation.paper.claim import Claim, Errors, Residual, Section, Value, largest_error
from validation.paper.engine_ball import MOTION, Seen, largest, long, seen_of
from validation.paper.formulas import Numbers, cross, paper_scene, unit

SECTION = Section("5.1. Straight-line motions")
claim = SECTION.claim

_BALL = "fig10"
_Polynomial = Callable[[Numbers, Array], Array]
_SIGNS = {"σ₊": (1, 1), "σ₋": (-1, 1), "δ₊": (1, -1), "δ₋": (-1, -1)}


# The family ----------------------------------------------------------------------------------


def _started(gamma: Array, M: Array, duration: float = 5.0) -> Seen:
    """Roll the ball of Fig. 10 by MuJoCo from γ and M, with OX against M."""
    scene = paper_scene(_BALL)
    alpha = -unit(M)
    attitude = from_matrix(np.array([alpha, cross(gamma, alpha), gamma]))
    start = Start(attitude, np.array([-np.linalg.norm(M), 0.0, 0.0]))
    return seen_of(replace(scene, start=start), duration)


@claim("(5.1)", "M = γ₀×K, (Ω,γ₀) = 0: ω = 0, a straight line", MOTION, "the sign of M")
@largest_error(5e-11, "rad/s, m")
def equilibria(twist: float) -> Errors:
    """Compute |ω| of MuJoCo's ball from M = γ₀×K, (Ω,γ₀) = 0, and its distance from a line."""
    n = f.numbers(paper_scene(_BALL).parameters)
    for angle in (0.3, 2.0, 4.0):
        gamma = np.array([np.cos(angle), np.sin(angle), 0.0])
        ball = _started(gamma, twist * cross(gamma, n.K))
        alpha, beta, _ = ball.axes[0]
        line = ball.motion.times[:, None] * n.a * np.array([-beta @ n.Omega, alpha @ n.Omega])
        yield largest(ball.omega)
        yield largest(ball.motion.contact_point - line)


SECTION.add(Claim("Remark 8", "segways are stabilised like this", "of other machines"))


def _random_lines(seed: int, count: int, kind: str = "any") -> list[tuple[Numbers, Array]]:
    """Return balls and γ₀ with (Ω,γ₀) = 0; K any, along Ω ("along"), or across it ("across")."""
    random = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        Omega, K, v = random.normal(size=(3, 3))
        choices = {"any": K, "along": K[0] * Omega, "across": f.level(K, unit(Omega))}
        K = 3 * choices[kind]
        gamma = unit(f.level(v, unit(Omega)))
        found.append((f.with_A(tuple(random.uniform(0.2, 1.0, 3)), Omega, K), gamma))
    return found


def linear(n: Numbers, gamma: Array) -> Array:
    """Return ∂/∂(M, γ) (6, 6) of (3.2) at M = γ×K, γ."""
    state = np.concatenate([cross(gamma, n.K), gamma])
    return f.jacobian(f.reduced(f.rubber_velocity, n), state)


def _P3(n: Numbers, gamma: Array, twist: float = 1.0) -> Array:
    """Return the coefficients (4,) of (5.2), highest power first."""
    N, D = n.A @ gamma @ gamma, np.linalg.det(n.A)
    turned, K_gamma = cross(gamma, n.Omega), n.K @ gamma
    middle = K_gamma**2 - n.K @ np.linalg.inv(n.A) @ n.Omega
    free = K_gamma * (n.K @ turned)
    return np.array([1.0, n.A @ gamma @ turned / N, D * middle / N, twist * D * free / N])


def _P2(n: Numbers, gamma: Array, twist: float = 1.0) -> Array:
    """Return the coefficients (3,) of P₂, for K along Ω."""
    N, D = n.A @ gamma @ gamma, np.linalg.det(n.A)
    last = n.K @ np.linalg.inv(n.A) @ n.Omega
    return np.array([1.0, n.A @ gamma @ cross(gamma, n.Omega) / N, -twist * D * last / N])


def _worst_polynomial(kind: str, seed: int, power: int, coefficients: _Polynomial) -> float:
    """Compare det(λ - ∂(3.2)) of 200 balls, at six λ, with a power of λ times a polynomial."""
    worst = 0.0
    for n, gamma in _random_lines(seed, 200, kind):
        J, expected = linear(n, gamma), coefficients(n, gamma)
        # Both are monic of degree 6, so that six values determine them.
        for x in (0.5, -1.0, 2.0, 1j, 2j, 1 + 1j):
            determinant = np.linalg.det(x * np.eye(6) - J)
            formula = x**power * np.polyval(expected, x)
            scale = np.abs(x) ** power * np.polyval(np.abs(expected), np.abs(x))
            worst = max(worst, float(abs(determinant - formula) / scale))
    return worst


@claim("(5.2)", "λ³P₃(λ), any K", "determinants of (3.2)", "the free term")
def _characteristic(twist: float) -> Residual:
    """Compare the characteristic polynomial, with any K, with λ³P₃(λ) of (5.2)."""
    return Residual(_worst_polynomial("any", 61, 3, lambda n, g: _P3(n, g, twist)), bound=1e-12)


@claim("5.1", "K along Ω: λ⁴P₂(λ)", "determinants of (3.2)", "the free term")
def _characteristic_along(twist: float) -> Residual:
    """Compare the characteristic polynomial, with K along Ω, with λ⁴P₂(λ)."""
    return Residual(_worst_polynomial("along", 62, 4, lambda n, g: _P2(n, g, twist)), bound=1e-12)


@claim("5.1", "K along Ω: all of Σ¹ has f = K²", "(5.1)", "any K")
def _one_level(twist: float) -> Residual:
    """Compare M² = (γ₀×K)² with K², for K along Ω; twisted, for any K."""
    lines = _random_lines(63, 100, "along" if twist == 1 else "any")
    off = [cross(g, n.K) @ cross(g, n.K) / (n.K @ n.K) - 1 for n, g in lines]
    return Residual(float(np.abs(off).max()), bound=4e-15)


@claim("5.1", "Σ¹ crosses the levels of f where P₃(0) ≠ 0", "finite differences", "the sign")
@largest_error(1e-9)
def _transverse(twist: float) -> Errors:
    """Compare df/ds along Σ¹, by differences, with -2(K,γ₀)(K, γ₀×Ω)/|Ω|; relative to K².

    That is the last term of P₃ but for a factor that is never 0.
    """
    for n, gamma in _random_lines(64, 100):
        along = unit(cross(gamma, n.Omega))

        def level_of(s: float, n: Numbers = n, at: Array = gamma, side: Array = along) -> float:
            M = cross(np.cos(s) * at + np.sin(s) * side, n.K)
            return float(M @ M)

        # Central differences: their error is of the order of the step squared, 1e-10.
        slope = (level_of(1e-5) - level_of(-1e-5)) / 2e-5
        formula = -2 * (n.K @ gamma) * (n.K @ cross(gamma, n.Omega)) / np.linalg.norm(n.Omega)
        yield (slope - twist * formula) / float(n.K @ n.K)


# K across Ω --------------------------------------------------------------------------------


@dataclass(frozen=True)
class _Line:
    """A straight-line motion of a ball with K ⊥ Ω: γ₀ = c₁K + c₂K×Ω (5.3)."""

    n: Numbers
    c1: float
    c2: float

    @property
    def gamma(self) -> Array:
        """γ₀."""
        return self.c1 * self.n.K + self.c2 * cross(self.n.K, self.n.Omega)

    @property
    def M(self) -> Array:
        """γ₀×K."""
        return cross(self.gamma, self.n.K)

    @property
    def rates(self) -> Array:
        """The eigenvalues (3,) of (3.2) on the level of F₀, F₁, F₂."""
        inside = np.linalg.svd(f.integral_gradients(self.M, self.gamma))[2][3:]
        return np.linalg.eigvals(inside @ linear(self.n, self.gamma) @ inside.T).astype(complex)

    @property
    def stable(self) -> bool:
        """True where all of them have negative real parts."""
        return bool(self.rates.real.max() < 0)


def line(n: Numbers, level: float, name: str) -> _Line:
    """Return σ₊, σ₋, δ₊ or δ₋ of Prop. 3 at f = level."""
    square, Omega2, (s1, s2) = float(n.K @ n.K), float(n.Omega @ n.Omega), _SIGNS[name]
    c1, c2 = sqrt(square - level) / square, sqrt(level) / (square * sqrt(Omega2))
    return _Line(n, float(s1 * c1), float(s2 * c2))


@cache
def balls(count: int = 500) -> tuple[tuple[Numbers, float], ...]:
    """Return random balls with K ⊥ Ω, and an f < K² each."""
    random = np.random.default_rng(65)
    lines = _random_lines(66, count, "across")
    return tuple((n, random.uniform(0.0, 1.0) * float(n.K @ n.K)) for n, _ in lines)


# Propositions 3 and 4 ------------------------------------------------------------------------


@claim("(5.3)", "γ₀ = c₁K + c₂K×Ω: γ², M² by c₁, c₂", "at random c₁, c₂", "the sign of c₂²Ω²")
@largest_error(3e-13)
def _combination(twist: float) -> Errors:
    """Compare γ² and M² with K²(c₁² + c₂²Ω²) and c₂²K⁴Ω² of (5.3) for any c₁ and c₂; (Ω,γ) = 0."""
    random = np.random.default_rng(67)
    for n, _ in balls():
        c1, c2 = random.normal(size=2).tolist()
        each = _Line(n, c1, c2)
        K2, Omega2 = n.K @ n.K, n.Omega @ n.Omega
        square = each.gamma @ each.gamma - K2 * (each.c1**2 + twist * each.c2**2 * Omega2)
        level = each.M @ each.M - each.c2**2 * K2**2 * Omega2
        yield np.array([square, level, n.Omega @ each.gamma]) / max(float(K2 * Omega2), 1.0) ** 2


@claim("Prop. 3", "c₁, c₂ of σ₊, σ₋, δ₊, δ₋", "(3.2)", "c₂, by a tenth", control=1.1)
@largest_error(5e-14)
def _coefficients(twist: float) -> Errors:
    """Compare γ² with 1, M² with f and ω with 0 at Prop. 3's four; relative to K²."""
    for n, level in balls():
        for name in _SIGNS:
            each = line(n, level, name)
            each = replace(each, c2=twist * each.c2) if twist != 1 else each
            M, gamma = each.M, each.gamma
            at_rest = f.rubber_velocity(n, M, gamma)
            yield [gamma @ gamma - 1, (M @ M - level) / (n.K @ n.K), *at_rest]


@claim("Prop. 3", "four of them for f < K², two for f = K²", "all round Σ¹", "K not ⊥ Ω")
def _number_of_lines(twist: float) -> Residual:
    """Count the balls whose Σ¹ does not meet f < K² four times, f > K² never and f = K² twice.

    Twisted, for K that is not across Ω.
    """
    wrong = 0
    angles = np.linspace(0.0, 2 * np.pi, 2000, endpoint=False) + 0.001
    for n, level in balls(50):
        if twist != 1:
            n = replace(n, K=n.K + 2 * np.linalg.norm(n.K) * unit(n.Omega))
        levels, K2 = (np.cross(f.sigma(n, angles), n.K) ** 2).sum(axis=1), float(n.K @ n.K)
        over = [levels > x for x in (level, 1.001 * K2)]
        meets = [int(np.count_nonzero(each != np.roll(each, 1))) for each in over]
        tops = (levels > np.roll(levels, 1)) & (levels >= np.roll(levels, -1))
        touches = int(np.count_nonzero(tops & (levels > K2 * (1 - 1e-5))))
        wrong += (*meets, touches) != (4, 0, 2)
    return Residual(wrong, bound=0, unit="of 50 wrong")


@claim("5.1", "P₃(0) > 0 iff c₁c₂ < 0", "P₃ at random balls", "the sign of c₁c₂")
def _free_coefficient(twist: float) -> Residual:
    """Count how often P₃(0) > 0 and c₁c₂ < 0 do not agree."""
    wrong = 0
    for n, level in balls():
        for name in _SIGNS:
            each = line(n, level, name)
            wrong += bool((_P3(n, each.gamma)[3] > 0) != (twist * each.c1 * each.c2 < 0))
    return Residual(wrong, bound=0, unit="of 2000 wrong")


@claim("Prop. 4", "σ₊ and δ₋ are unstable", "eigenvalues", "σ₋ and δ₊")
def _always_unstable(twist: float) -> Residual:
    """Count how many of σ₊ and δ₋ are stable; twisted, of σ₋ and δ₊."""
    names = ("σ₊", "δ₋") if twist == 1 else ("σ₋", "δ₊")
    stable = sum(line(n, level, name).stable for n, level in balls() for name in names)
    return Residual(stable, bound=0, unit="of 1000 stable")


def _conditions(each: _Line, bracket: float = 1.0, square: bool = True) -> bool:
    """Return (5.4) at σ₋ or δ₊: c₁K×Ω - c₂Ω²K times `bracket`; c₁²K⁴, or c₁K⁴ if not `square`."""
    n, c1, c2 = each.n, each.c1, each.c2
    K2, Omega2 = n.K @ n.K, n.Omega @ n.Omega
    A_gamma = c1 * n.A @ n.K + c2 * n.A @ cross(n.K, n.Omega)
    first = A_gamma @ (bracket * (c1 * cross(n.K, n.Omega) - c2 * Omega2 * n.K))
    third = (c1**2 if square else c1) * K2**2 - n.K @ np.linalg.inv(n.A) @ n.Omega
    second = first * third + c1 * c2 * K2 * (A_gamma @ each.gamma) * K2 * Omega2
    return bool(first > 0 and second > 0)


@cache
def _candidates() -> tuple[tuple[_Line, bool], ...]:
    """Return σ₋ and δ₊ of the balls, and whether their eigenvalues say that they are stable."""
    lines = [line(n, level, name) for n, level in balls(1000) for name in ("σ₋", "δ₊")]
    return tuple((each, each.stable) for each in lines)


def _wrongly(bracket: float = 1.0, square: bool = True) -> int:
    """Count how often (5.4) and the eigenvalues do not agree."""
    return sum(_conditions(each, bracket, square) != stable for each, stable in _candidates())


@claim(
    "E13, (5.4)",
    "the second bracket is c₁K×Ω - c₂Ω²K",
    "eigenvalues",
    "the sign of the bracket",
    printed="c₁Ω×K + c₂Ω², a number to a vector",
)
def _second_bracket(twist: float) -> Residual:
    """Count where (5.4) fails with c₁K×Ω - c₂Ω²K.

    As printed, c₁Ω×K + c₂Ω², with the K that would make it a vector.
    """
    return Residual(_wrongly(bracket=twist), 0, _wrongly(bracket=-1.0), "of 2000 wrong")


@claim(
    "E14, (5.4)",
    "the third bracket is c₁²K⁴ - (K, A⁻¹Ω)",
    "eigenvalues",
    "the power of c₁",
    printed="c₁K⁴ - (K, A⁻¹Ω)",
)
def _third_bracket(twist: float) -> Residual:
    """Count where (5.4) fails with c₁²K⁴; and with c₁K⁴ as printed."""
    return Residual(_wrongly(square=twist == 1), 0, _wrongly(square=False), "of 2000 wrong")


SECTION.add(Claim("Fig. 9", "where σ₋ and δ₊ are stable", "its f and its bounds are not stated"))


# Figs 9 and 10 -------------------------------------------------------------------------------


@claim(
    "E16, Fig. 10",
    "σ₋ and δ₊ are stable for f < 16/7.69 only",
    "eigenvalues",
    "K₁, by a tenth",
    control=1.1,
    printed="stable at f = 3",
)
def limit(twist: float) -> Value:
    """Compute the f at which σ₋ and δ₊ of Fig. 10 lose their stability, and the caption's f."""
    n = line_ball()
    n = replace(n, K=n.K * [twist, 1.0, 1.0])

    def growth(level: float) -> float:
        return max(float(line(n, level, name).rates.real.max()) for name in ("σ₋", "δ₊"))

    found = brentq(growth, 1.0, 3.0, xtol=1e-12)
    # Stated to four digits after the point.
    return Value(found, corrected=16 / 7.69, bound=1e-9, printed=3.0, unit="(kg m²/s)²")


SECTION.add(captioned_motion("fig10", 2e-10))


@claim("Fig. 10", "at f = 2 it goes from σ₊ to δ₊", MOTION, "σ₋ for δ₊")
def _arrives(twist: float) -> Residual:
    """Measure how far MuJoCo's γ, from near σ₊ at f = 2, is from δ₊ after 200 s.

    Twisted, from σ₋.
    """
    target = line(line_ball(), 2.0, "δ₊" if twist == 1 else "σ₋").gamma
    end = long("fig10_stable", 200.0).gamma[-1]
    return Residual(float(np.linalg.norm(end - target)), bound=1e-4)


@claim(
    "E15, 5.1",
    "X = x₀, Y = -a|Ω|t + y₀ for σ, + for δ",
    MOTION,
    "the sign of Y",
    printed="+ for σ, - for δ",
)
def _directions(twist: float) -> Residual:
    """Compare X and Y of MuJoCo's ball after 1 s on each line at f = 2 with 0 and ∓a|Ω|.

    - for σ and + for δ; as printed the reverse.
    """
    corrected = printed = 0.0
    for name in _SIGNS:
        each = line(line_ball(), 2.0, name)
        end = _started(each.gamma, each.M, duration=1.0).motion.contact_point[-1]
        speed = (-1.0 if name.startswith("σ") else 1.0) * each.n.a * np.linalg.norm(each.n.Omega)
        corrected = max(corrected, float(np.linalg.norm(end - [0.0, twist * speed])))
        printed = max(printed, float(np.linalg.norm(end - [0.0, -speed])))
    return Residual(corrected, bound=3e-13, printed=printed, unit="m")

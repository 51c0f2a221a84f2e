"""Section 5.1, straight-line motions: the family Σ¹, its polynomial, and K ⊥ Ω."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from robotball.rotations import Array, from_matrix
from robotball.scene import Start
from validation.paper import formulas as f
from validation.paper.claim import Claim, Residual
from validation.paper.engine import MOTION, Seen, largest, seen_of
from validation.paper.formulas import Numbers, cross, paper_scene

_BALL = "fig10"
_Polynomial = Callable[[Numbers, Array], Array]


# The family ----------------------------------------------------------------------------------


def started(gamma: Array, M: Array, duration: float = 5.0) -> Seen:
    """MuJoCo's ball of Fig. 10 from γ and M, with OX against M."""
    scene = paper_scene(_BALL)
    alpha = -M / np.linalg.norm(M)
    attitude = from_matrix(np.array([alpha, cross(gamma, alpha), gamma]))
    start = Start(attitude, np.array([-np.linalg.norm(M), 0.0, 0.0]))
    return seen_of(replace(scene, start=start), duration)


def equilibria(twist: float) -> Residual:
    """|ω| of MuJoCo's ball from M = γ₀×K and (Ω,γ₀) = 0, and how far its path is from straight."""
    worst = 0.0
    n = f.numbers(paper_scene(_BALL).parameters)
    for angle in (0.3, 2.0, 4.0):
        gamma = np.array([np.cos(angle), np.sin(angle), 0.0])
        ball = started(gamma, twist * cross(gamma, n.K))
        alpha, beta, _ = ball.axes[0]
        line = ball.motion.times[:, None] * n.a * np.array([-beta @ n.Omega, alpha @ n.Omega])
        worst = max(worst, largest(ball.omega), largest(ball.motion.contact_point - line))
    return Residual(worst, bound=5e-11, unit="rad/s, m")


def random_lines(seed: int, count: int, kind: str = "any") -> list[tuple[Numbers, Array]]:
    """Balls and γ₀ with (Ω,γ₀) = 0; K any, along Ω ("along"), or across it ("across")."""
    random = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        Omega, K, v = random.normal(size=(3, 3))
        choices = {"any": K, "along": K[0] * Omega, "across": f.level(K, unit(Omega))}
        K = 3 * choices[kind]
        gamma = unit(f.level(v, unit(Omega)))
        found.append((f.with_A(tuple(random.uniform(0.2, 1.0, 3)), Omega, K), gamma))
    return found


def unit(v: Array) -> Array:
    """v at length one."""
    return v / np.linalg.norm(v)


def linear(n: Numbers, gamma: Array) -> Array:
    """∂/∂(M, γ) (6, 6) of (3.2) at M = γ×K, γ."""
    state = np.concatenate([cross(gamma, n.K), gamma])
    return f.jacobian(f.reduced(f.rubber_velocity, n), state)


def P3(n: Numbers, gamma: Array, twist: float = 1.0) -> Array:
    """The coefficients (4,) of (5.2), highest power first."""
    N, D = n.A @ gamma @ gamma, np.linalg.det(n.A)
    turned, K_gamma = cross(gamma, n.Omega), n.K @ gamma
    middle = K_gamma**2 - n.K @ np.linalg.inv(n.A) @ n.Omega
    free = K_gamma * (n.K @ turned)
    return np.array([1.0, n.A @ gamma @ turned / N, D * middle / N, twist * D * free / N])


def _P2(n: Numbers, gamma: Array, twist: float = 1.0) -> Array:
    """The coefficients (3,) of P₂, for K along Ω."""
    N, D = n.A @ gamma @ gamma, np.linalg.det(n.A)
    last = n.K @ np.linalg.inv(n.A) @ n.Omega
    return np.array([1.0, n.A @ gamma @ cross(gamma, n.Omega) / N, -twist * D * last / N])


def _worst_polynomial(kind: str, seed: int, power: int, coefficients: _Polynomial) -> float:
    """det(λ - ∂(3.2)) of 200 balls beside λ to a power times a polynomial, at six λ; relative."""
    worst = 0.0
    for n, gamma in random_lines(seed, 200, kind):
        J, expected = linear(n, gamma), coefficients(n, gamma)
        for x in (0.5, -1.0, 2.0, 1j, 2j, 1 + 1j):
            determinant = np.linalg.det(x * np.eye(6) - J)
            formula = x**power * np.polyval(expected, x)
            scale = np.abs(x) ** power * np.polyval(np.abs(expected), np.abs(x))
            worst = max(worst, float(abs(determinant - formula) / scale))
    return worst


def _characteristic(twist: float) -> Residual:
    """λ³P₃(λ) of (5.2), with any K."""
    return Residual(_worst_polynomial("any", 61, 3, lambda n, g: P3(n, g, twist)), bound=1e-12)


def _characteristic_along(twist: float) -> Residual:
    """λ⁴P₂(λ), with K along Ω."""
    return Residual(_worst_polynomial("along", 62, 4, lambda n, g: _P2(n, g, twist)), bound=1e-12)


def _one_level(twist: float) -> Residual:
    """M² = (γ₀×K)² beside K², for K along Ω; twisted, for any K."""
    lines = random_lines(63, 100, "along" if twist == 1 else "any")
    off = [cross(g, n.K) @ cross(g, n.K) / (n.K @ n.K) - 1 for n, g in lines]
    return Residual(float(np.abs(off).max()), bound=4e-15)


def _transverse(twist: float) -> Residual:
    """df/ds along Σ¹ by differences, beside -2(K,γ₀)(K, γ₀×Ω)/|Ω|, the last term of P₃ but for
    a factor that is never 0; relative to K².
    """
    worst = 0.0
    for n, gamma in random_lines(64, 100):
        along = unit(cross(gamma, n.Omega))

        def level_of(s: float, n: Numbers = n, at: Array = gamma, side: Array = along) -> float:
            M = cross(np.cos(s) * at + np.sin(s) * side, n.K)
            return float(M @ M)

        slope = (level_of(1e-5) - level_of(-1e-5)) / 2e-5
        formula = -2 * (n.K @ gamma) * (n.K @ cross(gamma, n.Omega)) / np.linalg.norm(n.Omega)
        worst = max(worst, abs(float(slope - twist * formula)) / float(n.K @ n.K))
    return Residual(worst, bound=1e-9)


CLAIMS = (
    Claim(
        "(5.1)",
        "M = γ₀×K, (Ω,γ₀) = 0: ω = 0, a straight line",
        equilibria,
        MOTION,
        "the sign of M",
    ),
    Claim("Remark 8", "segways are stabilised like this", "of other machines"),
    Claim("(5.2)", "λ³P₃(λ), any K", _characteristic, "determinants of (3.2)", "the free term"),
    Claim(
        "5.1",
        "K along Ω: λ⁴P₂(λ)",
        _characteristic_along,
        "determinants of (3.2)",
        "the free term",
    ),
    Claim("5.1", "K along Ω: all of Σ¹ has f = K²", _one_level, "(5.1)", "any K"),
    Claim(
        "5.1",
        "Σ¹ crosses the levels of f where P₃(0) ≠ 0",
        _transverse,
        "finite differences",
        "the sign",
    ),
)

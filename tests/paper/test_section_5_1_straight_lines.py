"""Sections 5.1 and 5.2: motions along straight lines, and the Poincaré map.

Of straight lines the family Σ¹ and its polynomial, K ⊥ Ω and Figs 9 and 10; of the map the
variables (L, l, g) of (5.5).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial

import numpy as np
from numpy import cos, sin, sqrt
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from robotball.engines.ensembles.orbits import kernel_start
from robotball.qualitative import straight_motions as lines
from robotball.qualitative.sections import crossings_of_motion, section
from robotball.rotations import Array
from robotball.scene import section_state
from tests.paper import formulas as f
from tests.paper.captions import CAPTIONS, claim_motion, line_ball
from tests.paper.claim import MINUS, AtLeast, Errors, Section, Value, by
from tests.paper.engine_ball import MOTION, RUBBER, Seen, largest, seen, seen_from
from tests.paper.formulas import Numbers, cross, paper_scene, unit

SECTION_5_1 = Section("5.1. Straight-line motions")
SECTION_5_2 = Section("5.2. Poincaré map")
claim = SECTION_5_1.claim

_BALL = "fig10"
_SIGNS = {"σ₊": (1, 1), "σ₋": (-1, 1), "δ₊": (1, -1), "δ₋": (-1, -1)}


# The family ----------------------------------------------------------------------------------


def _rolled(gamma: Array, M: Array, duration: float = 5.0) -> Seen:
    """Roll the ball of Fig. 10 by MuJoCo from γ and M, with OX against M."""
    # (3.1) lets M point anywhere across γ; section 3.3 lays OX against it, and so do the captions.
    return seen_from(_BALL, gamma, -unit(M), np.array([-np.linalg.norm(M), 0.0, 0.0]), duration)


@claim("(5.1)", "M = γ₀×K, (Ω,γ₀) = 0: ω = 0, a straight line")
@by(MOTION, "the sign of M", bound=5e-11, unit="rad/s, m")
def equilibria(twist: float = 1.0) -> Errors:
    """Compute |ω| of MuJoCo's ball from M = γ₀×K, (Ω,γ₀) = 0, and its distance from a line."""
    n = f.numbers(paper_scene(_BALL).parameters)
    for angle in (0.3, 2.0, 4.0):
        gamma = np.array([np.cos(angle), np.sin(angle), 0.0])
        ball = _rolled(gamma, twist * cross(gamma, n.K))
        alpha, beta, _ = ball.axes[0]
        line = ball.motion.times[:, None] * n.a * np.array([-beta @ n.Omega, alpha @ n.Omega])
        yield largest(ball.omega)
        yield largest(ball.motion.contact_point - line)


SECTION_5_1.unchecked("Remark 8", "segways are stabilised like this", "of other machines")


def _random_lines(seed: int, count: int, kind: str = "any") -> list[tuple[Numbers, Array]]:
    """Return balls and γ₀ with (Ω,γ₀) = 0; K any, along Ω ("along"), or across it ("across")."""
    random = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        Omega, K, v = random.normal(size=(3, 3))
        # Three families of which the paper says different things: (5.2) of any K, P₂ of K along Ω,
        # Props 3 and 4 of K across it.
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


_determinants = partial(by, "determinants of (3.2)", "the free term", bound=1e-12)


@claim("5.1", "K along Ω: λ⁴P₂(λ)")
@_determinants(kind="along", seed=62, power=4, polynomial=_P2)
@claim("(5.2)", "λ³P₃(λ), any K")
@_determinants(kind="any", seed=61, power=3, polynomial=_P3)
def _characteristic(
    kind: str, seed: int, power: int, polynomial: Callable[..., Array], twist: float = 1.0
) -> Errors:
    """Compare det(λ - ∂(3.2)) of 200 balls, at six λ, with a power of λ times a polynomial."""
    for n, gamma in _random_lines(seed, 200, kind):
        J, expected = linear(n, gamma), polynomial(n, gamma, twist)
        # Both are monic of degree 6, so that six values determine them.
        # Determinants, as the six eigenvalues cannot be used: three or four of them are 0, and a
        # zero of order m is found to the m-th root of rounding only.
        for x in (0.5, -1.0, 2.0, 1j, 2j, 1 + 1j):
            determinant = np.linalg.det(x * np.eye(6) - J)
            formula = x**power * np.polyval(expected, x)
            scale = np.abs(x) ** power * np.polyval(np.abs(expected), np.abs(x))
            yield abs(determinant - formula) / scale
        ours = lines.straight_motion(f.ball(n), gamma).polynomial
        yield ours - np.append(expected, np.zeros(power - 3))


@claim("5.1", "K along Ω: all of Σ¹ has f = K²")
@by("(5.1)", "any K", {"kind": "any"}, bound=4e-15)
def _one_level(kind: str = "along") -> Errors:
    """Compare M² = (γ₀×K)² with K², for K along Ω."""
    for n, gamma in _random_lines(63, 100, kind):
        yield cross(gamma, n.K) @ cross(gamma, n.K) / (n.K @ n.K) - 1


@claim("5.1", "Σ¹ crosses the levels of f where P₃(0) ≠ 0")
@by("finite differences", "the sign", bound=1e-9)
def _transverse(twist: float = 1.0) -> Errors:
    """Compare df/ds along Σ¹, by differences, with -2(K,γ₀)(K, γ₀×Ω)/|Ω|; relative to K².

    That is the last term of P₃ but for a factor that is never 0.
    """
    for n, gamma in _random_lines(64, 100):
        along = unit(cross(gamma, n.Omega))

        # Along Σ¹ γ turns about Ω, so that (Ω, γ) = 0 all the while.
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
        # Off the level the eigenvalues of the integrals are 0, and would hide whether the others
        # are stable.
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


@claim("(5.3)", "γ₀ = c₁K + c₂K×Ω: γ², M² by c₁, c₂")
@by("at random c₁, c₂", "the sign of c₂²Ω²", bound=3e-13)
def _combination(twist: float = 1.0) -> Errors:
    """Compare γ² and M² with K²(c₁² + c₂²Ω²) and c₂²K⁴Ω² of (5.3) for any c₁ and c₂; (Ω,γ) = 0."""
    random = np.random.default_rng(67)
    for n, _ in balls():
        c1, c2 = random.normal(size=2).tolist()
        each = _Line(n, c1, c2)
        K2, Omega2 = n.K @ n.K, n.Omega @ n.Omega
        square = each.gamma @ each.gamma - K2 * (each.c1**2 + twist * each.c2**2 * Omega2)
        level = each.M @ each.M - each.c2**2 * K2**2 * Omega2
        yield np.array([square, level, n.Omega @ each.gamma]) / max(float(K2 * Omega2), 1.0) ** 2


@claim("Prop. 3", "c₁, c₂ of σ₊, σ₋, δ₊, δ₋")
@by("(3.2)", "c₂, by a tenth", control={"twist": 1.1}, bound=5e-14)
def _coefficients(twist: float = 1.0) -> Errors:
    """Compare γ² with 1, M² with f and ω with 0 at Prop. 3's four; relative to K²."""
    for n, level in balls():
        for name in _SIGNS:
            each = line(n, level, name)
            each = replace(each, c2=twist * each.c2)
            M, gamma = each.M, each.gamma
            at_rest = f.rubber_velocity(n, M, gamma)
            yield [gamma @ gamma - 1, (M @ M - level) / (n.K @ n.K), *at_rest]


@claim("Prop. 3", "four of them for f < K², two for f = K²; from rest, f = 0, two")
@by("all round Σ¹", "K not ⊥ Ω", {"along": 2.0}, bound=0, unit="of 50 wrong")
def _number_of_lines(along: float = 0.0) -> Errors:
    """Count the balls whose Σ¹ does not meet f < K² four times, f > K² never, f = K² and 0 twice.

    Or of which robotball's motions are not Prop. 3's of their names. f = 0 is no such level: it is
    the sphere of section 4. along: the part of K along Ω, over that across it.
    """
    # Off by a thousandth, lest a point lie on a crossing itself.
    angles = np.linspace(0.0, 2 * np.pi, 2000, endpoint=False) + 0.001
    for n, level in balls(50):
        off = False
        for ours in lines.straight_motions(f.ball(n), level):
            paper = line(n, level, lines.name_of_line(f.ball(n), ours.gamma))
            off |= not np.linalg.norm(ours.gamma - paper.gamma) < 1e-12
            off |= ours.is_stable != paper.stable
        n = replace(n, K=n.K + along * np.linalg.norm(n.K) * unit(n.Omega))
        levels, K2 = (np.cross(f.sigma(n, angles), n.K) ** 2).sum(axis=1), float(n.K @ n.K)
        over = [levels > x for x in (level, 1.001 * K2)]
        # M² = (γ×K)² along the circle says where lines of that f are, without Prop. 3's formula.
        meets = [int(np.count_nonzero(each != np.roll(each, 1))) for each in over]
        tops = (levels > np.roll(levels, 1)) & (levels >= np.roll(levels, -1))
        touches = int(np.count_nonzero(tops & (levels > K2 * (1 - 1e-5))))
        # M = γ×K passes zero where (γ×K, Ω) changes its sign.
        ahead = np.cross(f.sigma(n, angles), n.K) @ n.Omega > 0
        zeros = int(np.count_nonzero((ahead != np.roll(ahead, 1)) & (levels < 1e-4 * K2)))
        yield off or (*meets, touches, zeros) != (4, 0, 2, 2)


@claim("5.1", "P₃(0) > 0 iff c₁c₂ < 0")
@by("P₃ at random balls", "the sign of c₁c₂", bound=0, unit="of 2000 wrong")
def _free_coefficient(twist: float = 1.0) -> Errors:
    """Count how often P₃(0) > 0 and c₁c₂ < 0 do not agree."""
    for n, level in balls():
        for name in _SIGNS:
            each = line(n, level, name)
            yield (_P3(n, each.gamma)[3] > 0) != (twist * each.c1 * each.c2 < 0)


@claim("Prop. 4", "σ₊ and δ₋ are unstable")
@by("eigenvalues", "σ₋ and δ₊", {"names": ("σ₋", "δ₊")}, bound=0, unit="of 1000 stable")
def _always_unstable(names: Sequence[str] = ("σ₊", "δ₋")) -> Errors:
    """Count how many of σ₊ and δ₋ are stable."""
    for name in names:
        yield sum(line(n, level, name).stable for n, level in balls())


def _conditions(each: _Line, bracket: float = 1.0, square: bool = True) -> bool:
    """Return (5.4) at σ₋ or δ₊: c₁K×Ω - c₂Ω²K times `bracket`; c₁²K⁴, or c₁K⁴ if not `square`."""
    n, c1, c2 = each.n, each.c1, each.c2
    K2, Omega2 = n.K @ n.K, n.Omega @ n.Omega
    A_gamma = c1 * n.A @ n.K + c2 * n.A @ cross(n.K, n.Omega)
    # By the Routh-Hurwitz criterion of the cubic P₃, whose free term is positive at σ₋ and δ₊:
    # (5.4) are the two conditions left.
    first = A_gamma @ (bracket * (c1 * cross(n.K, n.Omega) - c2 * Omega2 * n.K))
    third = (c1**2 if square else c1) * K2**2 - n.K @ np.linalg.inv(n.A) @ n.Omega
    second = first * third + c1 * c2 * K2 * (A_gamma @ each.gamma) * K2 * Omega2
    return bool(first > 0 and second > 0)


@cache
def _candidates() -> tuple[tuple[_Line, bool], ...]:
    """Return σ₋ and δ₊ of the balls, and whether their eigenvalues say that they are stable."""
    lines = [line(n, level, name) for n, level in balls(1000) for name in ("σ₋", "δ₊")]
    return tuple((each, each.stable) for each in lines)


_of_2000 = partial(by, "eigenvalues", bound=0, unit="of 2000 wrong")


@claim("E13, (5.4)", "the second bracket is c₁K×Ω - c₂Ω²K", "c₁Ω×K + c₂Ω², a number to a vector")
@_of_2000("the sign of the bracket", printed=MINUS)
def _second_bracket(twist: float = 1.0) -> Errors:
    """Count where (5.4) fails with c₁K×Ω - c₂Ω²K.

    As printed, c₁Ω×K + c₂Ω², with the K that would make it a vector.
    """
    for each, stable in _candidates():
        yield _conditions(each, bracket=twist) != stable


@claim("E14, (5.4)", "the third bracket is c₁²K⁴ - (K, A⁻¹Ω)", "c₁K⁴ - (K, A⁻¹Ω)")
@_of_2000("the power of c₁", {"square": False}, printed={"square": False})
def _third_bracket(square: bool = True) -> Errors:
    """Count where (5.4) fails with c₁²K⁴; and with c₁K⁴ as printed."""
    for each, stable in _candidates():
        yield _conditions(each, square=square) != stable


# Figs 9 and 10 -------------------------------------------------------------------------------


@claim("Fig. 9", "at any f: K₁K₂ > 0 and (a₁/K₁)² + (a₂/K₂)² < (a₁ - a₂)²/f")
@by("eigenvalues", "the sign of K₁K₂", bound=0, unit="of 300 wrong")
def _region(twist: float = 1.0) -> Errors:
    """Count the K at which σ₋ and δ₊ are not stable where that holds, and unstable elsewhere.

    The f is not printed. It scales the region, which has one shape.
    """
    n, random = line_ball(), np.random.default_rng(68)
    a1, a2, _ = n.moments
    for level in (0.5, 3.0, 20.0):
        sizes, angles = random.uniform([1.01, 0.0], [8.0, 2 * np.pi], (100, 2)).T
        for K1, K2 in zip(*(sqrt(level) * sizes * [cos(angles), sin(angles)]), strict=True):
            inside = (a1 / K1) ** 2 + (a2 / K2) ** 2 < (a1 - a2) ** 2 / level
            inside = inside and twist * K1 * K2 > 0
            other = replace(n, K=np.array([K1, K2, 0.0]))
            yield any(line(other, level, name).stable != inside for name in ("σ₋", "δ₊"))


@claim(
    "E16, Fig. 10",
    "σ₋ and δ₊ are stable for f < 16/7.69 only",
    'f = 3, of "parameters in the stability region"',
)
@by("eigenvalues", "K₁, by a tenth", {"twist": 1.1})
def limit(twist: float = 1.0) -> Value:
    """Compute the f at which σ₋ and δ₊ of Fig. 10 lose their stability, and the caption's f."""
    n = line_ball()
    n = replace(n, K=n.K * [twist, 1.0, 1.0])

    # Stability ends where the first of the two lines loses it.
    def growth(level: float) -> float:
        return max(float(line(n, level, name).rates.real.max()) for name in ("σ₋", "δ₊"))

    found = brentq(growth, 1.0, 3.0, xtol=1e-12)
    # Stated to four digits after the point.
    return Value(found, corrected=16 / 7.69, bound=1e-9, printed=3.0, unit="(kg m²/s)²")


_TURNED = 80.0, 0.05  # s: the ball of Fig. 10 takes 36 s to stop and turn round
claim_motion(SECTION_5_1, "fig10", 4e-9, *_TURNED)


_BACK = {"to": "σ₋", "sense": -1.0}


@claim("Fig. 10", "at f = 2 it goes from σ₊ to δ₊")
@by(MOTION, "σ₋ for δ₊", _BACK, bound=1e-4, name="fig10_stable", level=2.0, sampled=(200.0, 0.05))
@claim("Fig. 10", "it goes from σ₊ to δ₊, and turns round")
@by(MOTION, "σ₋ for δ₊", _BACK, bound=1e-4, name="fig10", level=3.0, sampled=_TURNED)
def _arrives(
    name: str, level: float, sampled: tuple[float, float], to: str = "δ₊", sense: float = 1.0
) -> Errors:
    """Measure how far MuJoCo's γ, from near σ₊, is from δ₊ at the end, and Ẏ from a|Ω|."""
    n, ball = line_ball(), seen(name, *sampled)
    yield ball.gamma[-1] - line(n, level, to).gamma
    # At the end the ball rolls straight on, so that a difference of two samples is its velocity.
    last = np.diff(ball.motion.contact_point[-2:, 1]) / sampled[1]
    yield last - sense * n.a * np.linalg.norm(n.Omega)


@claim("E15, 5.1", "X = x₀, Y = -a|Ω|t + y₀ for σ, + for δ", "+ for σ, - for δ")
@by(MOTION, "the sign of Y", bound=3e-13, unit="m", printed=MINUS)
def _directions(twist: float = 1.0) -> Errors:
    """Compare X and Y of MuJoCo's ball after 1 s on each line at f = 2 with 0 and ∓a|Ω|.

    - for σ and + for δ; as printed the reverse. And how far it came with robotball's speed.
    """
    for name in _SIGNS:
        each = line(line_ball(), 2.0, name)
        end = _rolled(each.gamma, each.M, duration=1.0).motion.contact_point[-1]
        speed = (-1.0 if name.startswith("σ") else 1.0) * each.n.a * np.linalg.norm(each.n.Omega)
        yield np.linalg.norm(end - [0.0, twist * speed])
        yield np.linalg.norm(end) - lines.straight_motion(f.ball(each.n), each.gamma).speed


# The Poincaré map ---------------------------------------------------------------------------

F = 25.0  # M² of Figs 11 to 14, (kg m²/s)²


def andoyer(L: float, l: float, g: float, level: float = F) -> tuple[Array, Array]:
    """Return M and γ (3,) of (5.5)."""
    root, share = sqrt(level - L**2), L / sqrt(level)
    M = np.array([root * sin(l), root * cos(l), L])
    gamma = np.array(
        [
            share * cos(g) * sin(l) + sin(g) * cos(l),
            share * cos(g) * cos(l) - sin(g) * sin(l),
            -sqrt(1 - share**2) * cos(g),
        ]
    )
    return M, gamma


@SECTION_5_2.claim("5.2", "f > K², Figs 11a, b: no straight line on the level")
@by("all round Σ¹", "f < K²", {"level": 5.0})
def _no_lines(level: float = F) -> AtLeast:
    """Measure by how much f exceeds (γ×K)² on all of (Ω,γ) = 0, in Figs 11a and 11b."""
    least = np.inf
    for name in ("fig12", "fig14"):
        n = CAPTIONS[name].n
        M = np.cross(f.sigma(n, np.linspace(0.0, 2 * np.pi, 721)), n.K)
        least = min(least, level - float((M * M).sum(axis=1).max()))
    return AtLeast(float(least), bound=1.0, unit="(kg m²/s)²")


@SECTION_5_2.claim("(5.5)", "γ² = 1, (M, γ) = 0, M² = f")
@by("at random L, l, g", "sign of γ₂", bound=1e-14)
def _on_the_level(twist: float = 1.0) -> Errors:
    """Check γ² = 1, (M, γ) = 0 and M² = f by (5.5), and M and γ with those of robotball.scene."""
    random = np.random.default_rng(71)
    for _ in range(100):
        L, l, g = random.uniform(-5, 5), *random.uniform(0, 2 * np.pi, 2)
        M, gamma = andoyer(L, l, g)
        gamma = gamma * [1.0, twist, 1.0]
        ours, M_ours = section_state(L, l, g, F)
        yield [gamma @ gamma - 1, M @ gamma, M @ M / F - 1, *(ours - gamma), *(M_ours - M)]


def _angle_g(M: Array, gamma: Array) -> float:
    """Return g by (5.5): sin g = γ₁cos l - γ₂sin l, cos g = -γ₃/√(1 - L²/f)."""
    across = np.hypot(M[0], M[1])
    sine = (gamma[0] * M[1] - gamma[1] * M[0]) / across
    return float(np.arctan2(sine, -gamma[2] * np.linalg.norm(M) / across))


@SECTION_5_2.claim("(5.6)", "section and crossings_of_motion: (l, L) at g = 0")
@by(f"{MOTION} and (5.5)", "g₀ = π", {"g": np.pi}, bound=4e-7)
def _crossings(g: float = 0.0) -> Errors:
    """Compare (l, L) where MuJoCo's ball of Fig. 12 has g by (5.5) with robotball's sections.

    Between samples by splines.
    """
    scene, ball = paper_scene(RUBBER), seen(RUBBER)
    times = ball.motion.times
    M, gamma = CubicSpline(times, ball.momentum), CubicSpline(times, ball.gamma)
    angles = np.array([_angle_g(*each) for each in zip(ball.momentum, ball.gamma, strict=True)])
    # Shifted so that the section is at 0, and the jump of the angle half a turn from it.
    angles = np.mod(angles + g + np.pi, 2 * np.pi) - np.pi
    passing = np.flatnonzero((angles[1:] * angles[:-1] < 0) & (np.abs(np.diff(angles)) < 1.0))
    found = []
    for i in passing:
        at = brentq(lambda t: np.sin(_angle_g(M(t), gamma(t))), times[i], times[i + 1], xtol=1e-12)
        found.append([np.arctan2(*M(at)[:2]), M(at)[2]])
    parameters, attitudes, momenta = kernel_start(scene)
    expected = section(parameters, attitudes, momenta, count=len(found))
    sampled = crossings_of_motion(ball.motion, scene)[: len(found)]
    for l, L in ((expected.l[0], expected.L[0]), (sampled.l, sampled.L)):
        turn = np.abs(np.array(found)[:, 0] - l)
        yield np.minimum(turn, 2 * np.pi - turn) + np.abs(np.array(found)[:, 1] - L)


@SECTION_5_2.claim(
    "E25, 5.2", "(l, L/√f) is on an annulus: at L = √f γ depends on l", "a point on the sphere S²"
)
@by("(5.5)", "l = 0 for l = π")
def edge(twist: float = 1.0) -> Value:
    """Compute the distance of γ at l = 0 from γ at l = π, both at L = √f: 0, were it a pole."""
    ends = [andoyer(sqrt(F), l, g=0.0)[1] for l in (0.0, np.pi * (1 + twist) / 2)]
    apart = float(np.linalg.norm(ends[1] - ends[0]))
    return Value(apart, corrected=2.0, bound=1e-12, printed=0.0)

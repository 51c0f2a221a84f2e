"""Section 4, motion from rest: fixed points and limit cycles of (4.1), with K = (0, 0, K₃).

The paper's formulas for the fixed points are known to us in part. What was lost is derived anew:
sin(2θ - ν) = κ of robotball.qualitative.fixed_point_formulas. ν₁, κ₁ belong to γ₁ = 0 (j = 2) and
ν₂, κ₂ to γ₂ = 0 (j = 1). Near Γ₅,₆ dγ₁/dt = -A₂γ₂ + …, dγ₂/dt = A₁γ₁ + …, with
Aⱼ = (aⱼ - a₃)Ω₃/a₃ + aⱼK₃.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from scipy.optimize import bisect

from robotball import load_scene
from robotball.parameters import Parameters, as_vector
from robotball.qualitative.equilibria import (
    first_lyapunov_value,
    fixed_points,
    flow,
    rate_scale,
    tangents,
    taylor,
)
from robotball.qualitative.fixed_point_formulas import kappa, nu
from robotball.qualitative.limit_cycles import limit_cycles
from robotball.rotations import Array
from validation.paper.claim import Claim, Residual, Value
from validation.paper.engine import largest, seen

TOP, BOTTOM = np.array([0.0, 0.0, 1.0]), np.array([0.0, 0.0, -1.0])  # Γ₅, Γ₆
J_OF_KAPPA_1, J_OF_KAPPA_2 = 1, 0  # counted from 0
DRAWN = 400  # balls with random A, Ω, K₃


@cache
def drawn_balls() -> tuple[Parameters, ...]:
    """Balls with K = (0, 0, K₃) and numbers of either sign; |Ω₃| < 1, for E10's printed arcsin."""
    random = np.random.default_rng(1)
    balls = []
    for _ in range(DRAWN):
        A, K3 = random.uniform(0.2, 1.0, 3), random.uniform(-3, 3)
        Omega = random.uniform(-1, 1, 3) * [4.0, 4.0, 1.0]
        I = as_vector(1 / A)  # d has no part in (4.1)
        balls.append(Parameters("rubber", I, 0.0, 1.0, as_vector(Omega), (0.0, 0.0, K3)))
    return tuple(balls)


def with_K3(K3: float) -> Parameters:
    """The ball of Figs 6 to 8 with another K₃ [kg m²/s]."""
    return replace(fig6(), K=(0.0, 0.0, K3))


def fig6() -> Parameters:
    """The ball of Fig. 6."""
    return load_scene("fig06").parameters


def residual_at(ball: Parameters, j: int, theta: float) -> float:
    """|dγ/dt| of (4.1) at an angle of that circle, relative to the rates of the flow."""
    gamma = np.zeros(3)
    gamma[j], gamma[2] = np.cos(theta), np.sin(theta)
    return float(np.linalg.norm(flow(ball, as_vector(gamma))) / rate_scale(ball))


# Fixed points on the circles ---------------------------------------------------------------


def angles() -> Residual:
    """θ = (ν + arcsin κ)/2 with ν = atan2(Ω₃, Ωⱼ), and ν = arcsin(Ω₃²/√(Ωⱼ² + Ω₃²)) as printed.

    What stands under the printed root is lost; the squares are taken.
    """

    def off(ball: Parameters, j: int, angle: float) -> float:
        return residual_at(ball, j, (angle + np.arcsin(kappa(ball, j))) / 2)

    def printed_nu(ball: Parameters, j: int) -> float:
        Omega = ball.Omega
        return float(np.arcsin(Omega[2] ** 2 / np.hypot(Omega[j], Omega[2])))

    corrected = max(off(ball, j, nu(ball, j)) for ball, j in circles())
    printed = max(off(ball, j, printed_nu(ball, j)) for ball, j in circles())
    return Residual(corrected, bound=1e-13, printed=printed)  # rounding: measured 1e-16


def second_angles() -> Residual:
    """θ₃ = -(arcsin κ - ν)/2 + π/2, and times π/2 as printed; the bracket is lost, and derived."""

    def bracket(ball: Parameters, j: int) -> float:
        return float(np.arcsin(kappa(ball, j))) - nu(ball, j)

    corrected = max(residual_at(b, j, -bracket(b, j) / 2 + np.pi / 2) for b, j in circles())
    printed = max(residual_at(b, j, -bracket(b, j) / 2 * np.pi) for b, j in circles())
    return Residual(corrected, bound=1e-13, printed=printed)


def circles() -> list[tuple[Parameters, int]]:
    """The circles with fixed points, |κ| < 1, of the balls drawn."""
    return [(b, j) for b in drawn_balls() for j in (0, 1) if abs(kappa(b, j)) < 1]


def number_of_fixed_points() -> Residual:
    """2 + 4 [|κ₁| < 1] + 4 [|κ₂| < 1], or 0 < κ < 1 as printed; wrong for how many K₃ of 24."""
    wrong = printed_wrong = 0
    for K3 in np.linspace(-3, 3, 24):
        ball = with_K3(float(K3))
        kappas = kappa(ball, J_OF_KAPPA_1), kappa(ball, J_OF_KAPPA_2)
        number = len(fixed_points(ball))
        wrong += number != 2 + 4 * sum(abs(k) < 1 for k in kappas)
        printed_wrong += number != 2 + 4 * sum(0 < k < 1 for k in kappas)
    return Residual(wrong, bound=0, printed=printed_wrong, unit="of 24 wrong")


def vanishing_at(low: float, high: float, more: int, stated: float) -> Value:
    """The K₃ at which the number of fixed points falls below `more`, by bisection."""
    found = bisect(lambda K3: len(fixed_points(with_K3(K3))) - more + 0.5, low, high, xtol=1e-6)
    # Stated to five digits after the point; found to 1e-6.
    return Value(found, corrected=stated, bound=1e-5, unit="kg m²/s")


def kappa_at(j: int, K3: float) -> Value:
    """κ at the K₃ where fixed points vanish; K₃ is stated to five digits."""
    return Value(abs(kappa(with_K3(K3), j)), corrected=1.0, bound=1e-5)


def ten_fixed_points() -> Residual:
    """Fig. 6: how many fixed points are missing, or of another kind."""
    stated = Counter({"saddle": 4, "stable focus": 2, "unstable node": 2, "slow stable focus": 2})
    found = Counter(point.kind for point in fixed_points(fig6()))
    return Residual(((found - stated) + (stated - found)).total(), bound=0, unit="of 10 off")


# Γ₅ and Γ₆ ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class Foci:
    """Γ₅ and Γ₆ of a ball where A₁A₂ > 0, so that the linear part only turns.

    A1, A2 1/s; values: the first Lyapunov values at Γ₅ and Γ₆, negative where they are stable.
    """

    ball: Parameters
    A1: float
    A2: float
    values: tuple[float, float]

    @property
    def B(self) -> float:
        """Ω₁Ω₂((a₂-a₃)²A₁² - (a₁-a₃)²A₂²)."""
        a1, a2, a3 = self.ball.A
        Omega1, Omega2, _ = self.ball.Omega
        return Omega1 * Omega2 * ((a2 - a3) ** 2 * self.A1**2 - (a1 - a3) ** 2 * self.A2**2)


@cache
def foci() -> tuple[Foci, ...]:
    """Those of the balls drawn."""
    found = []
    for ball in drawn_balls():
        A1, A2 = linear_part(ball, 0), linear_part(ball, 1)
        if A1 * A2 > 0:
            values = first_lyapunov_value(ball, TOP), first_lyapunov_value(ball, BOTTOM)
            found.append(Foci(ball, A1, A2, values))
    return tuple(found)


def linear_part(ball: Parameters, j: int) -> float:
    """A₁ (j = 0) or A₂ (j = 1), 1/s."""
    a, a3 = ball.A[j], ball.A[2]
    return float((a - a3) * ball.Omega[2] / a3 + a * ball.K[2])


def stability(printed: Callable[[Foci], float]) -> Residual:
    """How many of the foci are stable without B/A₁ < 0, or the other way round.

    printed: what the printed criterion asks to be negative.
    """

    def wrong(criterion: Callable[[Foci], float]) -> int:
        return sum((criterion(each) < 0) != (value < 0) for each in foci() for value in each.values)

    corrected = wrong(lambda each: each.B / each.A1)
    return Residual(corrected, 0, wrong(printed), unit=f"of {2 * len(foci())} wrong")


def second_rate(gamma: Array) -> Array:
    """Taylor coefficients (3, 3) of dγ₂/dt of Fig. 6 at Γ₅ or Γ₆: [i, j] of γ₁ⁱγ₂ʲ [1/s]."""
    axes = tangents(gamma)[:, :2]  # so that the plane's coordinates are γ₁ and γ₂
    to_second_order = np.add.outer(np.arange(3), np.arange(3)) <= 2
    return taylor(fig6(), gamma, axes)[1, :3, :3] * to_second_order


def expansion(linear: tuple[int, int], mixed: float, square: float) -> Array:
    """A₁ times γ₁ⁱγ₂ʲ, linear = (i, j), + (a₁-a₃)/a₃ (mixed γ₁γ₂ + square γ₁²), likewise."""
    a1, _, a3 = fig6().A
    terms = np.zeros((3, 3))
    terms[linear] = linear_part(fig6(), 0)
    terms[1, 1], terms[2, 0] = (a1 - a3) / a3 * mixed, (a1 - a3) / a3 * square
    return terms


def second_component() -> Residual:
    """dγ₂/dt = A₁γ₁ + … (Ω₂γ₁γ₂ + Ω₁γ₁²), and A₁γ₂ + … (Ω₁γ₁γ₂ + Ω₂γ₁²) as printed."""
    Omega1, Omega2, _ = fig6().Omega
    off = second_rate(TOP) - expansion((1, 0), mixed=Omega2, square=Omega1)
    printed = second_rate(TOP) - expansion((0, 1), mixed=Omega1, square=Omega2)
    return Residual(np.abs(off).max(), bound=1e-11, printed=np.abs(printed).max(), unit="1/s")


def signs_at_the_bottom() -> Residual:
    """At Γ₆ the quadratic terms of dγ₂/dt have the opposite sign of those at Γ₅."""
    Omega1, Omega2, _ = fig6().Omega
    off = second_rate(BOTTOM) - expansion((1, 0), mixed=-Omega2, square=-Omega1)
    printed = second_rate(BOTTOM) - expansion((1, 0), mixed=Omega2, square=Omega1)
    return Residual(np.abs(off).max(), bound=1e-11, printed=np.abs(printed).max(), unit="1/s")


# Motions -----------------------------------------------------------------------------------


def stays_without_momentum() -> Residual:
    """|M| of MuJoCo's ball, started at rest."""
    return Residual(largest(seen("fig06").motion.momentum.T), bound=2e-7, unit="kg m²/s")


def unstable_cycle(name: str, stated: float) -> Value:
    """The period of the only limit cycle of a figure, if it is unstable; else not a number."""
    cycles = limit_cycles(load_scene(name).parameters, longest=2 * stated, starts=16)
    unstable = len(cycles) == 1 and cycles[0].multipliers[0].real > 1
    period = float(cycles[0].period) if unstable else float("nan")
    return Value(period, corrected=stated, bound=10 ** (np.floor(np.log10(stated)) - 5), unit="s")


LOST_START = "the rest of the start is lost: nothing to test it by"

CLAIMS = (
    Claim("4", "from rest, M stays zero", stays_without_momentum),
    Claim("E10, 4.1", "ν = atan2(Ω₃, Ωⱼ), not arcsin(Ω₃²/√…) (derived)", angles),
    Claim("E11, 4.1", "θ₃ = -(…)/2 + π/2, not -(…)/2 · π (derived)", second_angles),
    Claim(
        "E12, 4.1", "0 < |κ| < 1 brings four fixed points, not 0 < κ < 1", number_of_fixed_points
    ),
    Claim("4.1", "|κ₁| = 1 at K₃ = 0.51503", lambda: kappa_at(J_OF_KAPPA_1, 0.51503)),
    Claim("4.1", "|κ₂| = 1 at K₃ = 2.08207", lambda: kappa_at(J_OF_KAPPA_2, 2.08207)),
    Claim(
        "4.1", "four of ten fixed points vanish there", lambda: vanishing_at(0.4, 0.6, 10, 0.51503)
    ),
    Claim("4.1", "and four of six there", lambda: vanishing_at(2.0, 2.2, 6, 2.08207)),
    Claim(
        "E6, Prop. 2",
        "Γ₅,₆ are stable iff B/A₁ < 0, not > 0",
        lambda: stability(printed=lambda each: -each.B / each.A1),
    ),
    Claim(
        "E7, Prop. 2",
        "B = Ω₁Ω₂(…), not K₃Ω₁Ω₂(…)",
        lambda: stability(printed=lambda each: each.ball.K[2] * each.B / each.A1),
    ),
    Claim("E8, Prop. 2", "dγ₂/dt = A₁γ₁ …Ω₂γ₁γ₂ …Ω₁γ₁²", second_component),
    Claim("E9, Prop. 2", "the quadratic signs at Γ₆ are opposite", signs_at_the_bottom),
    Claim("Fig. 6", "4 saddles, 2+2 stable foci, 2 unstable nodes", ten_fixed_points),
    Claim("Fig. 7", "an unstable limit cycle", lambda: unstable_cycle("fig07", 60.0086)),
    Claim("Fig. 8", "an unstable limit cycle", lambda: unstable_cycle("fig08", 6.09094)),
    Claim("E17, Fig. 5b", "α₂(0) = -2√19/95, not +2√19/95", LOST_START),
    Claim("E18, Fig. 5c", "γ₃(0) = √39/20, not √33/20", LOST_START),
    Claim("E24, 4.1", "Σ_s ∩ ζ, not Σ_s ∪ ζ", "what Σ_s and ζ are is lost"),
)

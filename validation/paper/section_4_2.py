"""Section 4.2 up to the fixed points Δ and Θ: K = (0, 0, K₃), Γ₅,₆ and Proposition 2."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy import sqrt

from robotball.rotations import Array
from validation.paper import formulas as f
from validation.paper.captions import CAPTIONS
from validation.paper.claim import AtLeast, Claim, Residual
from validation.paper.formulas import Numbers

FIG6 = CAPTIONS["fig06"].n


@cache
def balls() -> tuple[Numbers, ...]:
    """Random ones with K = (0, 0, K₃), numbers of either sign; |Ω₃| < 1, for E10's arcsin."""
    random = np.random.default_rng(51)
    found = []
    for _ in range(200):
        A, K3 = random.uniform(0.2, 1.0, 3), random.uniform(-3.0, 3.0)
        Omega = random.uniform(-1.0, 1.0, 3) * [4.0, 4.0, 1.0]
        found.append(f.with_A(tuple(A), Omega, np.array([0.0, 0.0, K3])))
    return tuple(found)


def _A1_A2(n: Numbers) -> tuple[float, float]:
    """a₁a₃K₃ + (a₁ - a₃)Ω₃ and a₂a₃K₃ + (a₂ - a₃)Ω₃ of Prop. 2."""
    (a1, a2, a3), K3, Omega3 = n.moments, n.K[2], n.Omega[2]
    return a1 * a3 * K3 + (a1 - a3) * Omega3, a2 * a3 * K3 + (a2 - a3) * Omega3


def _preserved(twist: float) -> Residual:
    """Of how many of the six points (4.4) it is wrong that those with γ₃ = ±1 stay, and only they.

    Twisted, with K along e₁.
    """
    wrong = 0
    for n in balls():
        n = n if twist == 1 else f.with_A(tuple(n.moments), n.Omega, n.K[::-1])
        for i, gamma in enumerate(f.E):
            stays = np.linalg.norm(f.from_rest(n)(gamma)) < 1e-14
            wrong += 2 * int(stays != (i == 2))
    return Residual(wrong, bound=0, unit="of 1200 wrong")


# Near Γ₅ and Γ₆ ------------------------------------------------------------------------------


def _taylor(n: Numbers, top: float) -> Array:
    """Coefficients (2, 3, 3) of γ₁ⁱγ₂ʲ in dγ₁/dt and dγ₂/dt where γ₃ = top √(1 - γ₁² - γ₂²).

    By Cauchy's integrals: the mean over circles of complex γ₁ and γ₂.
    """
    count, radius = 16, 0.05
    circle = radius * np.exp(2j * np.pi * np.arange(count) / count)
    field = f.from_rest(n)
    values = np.array(
        [
            [field(np.array([x, y, top * sqrt(1 - x * x - y * y)]))[:2] for y in circle]
            for x in circle
        ]
    )
    powers = radius ** np.add.outer(np.arange(3), np.arange(3))
    return np.moveaxis(np.fft.fft2(values, axes=(0, 1))[:3, :3] / count**2, 2, 0).real / powers


def _expansion(n: Numbers, top: float, twist: float = 1.0, printed: bool = False) -> Array:
    """Prop. 2's dγ₁/dt and dγ₂/dt to second order (2, 3, 3); its quadratic signs turn with γ₃."""
    (a1, a2, a3), (Omega1, Omega2, _) = n.moments, n.Omega
    A1, A2 = _A1_A2(n)
    terms = np.zeros((2, 3, 3))
    terms[0, 0, 1] = -A2 / a3
    terms[0, 1, 1], terms[0, 0, 2] = -(a2 - a3) * Omega1 / a3, -(a2 - a3) * Omega2 / a3
    if printed:
        terms[1, 0, 1] = A1 / a3
        terms[1, 1, 1], terms[1, 2, 0] = (a1 - a3) * Omega1 / a3, (a1 - a3) * Omega2 / a3
    else:
        terms[1, 1, 0] = A1 / a3
        terms[1, 1, 1], terms[1, 2, 0] = (a1 - a3) * Omega2 / a3, (a1 - a3) * Omega1 / a3
    terms[:, [1, 0, 2], [1, 2, 0]] *= top * twist
    return terms


_SECOND_ORDER = np.add.outer(np.arange(3), np.arange(3)) <= 2


def _off_expansion(component: int, top: float, twist: float, printed: bool = False) -> float:
    """The largest difference of a component's expansion from Taylor's, over 20 balls."""
    return max(
        float(
            np.abs(
                (_taylor(n, top) - _expansion(n, top, twist, printed))[component][_SECOND_ORDER]
            ).max()
        )
        for n in balls()[:20]
    )


def _first_component(twist: float) -> Residual:
    """dγ₁/dt = -A₂γ₂/a₃ - (a₂-a₃)(Ω₁γ₁γ₂ + Ω₂γ₂²)/a₃ at Γ₅."""
    return Residual(_off_expansion(0, 1.0, twist), bound=2e-14, unit="1/s")


def _second_component(twist: float) -> Residual:
    """dγ₂/dt = A₁γ₁/a₃ + (a₁-a₃)(Ω₂γ₁γ₂ + Ω₁γ₁²)/a₃ at Γ₅, and as printed."""
    return Residual(
        _off_expansion(1, 1.0, twist),
        bound=2e-14,
        printed=_off_expansion(1, 1.0, 1.0, printed=True),
        unit="1/s",
    )


def _signs_at_6(twist: float) -> Residual:
    """Both at Γ₆, where the quadratic terms have the other sign, and with those printed for Γ₆."""
    corrected = max(_off_expansion(i, -1.0, twist) for i in (0, 1))
    printed = max(_off_expansion(i, -1.0, -1.0) for i in (0, 1))
    return Residual(corrected, bound=2e-14, printed=printed, unit="1/s")


def kinds(twist: float) -> Residual:
    """Of how many balls the eigenvalues at Γ₅ are not real of other signs iff A₁A₂ < 0, else
    imaginary.
    """
    wrong = 0
    for n in balls():
        values = f.eigenvalues(f.from_rest(n), f.E[2])
        A1, A2 = _A1_A2(n)
        saddle = values[0].real < 0 < values[1].real and abs(values.imag).max() == 0
        centre = abs(values.real).max() < 1e-12 * abs(values.imag).max()
        wrong += not (saddle if twist * A1 * A2 < 0 else centre)
    return Residual(wrong, bound=0, unit="of 200 wrong")


@dataclass(frozen=True)
class _Focus:
    """A ball with A₁A₂ > 0, and by how much r grows in a turn about Γ₅ from r = 0.01."""

    n: Numbers
    growth: float

    def criterion(self, twist: float = 1.0) -> float:
        """B/A₁, with B = Ω₁Ω₂((a₂-a₃)²A₁² - (a₁-a₃)²A₂²); twisted, with another sign in it."""
        (a1, a2, a3), (Omega1, Omega2, _) = self.n.moments, self.n.Omega
        A1, A2 = _A1_A2(self.n)
        B = Omega1 * Omega2 * ((a2 - a3) ** 2 * A1**2 - twist * (a1 - a3) ** 2 * A2**2)
        return float(B / A1)


@cache
def _foci() -> tuple[_Focus, ...]:
    """Those of 100 balls with A₁A₂ > 0.01 whose r changes by over 1e-10, by scipy."""
    found = []
    for n in balls()[:100]:
        A1, A2 = _A1_A2(n)
        growth = growth_in_a_turn(n, 0.01) if A1 * A2 > 0.01 else 0.0
        if abs(growth) > 1e-10:
            found.append(_Focus(n, growth))
    return tuple(found)


def growth_in_a_turn(n: Numbers, r: float) -> float:
    """r of the next crossing of γ₂ = 0 on the same side, less r."""
    field = f.from_rest(n)
    start = np.array([r, 0.0, sqrt(1 - r * r)])
    # In a little more than the period of the linear part.
    A1, A2 = _A1_A2(n)
    duration = 1.1 * 2 * np.pi * n.moments[2] / sqrt(A1 * A2)
    side = np.sign(field(start)[1]) * f.E[1]
    passed = f.returns(field, start, side, duration, rtol=1e-13)
    return float(passed[0][0] - r) if len(passed) else 0.0


def wrong(criterion: Callable[[_Focus], float]) -> int:
    """How many of the foci shrink in a turn where it is not negative, or the other way round."""
    return sum((criterion(each) < 0) != (each.growth < 0) for each in _foci())


def _stable_foci(twist: float) -> Residual:
    """The focus is stable iff B/A₁ < 0, and > 0 as printed."""
    corrected = wrong(lambda each: twist * each.criterion())
    printed = wrong(lambda each: -each.criterion())
    return Residual(corrected, 0, printed, unit=f"of {len(_foci())} wrong")


def _B_of_the_foci(twist: float) -> Residual:
    """With B as corrected, and with the factor K₃ as printed."""
    corrected = wrong(lambda each: each.criterion(twist))
    printed = wrong(lambda each: each.n.K[2] * each.criterion())
    return Residual(corrected, 0, printed, unit=f"of {len(_foci())} wrong")


def _scaled(twist: float) -> Residual:
    """x' and y' in γ₁ = √(A₁A₂)x/A₁, γ₂ = y, t = a₃τ/√(A₁A₂), beside Taylor's at Γ₅."""
    worst = 0.0
    for focus in _foci()[:20]:
        n = focus.n
        (a1, a2, a3), (Omega1, Omega2, _) = n.moments, n.Omega
        A1, A2 = _A1_A2(n)
        root = sqrt(A1 * A2)
        terms = np.zeros((2, 3, 3))
        terms[0, 0, 1], terms[1, 1, 0] = -1.0, 1.0
        terms[0, 1, 1], terms[0, 0, 2] = -(a2 - a3) * Omega1 / root, -(a2 - a3) * Omega2 / A2
        terms[1, 1, 1] = (a1 - a3) * Omega2 / A1
        terms[1, 2, 0] = twist * (a1 - a3) * Omega1 * A2 / (root * A1)
        # x = γ₁A₁/root, so γ₁ⁱ brings (root/A₁)ⁱ.
        found = _taylor(n, 1.0) * (root / A1) ** np.arange(3)[:, None] * a3 / root
        found[0] *= A1 / root
        worst = max(worst, float(np.abs(found - terms)[:, _SECOND_ORDER].max()))
    return Residual(worst, bound=2e-14)


def _no_circle(twist: float) -> AtLeast:
    """The fastest dγ/dt of (4.1) on (Ω,γ) = 0 for Fig. 6; twisted, without K₃."""
    n = FIG6 if twist == 1 else CAPTIONS["fig05b"].n
    first, second = f.across(n.Omega / np.linalg.norm(n.Omega))
    angles = np.linspace(0.0, 2 * np.pi, 100)
    rates = [f.from_rest(n)(np.cos(x) * first + np.sin(x) * second) for x in angles]
    return AtLeast(float(np.linalg.norm(rates, axis=1).max()), bound=0.05, unit="1/s")


CLAIMS = (
    Claim("(4.6)", "K = (0, 0, K₃): of (4.4) only Γ₅,₆ stay", _preserved, "(4.1)", "K along e₁"),
    Claim("Prop. 2", "A₁A₂ < 0: a saddle; > 0: a weak focus", kinds, "eigenvalues", "sign of A₁A₂"),
    Claim(
        "E6, Prop. 2",
        "the focus is stable iff B/A₁ < 0",
        _stable_foci,
        "a turn about Γ₅ by scipy",
        "the sign of B/A₁",
        printed="stable if B/A₁ > 0",
    ),
    Claim(
        "E7, Prop. 2",
        "B = Ω₁Ω₂((a₂-a₃)²A₁² - (a₁-a₃)²A₂²)",
        _B_of_the_foci,
        "a turn about Γ₅ by scipy",
        "the sign in B",
        printed="B = K₃Ω₁Ω₂(…)",
    ),
    Claim(
        "Prop. 2",
        "dγ₁/dt = -A₂γ₂/a₃ - … at Γ₅",
        _first_component,
        "Cauchy's integrals",
        "the quadratic signs",
    ),
    Claim(
        "E8, Prop. 2",
        "dγ₂/dt = (A₁γ₁ + (a₁-a₃)(Ω₂γ₁γ₂ + Ω₁γ₁²))/a₃",
        _second_component,
        "Cauchy's integrals",
        "the quadratic signs",
        printed="A₁γ₂ + (a₁-a₃)(Ω₁γ₁γ₂ + Ω₂γ₁²)",
    ),
    Claim(
        "E9, Prop. 2",
        "at Γ₆ the quadratic signs are the other ones",
        _signs_at_6,
        "Cauchy's integrals",
        "the quadratic signs",
        printed="Γ₅'s signs, for Γ₆",
    ),
    Claim("Prop. 2", "x' and y', scaled", _scaled, "Cauchy's integrals", "the sign of x² in y'"),
    Claim("4.2", "K₃ ≠ 0: (Ω,γ) = 0 is no circle of fixed points", _no_circle, "(4.1)", "K₃ = 0"),
)

"""Section 4.2, motion from rest with K = (0, 0, K₃): Γ₅,₆ and Prop. 2, Δ and Θ, Figs 6 to 8."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial

import numpy as np
from numpy import arcsin, arctan2, pi, sqrt
from scipy.optimize import brentq

from robotball.qualitative import equilibria
from robotball.qualitative.cycles import Cycle
from robotball.qualitative.portraits import limit_cycles
from robotball.rotations import Array, tangents
from tests.paper import formulas as f
from tests.paper.captions import CAPTIONS, claim_axes, claim_motion
from tests.paper.claim import MINUS, AtLeast, Errors, Section, by
from tests.paper.formulas import Numbers, paper_scene

SECTION = Section("4.2. K ≠ 0")
claim = SECTION.claim

_FIG6 = CAPTIONS["fig06"].n
_PRINTED_SECOND = "A₁γ₂ + (a₁-a₃)(Ω₁γ₁γ₂ + Ω₂γ₁²)"
_DELTA, _THETA = 1, 0  # the index j of the γⱼ that is not zero, beside γ₃


@cache
def balls() -> tuple[Numbers, ...]:
    """Return random balls with K = (0, 0, K₃); |Ω₃| < 1, so that the arcsin of E10 exists."""
    random = np.random.default_rng(51)
    found = []
    for _ in range(200):
        # Of either sign: with K₃ > 0 alone, as in the figures, the factor K₃ of E7 would change
        # nothing.
        A, K3 = random.uniform(0.2, 1.0, 3), random.uniform(-3.0, 3.0)
        Omega = random.uniform(-1.0, 1.0, 3) * [4.0, 4.0, 1.0]
        found.append(f.with_A(tuple(A), Omega, np.array([0.0, 0.0, K3])))
    return tuple(found)


def _A1_A2(n: Numbers) -> tuple[float, float]:
    """Return a₁a₃K₃ + (a₁ - a₃)Ω₃ and a₂a₃K₃ + (a₂ - a₃)Ω₃ of Prop. 2."""
    (a1, a2, a3), K3, Omega3 = n.moments, n.K[2], n.Omega[2]
    return a1 * a3 * K3 + (a1 - a3) * Omega3, a2 * a3 * K3 + (a2 - a3) * Omega3


@claim("(4.6)", "K = (0, 0, K₃): of (4.4) only Γ₅,₆ stay")
@by("(4.1)", "K along e₁", {"along": 0}, bound=0, unit="of 1200 wrong")
def _preserved(along: int = 2) -> Errors:
    """Count the points of (4.4) that stay though γ₃ ≠ ±1, or do not stay though γ₃ = ±1.

    along: the axis along which K is.
    """
    for n in balls():
        n = f.with_A(tuple(n.moments), n.Omega, n.K[2] * f.E[along])
        for i, gamma in enumerate(f.E):
            stays = np.linalg.norm(f.from_rest(n)(gamma)) < 1e-14
            yield 2 * int(stays != (i == 2))


# Near Γ₅ and Γ₆ ------------------------------------------------------------------------------


@claim("Prop. 2", "A₁A₂ < 0: a saddle; > 0: a weak focus")
@by("eigenvalues", "sign of A₁A₂", bound=0, unit="of 200 wrong")
def kinds(twist: float = 1.0) -> Errors:
    """Count the balls whose eigenvalues at Γ₅ are not as Prop. 2 says.

    It says real of other signs if A₁A₂ < 0, else imaginary.
    """
    for n in balls():
        values = f.eigenvalues(f.from_rest(n), f.E[2])
        A1, A2 = _A1_A2(n)
        saddle = values[0].real < 0 < values[1].real and abs(values.imag).max() == 0
        # Linear terms leave a focus undecided: the real parts are zero but for rounding.
        centre = abs(values.real).max() < 1e-12 * abs(values.imag).max()
        yield not (saddle if twist * A1 * A2 < 0 else centre)


def _criterion(n: Numbers, twist: float = 1.0) -> float:
    """Return B/A₁, with B = Ω₁Ω₂((a₂-a₃)²A₁² - (a₁-a₃)²A₂²).

    Twisted, with another sign in it.
    """
    (a1, a2, a3), (Omega1, Omega2, _) = n.moments, n.Omega
    A1, A2 = _A1_A2(n)
    B = Omega1 * Omega2 * ((a2 - a3) ** 2 * A1**2 - twist * (a1 - a3) ** 2 * A2**2)
    return float(B / A1)


@cache
def foci() -> tuple[tuple[Numbers, float], ...]:
    """Return balls with A₁A₂ > 0.01, and by how much r grows in a turn about Γ₅ from r = 0.01.

    They are those of 100 in which it changes by over 1e-10.
    """
    found = []
    for n in balls()[:100]:
        A1, A2 = _A1_A2(n)
        # Near A₁A₂ = 0 a turn takes for ever; and where r changes by less than 1e-10, the
        # integration's error could decide the sign.
        growth = growth_in_a_turn(n, 0.01) if A1 * A2 > 0.01 else 0.0
        if abs(growth) > 1e-10:
            found.append((n, growth))
    return tuple(found)


def growth_in_a_turn(n: Numbers, r: float) -> float:
    """Return r of the next crossing of γ₂ = 0 on the same side, less r."""
    field = f.from_rest(n)
    start = np.array([r, 0.0, sqrt(1 - r * r)])
    # In a little more than the period of the linear part.
    A1, A2 = _A1_A2(n)
    duration = 1.1 * 2 * np.pi * n.moments[2] / sqrt(A1 * A2)
    # On the far side γ₂ passes zero the other way.
    side = np.sign(field(start)[1]) * f.E[1]
    passed = f.returns(field, start, side, duration, rtol=1e-13)
    return float(passed[0][0] - r) if len(passed) else 0.0


# Of the 100 balls 84 are foci that turn.
_by_a_turn = partial(by, "a turn about Γ₅ by scipy", bound=0, unit="of 84 wrong")


@claim("E6, Prop. 2", "the focus is stable iff B/A₁ < 0", "stable if B/A₁ > 0")
@_by_a_turn("the sign of B/A₁", printed=MINUS)
def _stable_foci(twist: float = 1.0) -> Errors:
    """Count where B/A₁ < 0 mistakes a focus for stable or unstable, and B/A₁ > 0 as printed."""
    for n, growth in foci():
        ours = equilibria.fixed_point_at(f.ball(n), f.E[2]).kind
        mistaken = ours != f"slow {'stable' if growth < 0 else 'unstable'} focus"
        yield mistaken or (twist * _criterion(n) < 0) != (growth < 0)


@claim("E7, Prop. 2", "B = Ω₁Ω₂((a₂-a₃)²A₁² - (a₁-a₃)²A₂²)", "B = K₃Ω₁Ω₂(…)")
@_by_a_turn("the sign in B", printed={"printed": True})
def _B_of_the_foci(twist: float = 1.0, printed: bool = False) -> Errors:
    """Count the foci mistaken with B as corrected, and with the factor K₃ as printed."""
    for n, growth in foci():
        A1, _, B = equilibria.proposition_2(f.ball(n))
        both = (n.K[2] if printed else 1.0) * _criterion(n, twist), B / A1
        yield any((each < 0) != (growth < 0) for each in both)


def _taylor(n: Numbers, top: float) -> Array:
    """Return coefficients (2, 3, 3) of γ₁ⁱγ₂ʲ in dγ₁/dt and dγ₂/dt where γ₃ = top √(1 - γ₁² - γ₂²).

    By Cauchy's integrals: the mean over circles of complex γ₁ and γ₂.
    """
    # Aliasing is of the order of radius^count, rounding of 1e-16/radius² at second order.
    count, radius = 16, 0.05
    circle = radius * np.exp(2j * np.pi * np.arange(count) / count)
    x, y = np.repeat(circle, count), np.tile(circle, count)
    values = f.from_rest(n)(np.array([x, y, top * sqrt(1 - x * x - y * y)]))[:2]
    # A coefficient of order m is the mean of the values by the circle's phase, over radius^m.
    powers = radius ** np.add.outer(np.arange(3), np.arange(3))
    return np.fft.fft2(values.reshape(2, count, count))[:, :3, :3].real / count**2 / powers


def _expansion(n: Numbers, top: float, twist: float = 1.0, printed: bool = False) -> Array:
    """Return Prop. 2's dγ₁/dt and dγ₂/dt to second order (2, 3, 3).

    The quadratic signs turn with γ₃.
    """
    (a1, a2, a3), (Omega1, Omega2, _) = n.moments, n.Omega
    A1, A2 = _A1_A2(n)
    terms = np.zeros((2, 3, 3))
    terms[0, 0, 1] = -A2 / a3
    terms[0, 1, 1], terms[0, 0, 2] = -(a2 - a3) * Omega1 / a3, -(a2 - a3) * Omega2 / a3
    mixed, square = (Omega1, Omega2) if printed else (Omega2, Omega1)
    terms[(1, 0, 1) if printed else (1, 1, 0)] = A1 / a3
    terms[1, 1, 1], terms[1, 2, 0] = (a1 - a3) * mixed / a3, (a1 - a3) * square / a3
    terms[:, [1, 0, 2], [1, 2, 0]] *= top * twist
    return terms


_SECOND_ORDER = np.add.outer(np.arange(3), np.arange(3)) <= 2
_order_2 = partial(by, "Cauchy's integrals", "the quadratic signs", bound=2e-14, unit="1/s")


@claim("E9, Prop. 2", "at Γ₆ the quadratic signs are the other ones", "Γ₅'s signs, for Γ₆")
@_order_2(printed=MINUS, top=-1.0)
@claim("E8, Prop. 2", "dγ₂/dt = (A₁γ₁ + (a₁-a₃)(Ω₂γ₁γ₂ + Ω₁γ₁²))/a₃", _PRINTED_SECOND)
@_order_2(printed={"printed": True}, components=[1])
@claim("Prop. 2", "dγ₁/dt = -A₂γ₂/a₃ - … at Γ₅")
@_order_2(components=[0])
def _components(
    twist: float = 1.0, components: Sequence[int] = (0, 1), top: float = 1.0, printed: bool = False
) -> Errors:
    """Compare dγ₁/dt and dγ₂/dt at Γ₅ (top = 1) or Γ₆ (-1), for 20 balls, with Taylor's.

    dγ₁/dt = -A₂γ₂/a₃ - (a₂-a₃)(Ω₁γ₁γ₂ + Ω₂γ₂²)/a₃, and of dγ₂/dt what is printed, too.
    """
    for n in balls()[:20]:
        off = _taylor(n, top) - _expansion(n, top, twist, printed)
        yield off[list(components)][:, _SECOND_ORDER]


@claim("Prop. 2", "x' and y', scaled")
@by("Cauchy's integrals", "the sign of x² in y'", bound=2e-14)
def _scaled(twist: float = 1.0) -> Errors:
    """Compare x' and y' in γ₁ = √(A₁A₂)x/A₁, γ₂ = y, t = a₃τ/√(A₁A₂) with Taylor's at Γ₅."""
    for n, _ in foci()[:20]:
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
        yield (found - terms)[:, _SECOND_ORDER]


@claim("4.2", "K₃ ≠ 0: (Ω,γ) = 0 is no circle of fixed points")
@by("(4.1)", "K₃ = 0", {"name": "fig05b"})
def _no_circle(name: str = "fig06") -> AtLeast:
    """Compute the fastest dγ/dt of (4.1) on (Ω,γ) = 0 for a figure."""
    n = CAPTIONS[name].n
    rates = f.from_rest(n)(f.sigma(n, np.linspace(0.0, 2 * np.pi, 100)).T)
    return AtLeast(float(np.linalg.norm(rates, axis=0).max()), bound=0.05, unit="1/s")


# Δ and Θ ------------------------------------------------------------------------------------


def _with_K3(K3: float) -> Numbers:
    """Return the ball of Figs 6 to 8 with another K₃."""
    return replace(_FIG6, K=np.array([0.0, 0.0, K3]))


def _kappa(n: Numbers, j: int, twist: float = 1.0) -> float:
    """Return κ₁ (j = 1) or κ₂ (j = 0)."""
    a, a3, Omega3 = n.moments[j], n.moments[2], n.Omega[2]
    root = sqrt(n.Omega[j] ** 2 + Omega3**2)
    return float(((a - a3) * Omega3 + twist * 2 * a * a3 * n.K[2]) / (root * (a3 - a)))


def _nu(n: Numbers, j: int) -> float:
    """Return ν₁ or ν₂ by E10: atan2(Ω₃, Ωⱼ)."""
    return float(arctan2(n.Omega[2], n.Omega[j]))


def _printed_nu(n: Numbers, j: int) -> float:
    """Return arcsin(Ω₃²/√(Ωⱼ² + Ω₃²))."""
    return float(arcsin(n.Omega[2] ** 2 / sqrt(n.Omega[j] ** 2 + n.Omega[2] ** 2)))


def _angles(arc: float, shift: float) -> list[float]:
    """Return φ of δ₁ to δ₄ or θ₁ to θ₄, with E11, where arc = arcsin κ and shift = ν."""
    one, other = (arc - shift) / 2, -(arc + shift) / 2
    return [one, one + pi, other + pi / 2, other + 3 * pi / 2]


def _point(j: int, phi: float) -> Array:
    """Return γⱼ = sin φ, γ₃ = cos φ."""
    gamma = np.zeros(3)
    gamma[j], gamma[2] = np.sin(phi), np.cos(phi)
    return gamma


def _speed(n: Numbers, j: int, phi: float) -> float:
    """Return |dγ/dt| of (4.1)."""
    return float(np.linalg.norm(f.from_rest(n)(_point(j, phi))))


_standing = partial(
    by, "(4.1)", "the sign of K₃", bound=3e-14, unit="1/s", printed={"nu": _printed_nu}
)


@claim("E10, 4.2", "Θ: φ by κ₂ and ν₂ = atan2(Ω₃, Ω₁)", "ν₂ = arcsin(Ω₃²/√(Ω₁² + Ω₃²))")
@_standing(j=_THETA)
@claim("E10, 4.2", "Δ: φ by κ₁ and ν₁ = atan2(Ω₃, Ω₂)", "ν₁ = arcsin(Ω₃²/√(Ω₂² + Ω₃²))")
@_standing(j=_DELTA)
def _at_rest(j: int, twist: float = 1.0, nu: Callable[[Numbers, int], float] = _nu) -> Errors:
    """Compute dγ/dt at δ₁…δ₄, or θ₁…θ₄, of random balls, with ν as printed too."""
    for n in balls():
        k = _kappa(n, j, twist)
        if abs(_kappa(n, j)) < 1 and abs(k) < 1:
            yield [_speed(n, j, phi) for phi in _angles(arcsin(k), nu(n, j))]
            ours = equilibria.closed_form_points(f.ball(n))
            yield [f.from_rest(n)(ours["θδ"[j] + index]) for index in "₁₂₃₄"]


@claim("E11, 4.2", "θ₃: φ = -(arcsin κ₂ + ν₂)/2 + π/2", "φ = -(arcsin κ₂ + ν₂)/2 π")
@by("(4.1)", "π/2, by a half", {"twist": 0.5}, bound=3e-14, unit="1/s", printed={"printed": True})
def _theta_3(twist: float = 1.0, printed: bool = False) -> Errors:
    """Compute dγ/dt at θ₃, for -(arcsin κ₂ + ν₂)/2 + π/2, and times π as printed."""
    for n in balls():
        if abs(_kappa(n, _THETA)) < 1:
            half = -(arcsin(_kappa(n, _THETA)) + _nu(n, _THETA)) / 2
            yield _speed(n, _THETA, half * pi if printed else half + twist * pi / 2)


# Figs 6 to 8 -------------------------------------------------------------------------------


def _named(n: Numbers = _FIG6) -> dict[str, Array]:
    """Return the fixed points of Fig. 6 by their names."""
    found = {"Γ₅": f.E[2], "Γ₆": -f.E[2]}
    for letter, j in (("δ", _DELTA), ("θ", _THETA)):
        for index, phi in zip("₁₂₃₄", _angles(arcsin(_kappa(n, j)), _nu(n, j)), strict=True):
            found[letter + index] = _point(j, phi)
    return found


@cache
def _number(K3: float, starts: int = 150) -> int:
    """Return the number of fixed points of (4.1) at K₃, searched for from so many points."""
    return len(f.zeros(f.from_rest(_with_K3(K3)), starts))


@claim("4.2", "Δ exist iff |κ₁| < 1, Θ iff |κ₂| < 1")
@by("search", "the sign of K₃", bound=0, unit="of 8 wrong")
def _existence(twist: float = 1.0) -> Errors:
    """Count the K₃ with another number of fixed points than 2 + 4[|κ₁| < 1] + 4[|κ₂| < 1]."""
    for K3 in (-3.0, -1.2, -0.5, -0.1, 0.2, 0.5, 1.0, 2.5):
        # A search, as the formulas for φ are the claim: the count must come from elsewhere.
        kappas = [_kappa(_with_K3(K3), j, twist) for j in (_DELTA, _THETA)]
        yield _number(K3) != 2 + 4 * sum(abs(kappa) < 1 for kappa in kappas)


@claim(
    "E12, 4.2",
    "|κ₂| < |κ₁| < 1: 10 points; |κ₂| < 1 < |κ₁|: 6; 1 < |κ₂| < |κ₁|: 2",
    "0 < κ₂ < κ₁ < 1; κ₂ < 1 < κ₁; 1 < κ₂ < κ₁",
)
@by("search, Figs 6-8", "the sign of K₃", bound=0, unit="of 3 wrong", printed={"size": float})
def _cases(twist: float = 1.0, size: Callable[[float], float] = abs) -> Errors:
    """Count the figures where the condition that holds, if any, gives another number of points.

    Than a search finds; as printed, κ have their signs, and none holds.
    """
    for K3 in (0.3, 0.52, 3.0):
        kappa_1, kappa_2 = (size(_kappa(_with_K3(K3), j, twist)) for j in (_DELTA, _THETA))
        cases = {10: 0 < kappa_2 < kappa_1 < 1, 6: kappa_2 < 1 < kappa_1, 2: 1 < kappa_2 < kappa_1}
        yield [number for number, holds in cases.items() if holds] != [_number(K3)]


def kind(n: Numbers, gamma: Array) -> str:
    """Return the type of a fixed point by its eigenvalues, of a weak focus by a turn about it."""
    values = f.eigenvalues(f.from_rest(n), gamma)
    if abs(values.imag).max() == 0:
        if values[0].real * values[1].real < 0:
            return "saddle"
        return "stable node" if values[1].real < 0 else "unstable node"
    if abs(values.real).max() < 1e-12:
        return "slow stable focus" if growth_in_a_turn(n, 0.01) < 0 else "slow unstable focus"
    return "stable focus" if values[1].real < 0 else "unstable focus"


_KINDS = {
    "saddle": ("θ₁", "θ₂", "δ₃", "δ₄"),
    "stable focus": ("θ₃", "θ₄"),
    "unstable node": ("δ₁", "δ₂"),
    "slow stable focus": ("Γ₅", "Γ₆"),
}


@claim("Fig. 6", "saddles θ₁,₂ δ₃,₄; foci θ₃,₄ Γ₅,₆; nodes δ₁,₂")
@by("search, eigenvalues", "δ, θ", {"names": "θδ"}, bound=0, unit="of 10 off")
def _types(names: str = "δθ") -> Errors:
    """Count the points of Fig. 6 that are of another type, or not found by a search; and ours."""
    found, points = f.zeros(f.from_rest(_FIG6)), equilibria.fixed_points(f.ball(_FIG6))
    exchanged = str.maketrans("δθ", names)
    yield len(found) - 10
    for name, at in _named().items():
        seen = min(np.linalg.norm(at - other) for other in found) < 1e-9
        type_ = kind(_FIG6, at)
        ours = [p.kind for p in points if np.linalg.norm(at - p.gamma) < 1e-9]
        same = ours == [type_] and equilibria.name_of(f.ball(_FIG6), at) == name
        yield not (seen and same and name.translate(exchanged) in _KINDS.get(type_, ()))


_BOTH = {"senses": (-1.0, 1.0)}


@claim(
    "Fig. 6", "stable manifolds of δ₃,₄ and δ₁,₂: a closed contour", "unstable and stable manifolds"
)
@by("(4.1) by scipy", "unstable for stable", bound=0, unit="of 4, 8 off", printed=_BOTH)
def _contour(twist: float = 1.0, senses: Sequence[float] = (-1.0,)) -> Errors:
    """Count the branches of the saddles δ₃ and δ₄ that do not end at the nodes δ₁ and δ₂.

    The stable manifolds, followed back; as printed the unstable ones too; twisted, those alone.
    """
    for sense in senses:
        yield _branches_off(twist * sense)


@cache
def _branches_off(sense: float) -> int:
    """Count the branches that leave δ₃ and δ₄ in a sense of time and end elsewhere, of four."""
    field, points, off = f.from_rest(_FIG6), _named(), 0
    for saddle in (points["δ₃"], points["δ₄"]):
        basis = tangents(saddle)
        values, vectors = np.linalg.eig(basis @ f.jacobian(field, saddle) @ basis.T)
        leaving = basis.T @ vectors[:, np.argmax(sense * values.real)].real
        for side in (1e-5, -1e-5):
            # Near enough for the linear direction to hold to 1e-10, and far enough to leave soon.
            start = saddle + side * leaving
            times = np.array([0.0, 300.0])
            end = f.followed(lambda x: sense * field(x), start, times, rtol=1e-9)[-1]
            off += bool(min(np.linalg.norm(end - points[node]) for node in ("δ₁", "δ₂")) > 1e-5)
    return off


@cache
def cycle(name: str) -> Cycle | None:
    """Return the only limit cycle of Fig. 6, 7 or 8, if there is one."""
    longest = 12.0 if name == "fig08" else 120.0  # s: twice the periods
    found = limit_cycles(paper_scene(name).parameters, longest, starts=16)
    return found[0] if len(found) == 1 else None


def _unstable_cycle(name: str) -> AtLeast:
    """Measure the growth of a neighbour's distance in a period of (4.1), if that closes.

    By its divergence on the sphere, followed back in time, in which the cycle attracts; NaN unless
    robotball's multiplier is the same.
    """
    found = cycle(name)
    if found is None:
        return AtLeast(float("nan"), bound=1.01)
    field = f.from_rest(CAPTIONS[name].n)
    # Forward in time any error would leave an unstable cycle by the growth that is measured.
    path = f.followed(lambda x: -field(x), found.gamma, np.linspace(0.0, found.period, 4001))
    # The divergence on the sphere is the trace less the part along γ.
    J = f.jacobian(field, path[1:].T)
    rates = np.trace(J, axis1=1, axis2=2) - np.einsum("ni,nij,nj->n", path[1:], J, path[1:])
    growth = float(np.exp(found.period * np.mean(rates)))
    same = np.linalg.norm(path[-1] - found.gamma) < 1e-8
    same = same and abs(found.multipliers[0] / growth - 1) < 1e-6
    return AtLeast(growth if same else float("nan"), bound=1.01)


def _vanishing(j: int, K3: float, more: int, twist: float = 1.0) -> Errors:
    """Count how far the numbers of fixed points beside the K₃ where |κⱼ| = 1 are off."""
    # The formula says where; the search on both sides says whether points vanish there.
    at = brentq(lambda x: abs(_kappa(_with_K3(x), j, twist)) - 1, K3 / 2, 2 * K3)
    yield from four_fewer(at, 0.01, more, 150)


def four_fewer(K3: float, side: float, more: int, starts: int) -> Errors:
    """Count how far the numbers of fixed points beside K₃ are from `more` below, 4 less above.

    side: how far from K₃ they are searched for, from `starts` points.
    """
    yield _number(K3 - side, starts) - more
    yield _number(K3 + side, starts) - more + 4


def _early_cycle(K3: float = 0.51, cycles: int = 1) -> Errors:
    """Count how far the numbers of cycles and of fixed points are off at K₃, below |κ₁| = 1.

    At K₃ = 0.5 the saddles' manifolds have not joined yet.
    """
    yield len(limit_cycles(f.ball(_with_K3(K3)), 100.0, starts=4)) - cycles  # its period is 82 s
    yield _number(K3, 150) - 10


_vanishes = partial(by, "search", "the factor of K₃", {"twist": 0.9}, bound=0, unit="points off")
_grows = partial(by, "(4.1) by scipy", "K₃ of Fig. 6", {"name": "fig06"})

claim_axes(SECTION, "fig06")
claim_motion(SECTION, "fig06", 6e-6)
claim("4.2", "Δ disappears where |κ₁| = 1")(_vanishes(j=_DELTA, K3=0.5, more=10)(_vanishing))
claim("4.2", "its cycle is there before Δ disappears", "it arises where Δ disappears")(
    by("search", "K₃ = 0.5", {"K3": 0.5}, bound=0, unit="cycles off", printed={"cycles": 0})(
        _early_cycle
    )
)
claim("Fig. 7", "an unstable limit cycle: growth in a period")(
    _grows(name="fig07")(_unstable_cycle)
)
claim_axes(SECTION, "fig07")
claim_motion(SECTION, "fig07", 4e-6)
claim("4.2", "Θ disappears where |κ₂| = 1")(_vanishes(j=_THETA, K3=2.0, more=6)(_vanishing))
claim("Fig. 8", "an unstable limit cycle: growth in a period")(
    _grows(name="fig08")(_unstable_cycle)
)
claim_axes(SECTION, "fig08")
claim_motion(SECTION, "fig08", 7e-7)
SECTION.unchecked(
    "4.2", "a classification of the portraits", "open, the paper says; a study of its own"
)

"""Sections 4 and 4.1: motion from rest of the rubber model, and with K = 0.

For K = 0: the fixed points, the circle Σ¹ of them, where motions end, and Fig. 5.
"""

from dataclasses import replace
from functools import cache, partial
from itertools import pairwise
from typing import Any

import numpy as np
from numpy import sqrt
from scipy.integrate import cumulative_simpson
from scipy.optimize import brentq
from scipy.special import ellipj

from robotball.equations import as_vector
from robotball.qualitative import equilibria
from robotball.rotations import Array, tangents
from tests.paper import formulas as f
from tests.paper.captions import CAPTIONS, claim_motion, orthonormal
from tests.paper.claim import Errors, Section, by
from tests.paper.engine_ball import INNER, MOTION, Seen, largest, rate, seen, seen_from
from tests.paper.formulas import Numbers, cross
from tests.paper.point_masses import MASSES, moments
from tests.paper.test_section_3_momentum import MOMENTUM

SECTION = Section("4. Motion from rest")
SECTION_4_1 = Section("4.1. K = 0")

_SPIN_UP = "spin_up_from_rest"


@SECTION.claim("4", "from rest M stays 0 as Ω and K grow")
@by(MOTION, "γ× of (3.1)", {"classical": True}, bound=2e-7, unit=MOMENTUM)
def _stays_at_rest(classical: bool = False) -> Errors:
    """Compute |M| of MuJoCo's bodies, while Ω and K ramp up from 0; or of the classical M."""
    ball = seen(_SPIN_UP)
    M = ball.momentum
    if classical:
        M = ball.of(lambda n, omega, gamma: f.contact_inertia(n, gamma) @ omega + n.K)
    yield largest(M)


@SECTION.claim("(4.1)", "dγ/dt = γ×A(Zγ - K)")
@by(MOTION, "the sign of K", bound=2e-7, unit="1/s")
def _field_on_the_sphere(twist: float = 1.0) -> Errors:
    """Compare dγ/dt, by differences of MuJoCo's γ, with (4.1)."""
    ball = seen("fig06")
    found = ball.of(lambda n, _, gamma: f.from_rest(replace(n, K=twist * n.K))(gamma))
    ours = ball.of(lambda n, _, gamma: np.array(equilibria.flow(f.ball(n), as_vector(gamma))))
    for each in (found, ours):
        yield largest(rate(ball.gamma) - each[INNER])


@SECTION.claim("(4.2)", "dα/dt, dβ/dt, Ẋ and Ẏ")
@by(MOTION, "the sign of K", bound=2e-7, unit="1/s, m/s")
def _path_from_rest(twist: float = 1.0) -> Errors:
    """Compare dα/dt, dβ/dt, Ẋ, Ẏ of (4.2), ω = A(Zγ - K), with differences of MuJoCo's motion."""
    ball = seen("fig06")

    def velocity(n: Numbers, _: Array, gamma: Array) -> Array:
        Z = (n.Omega + n.A @ n.K) @ gamma / (n.A @ gamma @ gamma)
        return n.A @ (Z * gamma - twist * n.K)

    omega, (alpha, beta, _) = ball.of(velocity), ball.axes.transpose(1, 0, 2)
    shell = ball.numbers[0].a * (omega - ball.numbers[0].Omega)
    yield ball.path_error((beta * shell).sum(axis=1), -(alpha * shell).sum(axis=1))
    for axis in (alpha, beta):
        yield largest(rate(axis) - np.cross(axis, omega)[INNER])


SECTION.unchecked("4", "(4.1) has no chaos", "a theorem: two dimensions have none")


# Ω = 0 -------------------------------------------------------------------------------------


def _gyrostats(seed: int) -> list[tuple[Numbers, Array]]:
    """Return five random balls with Ω = 0, and a γ each."""
    zero = np.zeros(3)
    return [
        (replace(f.still(each.n), Omega=zero, K=2 * each.n.K), each.gamma)
        for each in f.states(seed, 5)
    ]


@cache
def _paths() -> list[tuple[Numbers, Array]]:
    """Return balls with Ω = 0, and γ (41, 3) of each over 20 s from rest.

    By (2.4), not by (4.1) from which the paper derives the integral: else a wrong (4.1) and its own
    integral would agree.
    """
    found, times = [], np.linspace(0.0, 20.0, 41)
    for n, gamma in _gyrostats(41):
        start = np.append(f.rubber_velocity(n, np.zeros(3), gamma), gamma)
        path = f.followed(f.unreduced(n, rubber=True), start, times, rtol=1e-10)
        found.append((n, path[:, 3:]))
    return found


@SECTION.claim("4", "Ω = 0: (AK,γ)²/(Aγ,γ) stays")
@by("(2.4)-(2.5) by scipy", "the power of (Aγ,γ)", bound=5e-8)
def _integral_without_turning(twist: float = 1.0) -> Errors:
    """Compute the change of (AK,γ)²/(Aγ,γ) over 20 s by (2.4)-(2.5), which do not use (4.1)."""
    for n, path in _paths():
        kept = (path @ n.A @ n.K) ** 2 / ((path @ n.A * path).sum(axis=1)) ** twist
        yield np.ptp(kept)


@SECTION.claim("4", "Ω = 0: all trajectories are closed")
@by("(4.1) by scipy", "Ω ≠ 0", {"turning": 1.0}, bound=2e-11)
def closed(turning: float = 0.0) -> Errors:
    """Measure how far from its start γ of (4.1) comes back in 60 s, with so many times an Ω."""
    for (n, gamma), other in zip(_gyrostats(42), f.states(43), strict=False):
        n = replace(n, Omega=turning * other.n.Omega)
        field = f.from_rest(n)
        passed = f.returns(field, gamma, field(gamma), 60.0, rtol=1e-11)
        # Without a return it counts as the sphere's diameter, the farthest that γ can be.
        yield np.linalg.norm(passed - gamma, axis=1).min() if len(passed) else 2.0


@SECTION.claim("Remark 6", "γ → -γ is a symmetry")
@by("(4.1) at random γ", "one index", bound=1e-14, unit="1/s")
def _opposite_points(twist: float = 1.0) -> Errors:
    """Compare dγ/dt at -γ with minus that at γ; twisted, at γ with one part reversed."""
    for state in f.states(44):
        field, gamma = f.from_rest(state.n), state.gamma
        image = np.array([-1.0, -twist, -1.0])
        yield field(image * gamma) - image * field(gamma)


_FIG5 = CAPTIONS["fig05b"].n


@SECTION_4_1.claim("4.1", "(Aγ,γ) stays")
@by(MOTION, "the sign of a₃", bound=3e-8)
def integral(twist: float = 1.0) -> Errors:
    """Compute the change of (Aγ,γ) along MuJoCo's motions of Figs 5b and 5c."""
    balls = [seen(name) for name in ("fig05b", "fig05c")]
    kept = [b.of(lambda n, _, g: n.A @ (g * [1.0, 1.0, twist]) @ g) for b in balls]
    yield np.ptp(kept, axis=1)


@SECTION_4_1.claim("Remark 7", "without a rotor K = -(J_s + d)Ω, not 0")
@by(MASSES, "the sign of J_s", bound=4e-15, unit="kg m²/s")
def _needs_momentum(twist: float = 1.0) -> Errors:
    """Compare K of point-mass balls without rotors, from Σ r×mu at ω = 0, with -(J_s + d)Ω."""
    for moment in moments(45, rotors=0):
        ball, n = moment.ball, moment.ball.numbers
        K = ball.momenta(np.zeros(3), np.zeros(3))[1] - n.d * n.Omega
        J_s = twist * ball.shell.moment(ball.shell.axis)
        yield K + (J_s + n.d) * n.Omega


@SECTION_4_1.claim("(4.3)", "in its time γ moves as Euler's top")
@by(MOTION, "dt, upside down", bound=1e-7)
def _euler_case(twist: float = 1.0) -> Errors:
    """Compare MuJoCo's γ of Fig. 5c with Euler's top in the time ∫(Ω,γ)/(Aγ,γ) dt.

    Euler's top is given by Jacobi's functions.

    γ' = γ×Aγ with a₁ > a₂ > a₃ and γ closer to the first axis.
    """
    ball = seen("fig05c")
    # (4.3) is (4.1) in the time whose rate is (Ω,γ)/(Aγ,γ); the samples give it by quadrature.
    pace = ball.of(lambda n, _, g: (n.Omega @ g / (n.A @ g @ g)) ** twist)
    time = cumulative_simpson(pace, x=ball.motion.times, initial=0)
    a1, a2, a3 = _FIG5.moments
    first, _, third = ball.gamma[0]  # γ₂ = 0 at the start: sn = 0
    m = (a2 - a3) * third**2 / ((a1 - a2) * first**2)
    speed = first * sqrt((a1 - a2) * (a1 - a3))
    sn, cn, dn, _ = ellipj(speed * time, m)
    second = third * sqrt((a1 - a3) / (a1 - a2))
    top = np.stack([first * dn, second * sn, third * cn], axis=1)
    yield largest(top - ball.gamma)


# Fixed points --------------------------------------------------------------------------------


def balls(seed: int, count: int = 200) -> list[Numbers]:
    """Return random balls with K = 0 and a₁ < a₂ < a₃, no Ωᵢ zero."""
    random = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        # Prop. 1 numbers the axes by a₁ < a₂ < a₃, and excludes an Ωᵢ of zero.
        A = np.sort(random.uniform(0.2, 1.0, 3))
        Omega = random.uniform(0.2, 3.0, 3) * random.choice([-1, 1], 3)
        found.append(f.with_A(tuple(A), Omega, np.zeros(3)))
    return found


@SECTION_4_1.claim("(4.4)", "six isolated fixed points, ±e₁, ±e₂, ±e₃")
@by("search", "K ≠ 0", {"K3": 0.3}, bound=0, unit="of 30 off")
def _six_points(K3: float = 0.0) -> Errors:
    """Count the zeros of (4.1) with (Ω,γ) ≠ 0 that are not (4.4), and those of (4.4) missing."""
    axes = np.concatenate([f.E, -f.E])
    for n in balls(46, 5):
        n = replace(n, K=K3 * f.E[2])
        # The circle Σ¹ is full of zeros as well, of which the search brings some.
        found = [g for g in f.zeros(f.from_rest(n), 100) if abs(n.Omega @ g) > 1e-6]
        near = sum(bool(np.linalg.norm(axes - g, axis=1).min() < 1e-9) for g in found)
        yield len(found) - near + abs(6 - near)


@SECTION_4_1.claim("Prop. 1", "Γ₃,₄ unstable, Γ₁,₂ and Γ₅,₆ stable")
@by("eigenvalues", "the indices", {"saddle": 0}, bound=0, unit="of 1200 off")
def _stability(saddle: int = 1) -> Errors:
    """Count how many of Γ₁…Γ₆ are not as Prop. 1 has it.

    It has a growing direction at Γ₃,₄; at the others imaginary eigenvalues, and (Aγ,γ) least or
    greatest.
    """
    for n in balls(47):
        for i, gamma in enumerate(f.E):
            values = f.eigenvalues(f.from_rest(n), gamma)
            middle = i == saddle
            extreme = n.moments[i] in (n.moments.min(), n.moments.max())
            # Eigenvalues scale with the rates of a ball, which differ among random ones.
            size = abs(values).max()
            turning = abs(values.real).max() < 1e-9 * size and extreme
            yield 2 * int((values[1].real > 1e-3 * size) != middle or turning == middle)


@cache
def _on_circle(index: int) -> Seen:
    """Roll Fig. 5's ball by MuJoCo, started at Γ₁ or Γ₅ with α = -e₂ or e₂."""
    return seen_from("fig05d", f.E[index], -f.E[1] if index == 0 else f.E[1], np.zeros(3), 10.0)


@SECTION_4_1.claim("Prop. 1", "α and β at Γ₅")
@by(MOTION, "the sign of Ω₃", bound=8e-6)
def _axes_at_5(twist: float = 1.0) -> Errors:
    """Compare α = (sin, cos, 0) and β = (-cos, sin, 0) of Ω₃t + φ₀ at Γ₅ with MuJoCo's."""
    ball = _on_circle(2)
    phase, zero = twist * _FIG5.Omega[2] * ball.motion.times, 0 * ball.motion.times  # φ₀ = 0
    yield largest(np.stack([np.sin(phase), np.cos(phase), zero], axis=1) - ball.axes[:, 0])
    yield largest(np.stack([-np.cos(phase), np.sin(phase), zero], axis=1) - ball.axes[:, 1])


@SECTION_4_1.claim("Prop. 1", "Ẋ and Ẏ at Γ₅")
@by(MOTION, "the sign of Ω₂", bound=4e-5, unit="m/s")
def _velocity_at_5(twist: float = 1.0) -> Errors:
    """Compare Ẋ = aΩ₁cos - aΩ₂sin and Ẏ = aΩ₂cos + aΩ₁sin of Ω₃t + φ₀ at Γ₅ with MuJoCo's."""
    ball = _on_circle(2)
    Omega1, Omega2, Omega3 = _FIG5.Omega
    phase = Omega3 * ball.motion.times
    X = Omega1 * np.cos(phase) - twist * Omega2 * np.sin(phase)
    Y = Omega2 * np.cos(phase) + Omega1 * np.sin(phase)
    yield ball.path_error(X, Y)


@SECTION_4_1.claim("Prop. 1", "a circle of radius a√(Ω₁² + Ω₂²)/|Ω₃|")
@by(MOTION, "the sign of Ω₂²", bound=6e-6, unit="m", index=2)
def circle(index: int, twist: float = 1.0) -> Errors:
    """Measure how far MuJoCo's contact point is from the circle of radius a√(Ωⱼ² + Ωₖ²)/|Ωᵢ| at Γ.

    The centre is that of the circle that fits best. And how far from where robotball's speed and
    turning lead from its first velocity on.
    """
    ball, n = _on_circle(index), _FIG5
    path, (one, other) = ball.motion.contact_point, np.delete(n.Omega, index)
    radius = sqrt(one**2 + twist * other**2) / abs(n.Omega[index])
    # A circle by least squares, |x|² = 2(x, centre) + const: linear, and it knows nothing of the
    # paper's centre.
    table = np.column_stack([2 * path, np.ones(len(path))])
    centre = np.linalg.lstsq(table, (path**2).sum(axis=1), rcond=None)[0][:2]
    yield np.linalg.norm(path - centre, axis=1) - radius
    ours, (alpha, beta, _) = equilibria.contact_path(f.ball(n), f.E[index]), ball.axes[0]
    ahead = np.angle(complex(-beta @ n.Omega, alpha @ n.Omega)) + ours.turning * ball.motion.times
    way = ours.speed * (np.exp(1j * ahead) - np.exp(1j * ahead[0])) / (1j * ours.turning)
    yield path @ [1, 1j] - way


# The circle Σ¹ -------------------------------------------------------------------------------


def _side(n: Numbers, gamma: Array) -> float:
    """Return (Aγ, γ×Ω): positive on Σ_s, negative on Σ_u."""
    return float(n.A @ gamma @ cross(gamma, n.Omega))


@SECTION_4_1.claim("4.1", "Σ¹ is a circle of fixed points")
@by("(4.1)", "K ≠ 0", {"K3": 1.0}, bound=1e-15, unit="1/s")
def _filled_circle(K3: float = 0.0) -> Errors:
    """Compute dγ/dt of (4.1) on (Ω,γ) = 0."""
    for i, n in enumerate(balls(48)):
        at = f.sigma(n, float(i))
        yield f.from_rest(replace(n, K=K3 * f.E[2]))(at)


@SECTION_4_1.claim("4.1", "stable where (Aγ, γ×Ω) > 0, unstable < 0")
@by("eigenvalues", "the sign", bound=0, unit="of 200 wrong")
def _sides(twist: float = 1.0) -> Errors:
    """Count the points of Σ¹ where the eigenvalue across has not the sign opposite to (Aγ, γ×Ω)."""
    for i, n in enumerate(balls(49)):
        gamma = f.sigma(n, float(i))
        values = f.eigenvalues(f.from_rest(n), gamma).real
        across = values[np.argmax(np.abs(values))]  # along the circle it is 0
        circle: Any = equilibria.fixed_circle(f.ball(n))  # as K = 0, there is one
        ours = abs(circle.rate(gamma) - across) < 1e-12
        ours = ours and _side(n, circle.at(np.array([0.5]))[0]) > 0
        yield not ours or across * twist * _side(n, gamma) >= 0


@SECTION_4_1.claim("4.1", "on Σ¹ the frame rests, the path is straight")
@by(MOTION, "γ, by 0.01", {"off": 0.01}, bound=4e-10, unit="m, rad/s")
def _straight(off: float = 0.0) -> Errors:
    """Measure how far MuJoCo's ball of Fig. 5 on Σ_s is from a straight path at a|Ω|.

    And how far its frame turns; off: rad, of γ.
    """
    # Any point of the stable half will do that is not near one of its ends.
    angle = next(x for x in np.linspace(0, 6, 13) if _side(_FIG5, f.sigma(_FIG5, x)) > 0.1)
    gamma = f.sigma(_FIG5, angle)
    gamma = f.turned_about(tangents(gamma)[0], off) @ gamma
    alpha = tangents(gamma)[0]
    ball = seen_from("fig05b", gamma, alpha, np.zeros(3), 5.0)
    shell = -_FIG5.Omega
    velocity = np.array([cross(gamma, alpha) @ shell, -alpha @ shell])
    yield largest(ball.motion.contact_point - ball.motion.times[:, None] * velocity)
    yield largest(ball.omega)


@SECTION_4_1.claim("4.1", "ζ that misses Σ¹ is periodic")
@by(MOTION, "ζ that meets Σ¹", {"name": "fig05b"}, bound=4e-6)
def _periodic(name: str = "fig05c") -> Errors:
    """Measure how far beside its start MuJoCo's γ of Fig. 5c, whose ζ misses Σ¹, comes back."""
    ball = seen(name, 60.0)
    away = ball.gamma - ball.gamma[0]
    distance = np.linalg.norm(away, axis=1)
    # The motion has left its start once before it can come back to it.
    later = int(np.argmax(distance > 0.1))
    i = later + int(np.argmin(distance[later:]))
    direction = (ball.gamma[1] - ball.gamma[0]) / distance[1]
    # The samples on either side lie along the motion.
    beside = away[i] - (away[i] @ direction) * direction
    yield np.linalg.norm(beside)


@SECTION_4_1.claim(
    "E24, 4.1", "ζ that meets Σ¹ ends at the point Σ_s ∩ ζ", "at the equilibrium point Σ_s ∪ ζ"
)
@by(
    f"{MOTION}, from the farthest point of rest named",
    "Σ_u for Σ_s",
    bound=1e-6,
    printed={"all_over": True},
)
def _ends(twist: float = 1.0, all_over: bool = False) -> Errors:
    """Compute how far the farthest point of rest in Σ_s ∩ ζ is from Fig. 5b's γ after 60 s.

    Σ_s ∩ ζ: (Ω,γ) = 0, (Aγ,γ) that of the start and γ on its side of e₃, about which ζ runs, and
    (Aγ, γ×Ω) > 0. As printed all of Σ_s, half of a circle, is named.
    """
    ball, start = seen("fig05b", 60.0, 0.05), CAPTIONS["fig05b"].axes[2]

    def off_curve(angle: float) -> float:
        gamma = f.sigma(_FIG5, angle)
        return float(_FIG5.A @ gamma @ gamma - _FIG5.A @ start @ start)

    angles = np.linspace(0.0, 2 * np.pi, 201)
    crossings = [(x, y) for x, y in pairwise(angles) if off_curve(x) * off_curve(y) < 0]
    meeting = [f.sigma(_FIG5, brentq(off_curve, x, y, xtol=1e-14)) for x, y in crossings]
    # (Aγ,γ) is the same at γ and -γ, but γ cannot pass the plane between them without changing it.
    named = f.sigma(_FIG5, angles) if all_over else [g for g in meeting if g[2] * start[2] > 0]
    for gamma in named:
        if twist * _side(_FIG5, gamma) > 0:
            yield np.linalg.norm(gamma - ball.gamma[-1])


@SECTION_4_1.claim(
    "4.1", "but Γ₃,₄'s separatrices from Σ_u end at Γ₃,₄", "ζ is periodic or ends on Σ_s"
)
@by("(4.1) by scipy", "Σ_s for Σ_u", bound=1e-4, printed={"on_sigma": True})
def _separatrices(twist: float = 1.0, on_sigma: bool = False) -> Errors:
    """Measure how far from Γ₃,₄ motions with (Aγ,γ) = a₂ are 25 s after they were near Σ_u.

    As printed, how far they are from where they started and from Σ_s ∩ ζ, the nearer.
    """
    a1, a2, a3 = _FIG5.moments
    # Two great circles through Γ₃,₄, each of which meets Σ¹ in a γ and -γ.
    others = [f.unit(np.array([sqrt(a2 - a3), 0.0, s * sqrt(a1 - a2)])) for s in (1, -1)]
    meeting = [f.unit(cross(_FIG5.Omega, cross(f.E[1], each))) for each in others]
    # (Aγ, γ×Ω) is the same at γ and -γ, so one of the circles meets Σ_u in both, the other Σ_s.
    unstable, stable = sorted(meeting, key=lambda gamma: twist * _side(_FIG5, gamma))
    for side in (0.1, -0.1):
        start = f.unit(unstable + side * f.E[1])
        end = f.followed(f.from_rest(_FIG5), start, np.array([0.0, 25.0]))[-1]
        targets = [stable, -stable, start] if on_sigma else [f.E[1], -f.E[1]]
        yield min(np.linalg.norm(end - each) for each in targets)


_misprint = partial(by, "arithmetic", "the sign of γ₁", bound=1e-15)

SECTION_4_1.claim("E17, Fig. 5b", "α₂(0) = -2√19/95: α, β, γ are orthonormal", "α₂(0) = 2√19/95")(
    _misprint(name="fig05b", printed={"printed": (0, (sqrt(8949) / 95, 2 * sqrt(19) / 95, 0))})(
        orthonormal
    )
)
SECTION_4_1.claim("E18, Fig. 5c", "γ₃(0) = √39/20: α, β, γ are orthonormal", "γ₃(0) = √33/20")(
    _misprint(name="fig05c", printed={"printed": (2, (19 / 20, 0, sqrt(33) / 20))})(orthonormal)
)
claim_motion(SECTION_4_1, "fig05b", 1.5e-6)
claim_motion(SECTION_4_1, "fig05c", 4e-7)
claim_motion(SECTION_4_1, "fig05d", 1e-7)
SECTION_4_1.claim("Fig. 5d", "Γ₁, and a circle of radius √5/4")(
    by(MOTION, "sign of Ω₃²", bound=2e-7, unit="m", index=0)(circle)
)

"""Section 4.1, motion from rest with K = 0: its fixed points, and the circle Σ¹ of them."""

from dataclasses import replace
from functools import cache, partial

import numpy as np
from numpy import sqrt
from scipy.integrate import cumulative_simpson
from scipy.special import ellipj

from robotball.rotations import Array, from_matrix
from robotball.start import Start
from validation.paper import formulas as f
from validation.paper.captions import CAPTIONS
from validation.paper.claim import Claim, Residual
from validation.paper.engine import INNER, MOTION, Seen, largest, seen, seen_of
from validation.paper.formulas import Numbers, cross
from validation.paper.point_masses import moments
from validation.paper.scenes import paper_scene

FIG5 = CAPTIONS["fig05b"].n


def integral(twist: float) -> Residual:
    """The change of (Aγ,γ) along MuJoCo's motions of Figs 5b and 5c."""
    balls = [seen(name) for name in ("fig05b", "fig05c")]
    kept = [b.of(lambda n, _, g: n.A @ (g * [1.0, 1.0, twist]) @ g) for b in balls]
    return Residual(float(np.ptp(kept, axis=1).max()), bound=3e-8)


def needs_momentum(twist: float) -> Residual:
    """K of point-mass balls without rotors, from Σ r×mu at ω = 0, beside -(J_s + d)Ω."""
    worst = 0.0
    for moment in moments(45, rotors=0):
        ball, n = moment.ball, moment.ball.numbers
        K = ball.momenta(np.zeros(3), np.zeros(3))[1] - n.d * n.Omega
        J_s = twist * ball.shell.moment(ball.shell.axis)
        worst = max(worst, float(np.abs(K + (J_s + n.d) * n.Omega).max()))
    return Residual(worst, bound=4e-15, unit="kg m²/s")


def euler_case(twist: float) -> Residual:
    """MuJoCo's γ of Fig. 5c beside Euler's top in the time ∫(Ω,γ)/(Aγ,γ) dt, by Jacobi's functions.

    γ' = γ×Aγ with a₁ > a₂ > a₃ and γ closer to the first axis.
    """
    ball = seen("fig05c")
    pace = ball.of(lambda n, _, g: (n.Omega @ g / (n.A @ g @ g)) ** twist)
    time = cumulative_simpson(pace, x=ball.motion.times, initial=0)
    a1, a2, a3 = FIG5.moments
    first, _, third = ball.gamma[0]  # γ₂ = 0 at the start: sn = 0
    m = (a2 - a3) * third**2 / ((a1 - a2) * first**2)
    speed = first * sqrt((a1 - a2) * (a1 - a3))
    sn, cn, dn, _ = ellipj(speed * time, m)
    second = third * sqrt((a1 - a3) / (a1 - a2))
    top = np.stack([first * dn, second * sn, third * cn], axis=1)
    return Residual(largest(top - ball.gamma), bound=1e-7)


# Fixed points --------------------------------------------------------------------------------


def balls(seed: int, count: int = 200) -> list[Numbers]:
    """Random ones with K = 0 and a₁ < a₂ < a₃, no Ωᵢ zero."""
    random = np.random.default_rng(seed)
    found = []
    for _ in range(count):
        A = np.sort(random.uniform(0.2, 1.0, 3))
        Omega = random.uniform(0.2, 3.0, 3) * random.choice([-1, 1], 3)
        found.append(f.with_A(tuple(A), Omega, np.zeros(3)))
    return found


def six_points(twist: float) -> Residual:
    """Of the zeros of (4.1), but those with (Ω,γ) = 0: how many are not (4.4), or of it missing."""
    wrong = 0
    axes = np.concatenate([f.E, -f.E])
    for n in balls(46, 5):
        n = n if twist == 1 else replace(n, K=np.array([0.0, 0.0, 0.3]))
        found = [g for g in f.zeros(f.from_rest(n), 100) if abs(n.Omega @ g) > 1e-6]
        near = sum(bool(np.linalg.norm(axes - g, axis=1).min() < 1e-9) for g in found)
        wrong += len(found) - near + abs(6 - near)
    return Residual(wrong, bound=0, unit="of 30 off")


def stability(twist: float) -> Residual:
    """How many of Γ₁…Γ₆ are not as Prop. 1 has it: Γ₃,₄ with a growing direction, at the others
    imaginary eigenvalues and (Aγ,γ) least or greatest.
    """
    wrong = 0
    for n in balls(47):
        for i, gamma in enumerate(f.E):
            values = f.eigenvalues(f.from_rest(n), gamma)
            middle = i == 1 if twist == 1 else i == 0
            extreme = n.moments[i] in (n.moments.min(), n.moments.max())
            size = abs(values).max()
            turning = abs(values.real).max() < 1e-9 * size and extreme
            wrong += 2 * int((values[1].real > 1e-3 * size) != middle or turning == middle)
    return Residual(wrong, bound=0, unit="of 1200 off")


@cache
def on_circle(index: int) -> Seen:
    """Fig. 5's ball, started at Γ₁ or Γ₅ with α = -e₂ or e₂, rolled by MuJoCo."""
    scene = paper_scene("fig05d")
    gamma, alpha = f.E[index], -f.E[1] if index == 0 else f.E[1]
    attitude = from_matrix(np.array([alpha, cross(gamma, alpha), gamma]))
    return seen_of(replace(scene, start=Start(attitude, np.zeros(3))), 10.0)


def axes_at_5(twist: float) -> Residual:
    """α = (sin, cos, 0) and β = (-cos, sin, 0) of Ω₃t + φ₀ at Γ₅, beside MuJoCo's."""
    ball = on_circle(2)
    phase, zero = twist * FIG5.Omega[2] * ball.motion.times, 0 * ball.motion.times  # φ₀ = 0
    alpha = np.stack([np.sin(phase), np.cos(phase), zero], axis=1)
    beta = np.stack([-np.cos(phase), np.sin(phase), zero], axis=1)
    return Residual(
        max(largest(alpha - ball.axes[:, 0]), largest(beta - ball.axes[:, 1])), bound=8e-6
    )


def velocity_at_5(twist: float) -> Residual:
    """Ẋ = aΩ₁cos - aΩ₂sin and Ẏ = aΩ₂cos + aΩ₁sin of Ω₃t + φ₀ at Γ₅, beside MuJoCo's."""
    ball = on_circle(2)
    Omega1, Omega2, Omega3 = FIG5.Omega
    phase = Omega3 * ball.motion.times[INNER]
    X = Omega1 * np.cos(phase) - twist * Omega2 * np.sin(phase)
    Y = Omega2 * np.cos(phase) + Omega1 * np.sin(phase)
    return Residual(largest(ball.path_velocity[:, :2] - np.stack([X, Y], axis=1)), 4e-5, unit="m/s")


def circle(index: int, bound: float, twist: float) -> Residual:
    """How far MuJoCo's contact point is from the circle of radius a√(Ωⱼ² + Ωₖ²)/|Ωᵢ| at Γ.

    The centre is that of the circle that fits best.
    """
    ball = on_circle(index)
    path, (one, other) = ball.motion.contact_point, np.delete(FIG5.Omega, index)
    radius = sqrt(one**2 + twist * other**2) / abs(FIG5.Omega[index])
    table = np.column_stack([2 * path, np.ones(len(path))])
    centre = np.linalg.lstsq(table, (path**2).sum(axis=1), rcond=None)[0][:2]
    off = np.linalg.norm(path - centre, axis=1) - radius
    return Residual(float(np.abs(off).max()), bound, unit="m")


# The circle Σ¹ -------------------------------------------------------------------------------


def on_sigma(n: Numbers, angle: float) -> Array:
    """γ with (Ω,γ) = 0."""
    first, second = f.across(n.Omega / np.linalg.norm(n.Omega))
    return np.cos(angle) * first + np.sin(angle) * second


def side(n: Numbers, gamma: Array) -> float:
    """(Aγ, γ×Ω): positive on Σ_s, negative on Σ_u."""
    return float(n.A @ gamma @ cross(gamma, n.Omega))


def filled_circle(twist: float) -> Residual:
    """dγ/dt of (4.1) on (Ω,γ) = 0; twisted, with K."""
    worst = 0.0
    for i, n in enumerate(balls(48)):
        at = on_sigma(n, float(i))
        n = n if twist == 1 else replace(n, K=f.E[2])
        worst = max(worst, float(np.abs(f.from_rest(n)(at)).max()))
    return Residual(worst, bound=1e-15, unit="1/s")


def sides(twist: float) -> Residual:
    """Of how many points of Σ¹ the eigenvalue across has not the sign opposite to (Aγ, γ×Ω)."""
    wrong = 0
    for i, n in enumerate(balls(49)):
        gamma = on_sigma(n, float(i))
        values = f.eigenvalues(f.from_rest(n), gamma).real
        across = values[np.argmax(np.abs(values))]  # along the circle it is 0
        wrong += bool(across * twist * side(n, gamma) >= 0)
    return Residual(wrong, bound=0, unit="of 200 wrong")


def straight(twist: float) -> Residual:
    """MuJoCo's ball of Fig. 5 on Σ_s: how far its path is from a straight one at a|Ω|.

    And how far its frame turns; twisted, with γ 0.01 rad off.
    """
    scene = paper_scene("fig05b")
    angle = next(x for x in np.linspace(0, 6, 13) if side(FIG5, on_sigma(FIG5, x)) > 0.1)
    gamma = on_sigma(FIG5, angle)
    if twist != 1:
        gamma = f.turned_about(f.across(gamma)[0], 0.01) @ gamma
    alpha = f.across(gamma)[0]
    start = Start(from_matrix(np.array([alpha, cross(gamma, alpha), gamma])), np.zeros(3))
    ball = seen_of(replace(scene, start=start), 5.0)
    shell = -FIG5.Omega
    velocity = np.array([cross(gamma, alpha) @ shell, -alpha @ shell])
    off = ball.motion.contact_point - ball.motion.times[:, None] * velocity
    return Residual(max(largest(off), largest(ball.omega)), bound=4e-10, unit="m, rad/s")


CLAIMS = (
    Claim("4.1", "(Aγ,γ) stays", integral, MOTION, "the sign of a₃"),
    Claim(
        "Remark 7",
        "without a rotor K = -(J_s + d)Ω, not 0",
        needs_momentum,
        "point masses",
        "the sign of J_s",
    ),
    Claim("(4.3)", "in its time γ moves as Euler's top", euler_case, MOTION, "dt, upside down"),
    Claim("(4.4)", "six isolated fixed points, ±e₁, ±e₂, ±e₃", six_points, "search", "K ≠ 0"),
    Claim(
        "Prop. 1", "Γ₃,₄ unstable, Γ₁,₂ and Γ₅,₆ stable", stability, "eigenvalues", "the indices"
    ),
    Claim("Prop. 1", "α and β at Γ₅", axes_at_5, MOTION, "the sign of Ω₃"),
    Claim("Prop. 1", "Ẋ and Ẏ at Γ₅", velocity_at_5, MOTION, "the sign of Ω₂"),
    Claim(
        "Prop. 1",
        "a circle of radius a√(Ω₁² + Ω₂²)/|Ω₃|",
        partial(circle, 2, 6e-6),
        MOTION,
        "the sign of Ω₂²",
    ),
    Claim("4.1", "Σ¹ is a circle of fixed points", filled_circle, "(4.1)", "K ≠ 0"),
    Claim("4.1", "stable where (Aγ, γ×Ω) > 0, unstable < 0", sides, "eigenvalues", "the sign"),
    Claim("4.1", "on Σ¹ the frame rests, the path is straight", straight, MOTION, "γ, by 0.01"),
)

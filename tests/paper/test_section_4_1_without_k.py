"""Section 4.1, motion from rest with K = 0: fixed points, the circle Σ¹, where motions end."""

from dataclasses import replace
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from numpy import sqrt
from scipy.integrate import cumulative_simpson
from scipy.optimize import brentq
from scipy.special import ellipj

from robotball.dynamics import equilibria
from robotball.rotations import Array, tangents
from tests.paper import formulas as f
from tests.paper.captions import CAPTIONS
from tests.paper.engine_ball import BallMotion, largest, mujoco_ball, mujoco_ball_from
from tests.paper.formulas import Errors, Numbers, count, cross, worst
from tests.paper.point_masses import moments

FIG5 = CAPTIONS["fig05b"].n


def test_gamma_stays_on_a_quadric() -> None:
    """Section 4.1: (Aγ,γ) is an integral, along MuJoCo's motions of Figs 5b and 5c."""

    def changes(sign: float) -> Errors:
        for ball in map(mujoco_ball, ("fig05b", "fig05c")):
            yield np.ptp(ball.of(lambda n, _, g: n.A @ (g * [1.0, 1.0, sign]) @ g))

    assert worst(changes(+1)) <= 3e-8  # measured 4.0e-9: MuJoCo's contact
    assert worst(changes(-1)) > 0.02  # control: the sign of a₃, 0.058


def test_without_a_rotor_the_momentum_K_is_not_zero() -> None:
    """Remark 7: K = -(J_s + d)Ω of point masses at ω = 0."""

    def errors(sign: float) -> Errors:
        for moment in moments(45, rotors=0):
            ball, n = moment.ball, moment.ball.numbers
            K = ball.momenta(np.zeros(3), np.zeros(3))[1] - n.d * n.Omega
            yield K + (sign * ball.shell.moment(ball.shell.axis) + n.d) * n.Omega

    assert worst(errors(+1)) <= 4e-15  # kg m²/s; measured 4e-16: rounding
    assert worst(errors(-1)) > 0.1  # control: the sign of J_s, 0.51


def test_gamma_moves_as_in_eulers_top_in_another_time() -> None:
    """(4.3): the time ∫(Ω,γ)/(Aγ,γ) dt; MuJoCo's γ of Fig. 5c against Jacobi's functions."""
    ball, (a1, a2, a3) = mujoco_ball("fig05c"), FIG5.moments
    first, _, third = ball.gamma[0]  # γ₂ = 0 at the start
    m = (a2 - a3) * third**2 / ((a1 - a2) * first**2)
    amplitude = np.array([first, third * sqrt((a1 - a3) / (a1 - a2)), third])

    def error(power: float) -> float:
        pace = ball.of(lambda n, _, g: (n.Omega @ g / (n.A @ g @ g)) ** power)
        time = cumulative_simpson(pace, x=ball.motion.times, initial=0)
        sn, cn, dn, _ = ellipj(first * sqrt((a1 - a2) * (a1 - a3)) * time, m)
        return largest(amplitude * np.stack([dn, sn, cn], axis=1) - ball.gamma)

    assert error(+1) <= 1e-7  # measured 2.6e-8: MuJoCo's contact
    assert error(-1) > 0.1  # control: dt inverted, 0.66


# Fixed points --------------------------------------------------------------------------------


def balls(seed: int, number: int = 200) -> list[Numbers]:
    """Return random balls with K = 0, a₁ < a₂ < a₃ and no Ωᵢ = 0 (Prop. 1)."""
    random, made = np.random.default_rng(seed), []
    for _ in range(number):
        A = np.sort(random.uniform(0.2, 1.0, 3))
        Omega = random.uniform(0.2, 3.0, 3) * random.choice([-1, 1], 3)
        made.append(f.with_A(tuple(A), Omega, np.zeros(3)))
    return made


def test_the_six_isolated_fixed_points_are_the_ends_of_the_principal_axes() -> None:
    """(4.4), by a search that starts from 100 points."""
    axes = np.concatenate([f.E, -f.E])

    def wrong(K3: float) -> Errors:
        for n in balls(46, 5):
            n = replace(n, K=K3 * f.E[2])
            # The circle Σ¹ is full of zeros; the search finds some of them.
            zeros = [g for g in f.zeros(f.from_rest(n), 100) if abs(n.Omega @ g) > 1e-6]
            near = sum(bool(np.linalg.norm(axes - g, axis=1).min() < 1e-9) for g in zeros)
            yield len(zeros) - near + abs(6 - near)

    assert count(wrong(K3=0.0)) == 0  # of 30
    assert count(wrong(K3=0.3)) > 30  # control: K ≠ 0, 56 missing or superfluous


def test_the_fixed_points_of_the_middle_axis_are_unstable_and_the_others_stable() -> None:
    """Prop. 1: eigenvalues; the stable ones are imaginary, with (Aγ,γ) extreme."""

    def wrong(saddle: int) -> Errors:
        for n in balls(47):
            for i, gamma in enumerate(f.E):
                values = f.eigenvalues(f.from_rest(n), gamma)
                growing = values[1].real > 1e-3 * abs(values).max()
                extreme = n.moments[i] in (n.moments.min(), n.moments.max())
                stable = abs(values.real).max() < 1e-9 * abs(values).max() and extreme
                yield (growing, stable) != (i == saddle, i != saddle)

    assert count(wrong(saddle=1)) == 0  # of 600
    assert count(wrong(saddle=0)) == 400  # control: another axis


@cache
def at_rest(axis: int) -> BallMotion:
    """Roll Fig. 5's ball in MuJoCo, started at Γ₁ or Γ₅ with α = -e₂ or e₂."""
    alpha = -f.E[1] if axis == 0 else f.E[1]
    return mujoco_ball_from("fig05d", f.E[axis], alpha, np.zeros(3), 10.0)


def test_at_gamma_5_the_frame_rotates_at_omega_3() -> None:
    """Prop. 1: α = (sin, cos, 0), β = (-cos, sin, 0) of Ω₃t; MuJoCo."""
    ball = at_rest(2)

    def error(sign: float) -> float:
        phase, zero = sign * FIG5.Omega[2] * ball.motion.times, 0 * ball.motion.times
        alpha = np.stack([np.sin(phase), np.cos(phase), zero], axis=1)
        beta = np.stack([-np.cos(phase), np.sin(phase), zero], axis=1)
        return max(largest(alpha - ball.axes[:, 0]), largest(beta - ball.axes[:, 1]))

    assert error(+1) <= 8e-6  # measured 9.4e-7: MuJoCo's contact
    assert error(-1) > 1.0  # control: the sign of Ω₃, 2.0


def test_at_gamma_5_the_contact_points_velocity_rotates_at_omega_3() -> None:
    """Prop. 1: Ẋ = aΩ₁cos - aΩ₂sin, Ẏ = aΩ₂cos + aΩ₁sin of Ω₃t; MuJoCo."""
    ball, (Omega1, Omega2, Omega3) = at_rest(2), FIG5.Omega
    cos, sin = np.cos(Omega3 * ball.motion.times), np.sin(Omega3 * ball.motion.times)
    Y = Omega2 * cos + Omega1 * sin
    assert ball.path_error(Omega1 * cos - Omega2 * sin, Y) <= 4e-5  # m/s; measured 4.2e-6
    assert ball.path_error(Omega1 * cos + Omega2 * sin, Y) > 1.0  # control: Ω₂'s sign, 4.0


@pytest.mark.parametrize(("axis", "bound"), [(0, 2e-7), (2, 6e-6)], ids=["Γ₁", "Γ₅"])
def test_at_a_fixed_point_the_contact_point_describes_a_circle(axis: int, bound: float) -> None:
    """Prop. 1, Fig. 5d: radius a√(Ωⱼ² + Ωₖ²)/|Ωᵢ|, √5/4 at Γ₁; MuJoCo, and robotball's path."""
    ball, n = at_rest(axis), FIG5
    path, (one, other) = ball.motion.contact_point, np.delete(n.Omega, axis)
    # The best circle by least squares, |x|² = 2(x, centre) + const.
    table = np.column_stack([2 * path, np.ones(len(path))])
    centre = np.linalg.lstsq(table, (path**2).sum(axis=1), rcond=None)[0][:2]

    def error(sign: float) -> float:
        radius = sqrt(one**2 + sign * other**2) / abs(n.Omega[axis])
        return worst([np.linalg.norm(path - centre, axis=1) - radius])

    assert error(+1) <= bound  # m; measured 7.8e-8 and 4.2e-6: MuJoCo's contact
    assert error(-1) > 0.05  # control: the sign of one Ω², 0.13 and 1.0
    ours, (alpha, beta, _) = equilibria.contact_path(f.ball(n), f.E[axis]), ball.axes[0]
    ahead = np.angle(complex(-beta @ n.Omega, alpha @ n.Omega)) + ours.turning * ball.motion.times
    way = ours.speed * (np.exp(1j * ahead) - np.exp(1j * ahead[0])) / (1j * ours.turning)
    assert worst([path @ [1, 1j] - way]) <= bound


# The circle Σ¹ -------------------------------------------------------------------------------


def side(n: Numbers, gamma: Array) -> float:
    """Return (Aγ, γ×Ω): positive on Σ_s, negative on Σ_u."""
    return float(n.A @ gamma @ cross(gamma, n.Omega))


def test_a_circle_is_full_of_fixed_points() -> None:
    """Section 4.1: Σ¹, where (Ω,γ) = 0."""

    def rates(K3: float) -> Errors:
        for i, n in enumerate(balls(48)):
            yield f.from_rest(replace(n, K=K3 * f.E[2]))(f.sigma(n, float(i)))

    assert worst(rates(K3=0.0)) <= 1e-15  # 1/s; measured 1.6e-16: rounding
    assert worst(rates(K3=1.0)) > 0.2  # control: K ≠ 0, 0.91


def test_half_of_the_circle_is_stable() -> None:
    """Section 4.1: Σ_s, where (Aγ, γ×Ω) > 0, by eigenvalues; robotball's rate and half too."""

    def wrong(sign: float) -> Errors:
        for i, n in enumerate(balls(49)):
            gamma = f.sigma(n, float(i))
            values = f.eigenvalues(f.from_rest(n), gamma).real
            across = values[np.argmax(np.abs(values))]  # along the circle it is 0
            circle: Any = equilibria.fixed_circle(f.ball(n))
            ours = abs(circle.rate(gamma) - across) < 1e-12
            ours = ours and side(n, circle.at(np.array([0.5]))[0]) > 0
            yield not ours or across * sign * side(n, gamma) >= 0

    assert count(wrong(+1)) == 0  # of 200
    assert count(wrong(-1)) == 200  # control: the sign


def test_on_the_circle_the_frame_rests_and_the_path_is_straight() -> None:
    """Section 4.1: at a|Ω|; MuJoCo's ball of Fig. 5 on Σ_s."""
    angle = next(x for x in np.linspace(0, 6, 13) if side(FIG5, f.sigma(FIG5, x)) > 0.1)

    def errors(off: float) -> Errors:
        at = f.sigma(FIG5, angle)
        gamma = f.turned_about(tangents(at)[0], off) @ at
        alpha = tangents(gamma)[0]
        ball = mujoco_ball_from("fig05b", gamma, alpha, np.zeros(3), 5.0)
        velocity = np.array([-cross(gamma, alpha) @ FIG5.Omega, alpha @ FIG5.Omega])
        yield from (ball.motion.contact_point - ball.motion.times[:, None] * velocity, ball.omega)

    assert worst(errors(0.0)) <= 4e-10  # m and rad/s; measured 4.3e-11: MuJoCo's contact
    assert worst(errors(0.01)) > 0.1  # control: γ rotated by 0.01 rad, 0.34


def test_a_curve_that_misses_the_circle_is_periodic() -> None:
    """Section 4.1: MuJoCo's γ of Fig. 5c, whose ζ misses Σ¹, returns within 60 s."""

    def miss(name: str) -> float:
        ball = mujoco_ball(name, 60.0)
        away = ball.gamma - ball.gamma[0]
        distance = np.linalg.norm(away, axis=1)
        later = int(np.argmax(distance > 0.1))  # it has left its start
        i = later + int(np.argmin(distance[later:]))
        along = f.unit(away[1])
        return float(np.linalg.norm(away[i] - (away[i] @ along) * along))

    assert miss("fig05c") <= 4e-6  # measured 5.2e-7: MuJoCo's contact
    assert miss("fig05b") > 0.01  # control: a ζ that meets Σ¹, 0.021


def test_a_curve_that_meets_the_circle_ends_where_it_meets_the_stable_half() -> None:
    """Section 4.1, E24: at Σ_s ∩ ζ. The paper prints Σ_s ∪ ζ, which names all of Σ_s."""
    end, start = mujoco_ball("fig05b", 60.0, 0.05).gamma[-1], CAPTIONS["fig05b"].axes[2]
    angles = np.linspace(0.0, 2 * np.pi, 201)

    def off_curve(angle: float) -> float:
        gamma = f.sigma(FIG5, angle)
        return float(FIG5.A @ gamma @ gamma - FIG5.A @ start @ start)

    crossings = [(x, y) for x, y in pairwise(angles) if off_curve(x) * off_curve(y) < 0]
    meeting = [f.sigma(FIG5, brentq(off_curve, x, y, xtol=1e-14)) for x, y in crossings]
    # ζ runs on the start's side of e₃, where (Aγ,γ) has the same values as on the other side.
    meeting = [gamma for gamma in meeting if gamma[2] * start[2] > 0]

    def distance(named: list[Array], sign: float) -> float:
        return max(float(np.linalg.norm(g - end)) for g in named if sign * side(FIG5, g) > 0)

    assert distance(meeting, +1) <= 1e-6  # measured 3.2e-7: MuJoCo's contact
    assert distance([*f.sigma(FIG5, angles)], +1) > 1.0  # printed: 2.0
    assert distance(meeting, -1) > 0.2  # control: Σ_u, 0.63


def test_the_separatrices_that_leave_the_unstable_half_end_at_the_saddles() -> None:
    """Section 4.1, E29: (Aγ,γ) = a₂. The paper prints that ζ is periodic or ends on Σ_s."""
    a1, a2, a3 = FIG5.moments
    # Two great circles through Γ₃ and Γ₄. One meets Σ_u at ±γ, the other meets Σ_s.
    others = [f.unit(np.array([sqrt(a2 - a3), 0.0, s * sqrt(a1 - a2)])) for s in (1, -1)]
    meeting = [f.unit(cross(FIG5.Omega, cross(f.E[1], normal))) for normal in others]
    unstable, stable = sorted(meeting, key=lambda gamma: side(FIG5, gamma))

    def distances(begin: Array, named: list[Array], also_start: bool = False) -> Errors:
        for off in (0.1, -0.1):
            start = f.unit(begin + off * f.E[1])
            end = f.followed(f.from_rest(FIG5), start, np.array([0.0, 25.0]))[-1]
            targets = [*named, start] if also_start else named
            yield min(np.linalg.norm(end - target) for target in targets)

    saddles = [f.E[1], -f.E[1]]
    assert worst(distances(unstable, saddles)) <= 1e-4  # measured 1.8e-5: 25 s are finite
    assert worst(distances(unstable, [stable, -stable], also_start=True)) > 0.2  # printed: 0.74
    assert worst(distances(stable, saddles)) > 0.2  # control: from Σ_s, 0.74

"""Sections 2 and 3: constraints, equations and the momentum, along MuJoCo's own motion.

Bounds are 5 to 10 times what was measured. That is what "balanced" leaves in 10 s, 1e-8, and for
rates of ω and of the contact point the differences by which they are taken, 1e-6.
"""

from dataclasses import replace

import numpy as np
from scipy.integrate import cumulative_simpson

from robotball import equations as eq
from robotball.engines.reduced.compiled.kernels import orbit
from robotball.equations import Scalar, Vector
from robotball.parameters import Parameters, Rolling
from robotball.rotations import Array, rotation_matrix
from robotball.start import along_momentum
from validation.paper.claim import Claim, Residual
from validation.paper.engine import Seen, columns, inner, largest, rate, seen

RUBBER, CLASSICAL, DRIVEN = "fig12", "classical_regular", "wobbling_drive"
MOMENTUM, VELOCITY = "kg m²/s", "rad/s"


# Section 2 ---------------------------------------------------------------------------------


def no_slip() -> Residual:
    """(2.1): the contact point's velocity is a(β, ω-Ω), -a(α, ω-Ω)."""
    worst = 0.0
    for name in (RUBBER, CLASSICAL, DRIVEN):
        ball = seen(name)
        alpha, beta = columns(ball.axes[:, 0]), columns(ball.axes[:, 1])
        p = ball.parameters
        rolled = np.array(eq.contact_velocity(alpha, beta, ball.omega, p.Omega, p.a))[:, 2:-2]
        worst = max(worst, largest(rolled - rate(ball.motion.contact_point).T))
    return Residual(worst, bound=2e-6, unit="m/s")


def no_spin() -> Residual:
    """(2.2): (ω - Ω, γ) = 0."""
    ball = seen(DRIVEN)
    spin = eq.dot(eq.subtract(ball.omega, ball.parameters.Omega), ball.gamma)
    return Residual(float(np.abs(spin).max()), bound=1e-7, unit=VELOCITY)


def acceleration(ball: Seen) -> tuple[Vector, Scalar]:
    """dω/dt [rad/s²] and λ₀ [N m] by (2.4)-(2.5), as columns."""
    p = ball.parameters
    return eq.full_angular_acceleration(
        ball.omega,
        ball.gamma,
        p.Omega,
        ball.Omega_rate,
        p.k,
        ball.k_rate,
        p.I,
        p.d,
        spin_free=p.rolling == "rubber",
    )


def measured_acceleration(ball: Seen) -> Vector:
    """dω/dt [rad/s²] by differences."""
    return columns(rate(np.array(ball.omega).T))


def full_equations() -> Residual:
    """dω/dt of MuJoCo's ball is that of (2.4)-(2.5), with rates that change in time."""
    ball = seen(DRIVEN)
    expected, _ = acceleration(ball)
    off = eq.subtract(measured_acceleration(ball), inner(expected))
    return Residual(largest(off), bound=3e-5, unit="rad/s²")


def spin_torque() -> Residual:
    """λ₀ of (2.5) is the torque that MuJoCo's contact feels."""
    ball = seen(DRIVEN)
    off = ball.motion.loads.spin_torque - acceleration(ball)[1]
    return Residual(float(np.abs(off).max()), bound=1e-7, unit="N m")


def constraint_rate() -> Residual:
    """d/dt (ω - Ω, γ) = 0, with (Ω̇, γ) at either sign."""
    ball = seen(DRIVEN)
    gamma, omega, Omega = inner(ball.gamma), inner(ball.omega), inner(ball.parameters.Omega)
    rest = eq.dot(eq.subtract(measured_acceleration(ball), eq.cross(omega, Omega)), gamma)
    drive = eq.dot(inner(ball.Omega_rate), gamma)
    return Residual(
        float(np.abs(rest - drive).max()),
        bound=3e-5,
        printed=float(np.abs(rest + drive).max()),
        unit="rad/s²",
    )


def inertia_of_the_contact() -> Residual:
    """The inertia that multiplies dω/dt in (2.4) is Ĩ; I alone would give another dω/dt."""
    ball = seen(CLASSICAL)
    p, rotating = ball.parameters, measured_acceleration(ball)
    expected = inner(acceleration(ball)[0])
    none: Vector = (0.0, 0.0, 0.0)
    torque = eq.contact_angular_momentum(expected, inner(ball.gamma), none, none, p.I, p.d)
    printed = (torque[0] / p.I[0], torque[1] / p.I[1], torque[2] / p.I[2])
    return Residual(
        largest(eq.subtract(rotating, expected)),
        bound=3e-5,
        printed=largest(eq.subtract(rotating, printed)),
        unit="rad/s²",
    )


# Section 3 ---------------------------------------------------------------------------------


def rubber_momentum() -> Residual:
    """M of (3.1) in space, with K as corrected and as printed."""
    ball = seen(RUBBER)
    p = ball.parameters
    printed = replace(p, K=eq.scale(-1, p.K)).momentum(ball.omega, ball.gamma)
    return Residual(ball.drift(ball.momentum), 2e-7, ball.drift(printed), MOMENTUM)


def classical_momentum() -> Residual:
    """M of section 3.2 in space, with d(Ω,γ)γ added and, as printed, subtracted."""
    ball = seen(CLASSICAL)
    p = ball.parameters
    twice = eq.scale(2 * p.d * eq.dot(p.Omega, ball.gamma), ball.gamma)
    printed = eq.subtract(ball.momentum, twice)
    return Residual(ball.drift(ball.momentum), 2e-7, ball.drift(printed), MOMENTUM)


def momentum_under_changing_rates() -> Residual:
    """M of (3.1) in space, while Ω and K change."""
    ball = seen(DRIVEN)
    return Residual(ball.drift(ball.momentum), bound=2e-7, unit=MOMENTUM)


def turned_momentum() -> Residual:
    """M×γ is the horizontal part of L."""
    ball = seen(RUBBER)
    p = ball.parameters
    L = eq.contact_angular_momentum(ball.omega, ball.gamma, p.Omega, p.K, p.I, p.d)
    level = eq.subtract(L, eq.scale(eq.dot(L, ball.gamma), ball.gamma))
    M = columns(np.einsum("nij,ni->nj", ball.axes, ball.motion.momentum))
    return Residual(largest(eq.subtract(eq.cross(M, ball.gamma), level)), 2e-7, unit=MOMENTUM)


def velocity_from(ball: Seen, parameters: Parameters) -> float:
    """How far ω(M, γ), with the M that the motion started with, is from MuJoCo's ω [rad/s]."""
    start = ball.axes[0] @ np.array([component[0] for component in ball.momentum])
    M = columns(np.einsum("nij,i->nj", ball.axes, start))
    return largest(eq.subtract(parameters.angular_velocity(M, ball.gamma), ball.omega))


def rubber_velocity() -> Residual:
    """ω(M, γ) of (3.2)."""
    ball = seen(RUBBER)
    return Residual(velocity_from(ball, ball.parameters), bound=2e-7, unit=VELOCITY)


def classical_velocity() -> Residual:
    """ω(M, γ) of (3.3), and as the printed reference has it, of (3.2)."""
    ball = seen(CLASSICAL)
    printed = replace(ball.parameters, rolling="rubber")
    return Residual(
        velocity_from(ball, ball.parameters), 2e-7, velocity_from(ball, printed), VELOCITY
    )


def space_axes() -> Residual:
    """α = -(M - cγ)/√(f - c²) and β = M×γ/√(f - c²), where OX is laid against M."""
    ball = seen(CLASSICAL)
    M, gamma = ball.momentum, ball.gamma
    c = eq.dot(M, gamma)
    across = 1 / np.sqrt(eq.dot(M, M) - c * c)
    alpha = eq.scale(-across, eq.subtract(M, eq.scale(c, gamma)))
    beta = eq.scale(across, eq.cross(M, gamma))
    off = max(
        largest(eq.subtract(axis, columns(ball.axes[:, i]))) for i, axis in enumerate((alpha, beta))
    )
    return Residual(off, bound=2e-7)


def energy_balance(name: str) -> Residual:
    """E(t) - E(0) = ∫ -(Ω, (A⁻¹ω + K)×ω) dt."""
    ball = seen(name)
    p = ball.parameters
    E = eq.energy(ball.omega, ball.gamma, p.Omega, p.A, p.d, p.rolling == "classical")
    power = eq.energy_rate(ball.omega, p.Omega, p.K, p.A)
    work = cumulative_simpson(power, x=ball.motion.times, initial=0)
    return Residual(float(np.abs(E - E[0] - work).max()), bound=2e-6, unit="J")


def reversed_path(rolling: Rolling) -> Residual:
    """There, reflected, and back again: γ and M/|M| end as the reflections of their starts."""
    d = 0.9
    I = (1 / 0.8 - d, 1 / 0.6 - d, 1 / 0.7 - d)
    ball = Parameters(rolling, I, d, 1.0, Omega=(0.0, 0.0, 2.0), K=(2.0, 0.0, 1.0))
    reflection = np.array([1.0, -1.0, 1.0])  # of the axis on which Ω and K have no part
    sign = -1.0 if rolling == "rubber" else 1.0
    gamma = np.array([0.6, 0.48, 0.64])
    M = np.array([3.0, 1.0, -2.0])
    if rolling == "rubber":
        M = np.cross(gamma, M)
    there = followed(ball, gamma, M)
    back = followed(ball, reflection * there[0], sign * reflection * there[1])
    off = np.array(back) - np.array([reflection * gamma, sign * reflection * M])
    return Residual(float(np.abs(off).max()), bound=1e-11)


def followed(ball: Parameters, gamma: Array, M: Array) -> tuple[Array, Array]:
    """γ and M (3,) 5 s later, in frame axes."""
    start = along_momentum(gamma, M)
    attitudes, _ = orbit(ball, start.attitude, start.momentum, np.array([0.0, 5.0]))
    axes = rotation_matrix(attitudes[-1])
    return axes[2], start.momentum @ axes


def integral_of_energy() -> Residual:
    """E(t) - E(0) = 0 where A, Ω and K share an axis."""
    ball = seen("routh_sphere")
    p = ball.parameters
    E = eq.energy(ball.omega, ball.gamma, p.Omega, p.A, p.d, p.rolling == "classical")
    return Residual(float(np.abs(E - E[0]).max()), bound=2e-6, unit="J")


CLAIMS = (
    Claim("(2.1)", "no slip: v = -aγ×(ω - Ω)", no_slip),
    Claim("(2.2)", "rubber: (ω - Ω, γ) = 0", no_spin),
    Claim("(2.4)", "the full equations give dω/dt", full_equations),
    Claim("(2.5)", "λ₀, as printed, is the spin torque", spin_torque),
    Claim("E3, (2.5)", "rate of (2.2): - (dΩ/dt, γ), not +", constraint_rate),
    Claim("E4, (2.4)", "Ĩ = I + d(γ²E - γ⊗γ) multiplies dω/dt, not I", inertia_of_the_contact),
    Claim("E1, (3.1)", "M = γ×(Ĩω + K), not γ×(Ĩω - K), stays in space", rubber_momentum),
    Claim("E2, 3.2", "M = Ĩω + K + d(Ω,γ)γ, not - d(Ω,γ)γ, stays", classical_momentum),
    Claim("3.1", "M stays while Ω and K change in time", momentum_under_changing_rates),
    Claim("3.1", "M×γ is the horizontal part of L", turned_momentum),
    Claim("(3.2)", "ω(M, γ) of the rubber ball", rubber_velocity),
    Claim("E5, 3.3", "ω(M, γ) of the classical ball: (3.3), not (3.2)", classical_velocity),
    Claim("3.3", "α = -(M - cγ)/√(f - c²), β = M×γ/√(f - c²)", space_axes),
    Claim("3", "rubber: dE/dt = -(Ω, (A⁻¹ω + K)×ω)", lambda: energy_balance(RUBBER)),
    Claim("3", "classical: the same balance of work", lambda: energy_balance(CLASSICAL)),
    Claim("Remark 5", "E is an integral of the axisymmetric ball", integral_of_energy),
    Claim("3", "rubber: (γ, M, t) → (Dγ, -DM, -t)", lambda: reversed_path("rubber")),
    Claim("3", "classical: (γ, M, t) → (Dγ, DM, -t)", lambda: reversed_path("classical")),
)

"""Section 2 up to the kinetic energy, by point masses and along MuJoCo's motion.

Point masses leave rounding. MuJoCo at "balanced" leaves 2e-8 in 10 s, and the differences by which
rates of ω and of the contact point are taken, 1e-6.
"""

import numpy as np

from robotball.rotations import Array
from validation.paper import formulas as f
from validation.paper.claim import Claim, Residual
from validation.paper.engine import DRIVEN, EACH, INNER, MOTION, RUBBER, largest, rate, seen
from validation.paper.formulas import cross
from validation.paper.point_masses import moments

MASSES = "point masses"


# The system ----------------------------------------------------------------------------------


def mass_distribution(twist: float) -> Residual:
    """The inertia of the point masses as shell and rotors turn on, in the axes of the frame."""
    worst = 0.0
    for moment in moments(21):
        ball = moment.ball.turned(0.3)
        turn = ball.shell.rate * 0.3 if twist != 1 else 0.0
        carried = f.turned_about(ball.shell.axis, turn)
        change = carried.T @ ball.inertia(np.zeros(3)) @ carried
        worst = max(worst, float(np.abs(change - moment.ball.inertia(np.zeros(3))).max()))
    return Residual(worst, bound=3e-15, unit="kg m²")


def orthonormal(twist: float) -> Residual:
    """SSᵀ = E after 10 s of (2.6) and dγ/dt = γ×ω, each integrated by itself, ω(t) any."""
    swing = np.array([3.0, -2.0, 1.0])

    def turning(x: Array) -> Array:
        omega = swing * np.cos(swing * x[9])
        rows = [cross(v, omega) for v in x[:9].reshape(3, 3)]
        return np.concatenate([rows[0], twist * rows[1], rows[2], [1.0]])

    start = np.concatenate([f.E.ravel(), [0.0]])
    S = f.followed(turning, start, np.array([0.0, 10.0]))[-1, :9].reshape(3, 3)
    return Residual(float(np.abs(S @ S.T - f.E).max()), bound=1e-11)


def quasi_velocities(twist: float) -> Residual:
    """dS/dt Sᵀ by differences of MuJoCo's attitude, beside its ω."""
    ball = seen(RUBBER)
    S = ball.axes.transpose(0, 2, 1)
    found = rate(S) @ S[INNER].transpose(0, 2, 1)
    expected = np.array([twist * f.hat(omega) for omega in ball.omega[INNER]])
    return Residual(largest((found - expected).reshape(len(found), 9)), 4e-6, unit="rad/s")


# Constraints ---------------------------------------------------------------------------------


def no_slip(twist: float) -> Residual:
    """(2.1): v + aγ×(ω - Ω)."""
    worst = 0.0
    for ball in map(seen, EACH):
        rolled_on = ball.of(lambda n, w, gamma: n.a * cross(gamma, w - twist * n.Omega))[INNER]
        worst = max(worst, largest(ball.centre_velocity + rolled_on))
    return Residual(worst, bound=6e-6, unit="m/s")


def no_spin(twist: float) -> Residual:
    """(2.2): (ω - Ω, γ)."""
    off = [seen(name).of(lambda n, w, g: (w - twist * n.Omega) @ g) for name in (RUBBER, DRIVEN)]
    return Residual(float(np.abs(off).max()), bound=1e-7, unit="rad/s")


# Energy ------------------------------------------------------------------------------------


def kinetic_energy(twist: float) -> Residual:
    """Σ mu²/2 beside mv²/2 + (ω, Iω)/2 + (k, ω), less its value where v = ω = 0."""
    worst = 0.0
    for moment in moments(22):
        ball, n, w, v = moment.ball, moment.ball.numbers, moment.omega, moment.v
        T = ball.momenta(v, w)[2] - ball.momenta(0 * v, 0 * w)[2]
        formula = ball.mass * v @ v / 2 + w @ n.I @ w / 2 + twist * n.k @ w
        worst = max(worst, abs(float(T - formula)))
    return Residual(worst, bound=3e-14, unit="J")


def gyrostatic_momentum(twist: float) -> Residual:
    """Σ r×mu beside Iω + k, where k = Σ jφ̇n - J_sΩ."""
    worst = 0.0
    for moment in moments(23):
        ball, n = moment.ball, moment.ball.numbers
        turning = [r.moment(r.axis) * r.rate * r.axis for r in ball.rotors]
        k = sum(turning, np.zeros(3)) - twist * ball.shell.moment(ball.shell.axis) * n.Omega
        off = ball.momenta(moment.v, moment.omega)[1] - (n.I @ moment.omega + k)
        worst = max(worst, float(np.abs(off).max()))
    return Residual(worst, bound=9e-15, unit="kg m²/s")


CLAIMS = (
    Claim("Figs 3-4", "the structure and the axes", "drawings; `robotball figures 3 4` has ours"),
    Claim(
        "2",
        "the inertia does not change in the frame's axes",
        mass_distribution,
        MASSES,
        "the axes: the shell's",
    ),
    Claim("Remark 1", "α, β and γ stay orthonormal", orthonormal, "scipy", "the sign of dβ/dt"),
    Claim("2", "ω̂ = dS/dt Sᵀ", quasi_velocities, MOTION, "the sign of ω̂"),
    Claim("(2.1)", "v + aγ×(ω - Ω) = 0", no_slip, MOTION, "the sign of Ω"),
    Claim("(2.2)", "rubber: (ω - Ω, γ) = 0", no_spin, MOTION, "the sign of Ω"),
    Claim("2", "T = mv²/2 + (ω, Iω)/2 + (k, ω)", kinetic_energy, MASSES, "the sign of k"),
    Claim("2", "k = Σ jφ̇n - J_sΩ", gyrostatic_momentum, MASSES, "the sign of J_s"),
)

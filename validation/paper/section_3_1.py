"""Section 3.1: the momentum and the integrals of the rubber model."""

from dataclasses import replace
from functools import cache, partial

import numpy as np

from robotball import Scene
from robotball.engines.ensembles.orbits import kernel_start, orbit
from robotball.rotations import Array, rotation_matrix
from robotball.scene import along_momentum, section_state
from validation.paper import formulas as f
from validation.paper.claim import AtLeast, Claim, Residual
from validation.paper.engine import (
    DRIVEN,
    MOTION,
    RUBBER,
    Seen,
    largest,
    seen,
    seen_of,
)
from validation.paper.formulas import Numbers, cross, paper_scene

MOMENTUM = "kg m²/s"
_ROUTH = "routh_sphere"


# The momentum --------------------------------------------------------------------------------


def momentum(n: Numbers, omega: Array, gamma: Array, sign: float = 1.0) -> Array:
    """γ×(Ĩω + K) (3.1), or with another sign of K."""
    return cross(gamma, f.contact_inertia(n, gamma) @ omega + sign * n.K)


def _kept_momentum(twist: float) -> Residual:
    """How far M moves in space, with K as corrected and as printed."""
    ball = seen(RUBBER)
    corrected = ball.of(lambda n, omega, gamma: momentum(n, omega, gamma, twist))
    printed = ball.of(lambda n, omega, gamma: momentum(n, omega, gamma, -1.0))
    return Residual(ball.drift(corrected), 2e-7, ball.drift(printed), MOMENTUM)


def _momentum_of_the_bodies(twist: float) -> Residual:
    """M of (3.1) beside that of MuJoCo's bodies, of which it takes momentum and spin."""
    ball = seen(DRIVEN)
    formula = ball.of(lambda n, omega, gamma: momentum(replace(n, d=twist * n.d), omega, gamma))
    return Residual(largest(formula - ball.momentum), bound=2e-7, unit=MOMENTUM)


def _under_changing_rates(twist: float) -> Residual:
    """How far M moves in space while Ω and K change; twisted, with the K of the start."""
    ball = seen(DRIVEN)
    first = ball.numbers[0].K

    def formula(n: Numbers, omega: Array, gamma: Array) -> Array:
        return momentum(n if twist == 1 else replace(n, K=first), omega, gamma)

    return Residual(ball.drift(ball.of(formula)), bound=2e-7, unit=MOMENTUM)


# The reduced equations -----------------------------------------------------------------------


def _inverse(twist: float) -> Residual:
    """ω of (3.2) beside the ω that (3.1) and (2.2), linear in it, give for M and γ."""
    worst = 0.0
    for state in f.states(31):
        n, gamma, M = state.n, state.gamma, f.level(state.M, state.gamma)
        linear = np.vstack([f.hat(gamma).T @ f.contact_inertia(n, gamma), gamma])
        given = np.append(M - cross(gamma, n.K), n.Omega @ gamma)
        omega = np.linalg.lstsq(linear, given, rcond=None)[0]
        found = f.rubber_velocity(replace(n, Omega=twist * n.Omega), M, gamma)
        worst = max(worst, float(np.abs(found - omega).max()))
    return Residual(worst, bound=1e-13, unit="rad/s")


def velocity(twist: float) -> Residual:
    """ω of (3.2), with the M that the motion starts with, beside MuJoCo's ω."""
    ball = seen(DRIVEN)
    states = zip(ball.numbers, ball.carried(ball.momentum), ball.gamma, strict=True)
    found = [f.rubber_velocity(n, twist * M, gamma) for n, M, gamma in states]
    return Residual(largest(np.array(found) - ball.omega), bound=2e-7, unit="rad/s")


def kept_integrals(
    formula: f.Velocity, n: Numbers, M: Array, gamma: Array, twist: float
) -> Residual:
    """γ², (M, γ) and M² over 20 s of the reduced equations, relative to their sizes."""

    def rate(x: Array) -> Array:
        omega = formula(n, x[:3], x[3:])
        return np.concatenate([twist * cross(x[:3], omega), cross(x[3:], omega)])

    found = f.followed(rate, np.concatenate([M, gamma]), np.linspace(0.0, 20.0, 101))
    M_t, gamma_t = found[:, :3], found[:, 3:]
    size = float(M @ M)
    kept = [(gamma_t**2).sum(1), (M_t * gamma_t).sum(1) / np.sqrt(size), (M_t**2).sum(1) / size]
    return Residual(float(np.ptp(kept, axis=1).max()), bound=1e-10)


def _rubber_integrals(twist: float) -> Residual:
    """Those of Fig. 14's ball."""
    gamma, M = section_state(0.0, 0.6, 0.0, 25.0)
    n = f.numbers(paper_scene("fig14").parameters)
    return kept_integrals(f.rubber_velocity, n, M, gamma, twist)


def three_dimensional(classical: bool, twist: float) -> Residual:
    """The rank of the gradients of F₀, F₁, F₂ at 100 states: how often it is not 3.

    Twisted, at M = 0, where the level is the sphere of section 4.
    """
    wrong = 0
    for state in f.states(32):
        gamma = state.gamma
        M = state.M if classical else f.level(state.M, gamma)
        M = M if twist == 1 else 0 * M
        zero = np.zeros(3)
        gradients = [np.append(zero, gamma), np.append(gamma, M), np.append(M, zero)]
        wrong += bool(np.linalg.matrix_rank(np.array(gradients), tol=1e-9) != 3)
    return Residual(wrong, bound=0, unit="of 100 wrong")


# Energy and measure --------------------------------------------------------------------------


def energies(ball: Seen, classical: bool, twist: float = 1.0) -> Array:
    """(ω, A⁻¹ω)/2 - (Ω, A⁻¹ω), less d(γ, ω-Ω)²/2 if classical, at all times."""

    def energy(n: Numbers, omega: Array, gamma: Array) -> float:
        carried = (n.I + n.d * f.E) @ omega
        spin = gamma @ (omega - n.Omega) if classical else 0.0
        return float(omega @ carried / 2 - twist * n.Omega @ carried - n.d * spin**2 / 2)

    return ball.of(energy)


def _no_energy(twist: float) -> AtLeast:
    """The change of E of Fig. 12's ball; twisted, of Routh's sphere."""
    ball = seen(RUBBER) if twist == 1 else routh(rubber=True)
    E = energies(ball, classical=False)
    return AtLeast(float(np.ptp(E)), bound=1.0, unit="J")


@cache
def routh(rubber: bool) -> Seen:
    """Routh's sphere, all turning on its axis of symmetry, in either model."""
    scene = paper_scene(_ROUTH)
    return seen(_ROUTH) if not rubber else seen_of(_as_rubber(scene), 10.0)


def _as_rubber(scene: Scene) -> Scene:
    """The same ball without spinning, from (L, l) = (3, 0.6) at g = 0 with f = 25."""
    gamma, M = section_state(3.0, 0.6, 0.0, 25.0)
    axes = scene.principal_axes
    return replace(scene, rolling="rubber", start=along_momentum(axes @ gamma, axes @ M))


def _routh_energy(rubber: bool, twist: float) -> Residual:
    """The change of E of Routh's sphere."""
    E = energies(routh(rubber), not rubber, twist)
    return Residual(float(np.ptp(E)), bound=2e-6, unit="J")


def _measure(classical: bool, twist: float) -> Residual:
    """The divergence of ρ times (3.2) or (3.3) for random Routh spheres.

    ρ is (Aγ,γ)^(-1/2), or (1/d - (Aγ,γ))^(-1/2) if classical.
    """
    worst = 0.0
    for state in f.states(33):
        n = symmetric(state.n)
        M = state.M if classical else f.level(state.M, state.gamma)
        worst = max(worst, abs(_divergence(n, M, state.gamma, classical, -0.5 * twist)))
    return Residual(worst, bound=5e-15, unit="1/s")


def symmetric(n: Numbers) -> Numbers:
    """The ball with I₁ = I₂, and with Ω and K along the third axis."""
    I = np.diag(n.I[[0, 0, 2], [0, 0, 2]])
    return replace(f.still(n), I=I, Omega=n.Omega * f.E[2], K=n.K * f.E[2])


def _divergence(n: Numbers, M: Array, gamma: Array, classical: bool, power: float) -> float:
    """Σ ∂(ρ dx/dt)/∂x / ρ at a state x = (M, γ)."""

    def weight(x: Array) -> Array:
        A_gamma_gamma = n.A @ x[3:] @ x[3:]
        return (1 / n.d - A_gamma_gamma if classical else A_gamma_gamma) ** power

    rate = f.reduced(f.classical_velocity if classical else f.rubber_velocity, n)
    state = np.concatenate([M, gamma])
    return float(np.trace(f.jacobian(lambda x: weight(x) * rate(x), state)) / weight(state))


def _no_measure(twist: float) -> AtLeast:
    """How far the volume near a cycle of Fig. 11a is from coming back: |ln det| over a period.

    With a continuous density it would. Twisted, near a motion of Routh's sphere, which has one.
    """
    scene = paper_scene(RUBBER) if twist == 1 else _as_rubber(paper_scene(_ROUTH))
    n, period = f.numbers(scene.parameters), 8.74326
    # Fig. 12's motion is on the cycle after 600 s, to 1e-9.
    times = np.append(0.0, 600.0 + np.linspace(0.0, period, 201))
    parameters, attitude, momentum = kernel_start(scene)
    attitudes, _ = orbit(parameters, attitude[0], momentum[0], times)
    axes = rotation_matrix(attitudes[1:-1])
    growth = [_divergence(n, momentum[0] @ S, S[2], False, -0.5) for S in axes]
    return AtLeast(abs(float(np.mean(growth))) * period, bound=0.1)


CLAIMS = (
    Claim(
        "E1, (3.1)",
        "M = γ×(Ĩω + K), K = k - ma²Ω, stays in space",
        _kept_momentum,
        MOTION,
        "the sign of K",
        printed="M = γ×(Ĩω - K)",
    ),
    Claim(
        "(3.1)", "M is the momentum of the bodies", _momentum_of_the_bodies, MOTION, "the sign of d"
    ),
    Claim(
        "3.1",
        "M stays while Ω and K change in time",
        _under_changing_rates,
        MOTION,
        "K as it began",
    ),
    Claim("(3.2)", "ω(M, γ) solves (3.1) and (2.2)", _inverse, "linear equations", "the sign of Ω"),
    Claim("(3.2)", "ω(M, γ) of the rubber ball", velocity, MOTION, "the sign of M"),
    Claim("3.1", "F₀, F₁ and F₂ stay", _rubber_integrals, "(3.2) by scipy", "the sign of dM/dt"),
    Claim(
        "3.1",
        "the level of F₀, F₁, F₂ has three dimensions",
        partial(three_dimensional, False),
        "rank of the gradients",
        "M = 0",
    ),
    Claim("Remark 5", "in general E is no integral", _no_energy, MOTION, "A, Ω, K on one axis"),
    Claim(
        "Remark 5",
        "A, Ω, K on one axis: E stays; rubber",
        partial(_routh_energy, True),
        MOTION,
        "the sign of (Ω, A⁻¹ω)",
    ),
    Claim(
        "Remark 5",
        "A, Ω, K on one axis: E stays; classical",
        partial(_routh_energy, False),
        MOTION,
        "the sign of (Ω, A⁻¹ω)",
    ),
    Claim(
        "Remark 5",
        "and (Aγ,γ)^(-1/2) dM dγ is kept; rubber",
        partial(_measure, False),
        "divergence of (3.2)",
        "the exponent",
    ),
    Claim(
        "Remark 5",
        "and (1/d - (Aγ,γ))^(-1/2) dM dγ; classical",
        partial(_measure, True),
        "divergence of (3.3)",
        "the exponent",
    ),
    Claim(
        "3.1",
        "in general no measure with continuous density",
        _no_measure,
        "volume around a cycle",
        "A, Ω, K on one axis",
    ),
)

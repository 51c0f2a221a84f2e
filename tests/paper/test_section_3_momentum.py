"""Section 3: momentum, integrals, energy and measure of both models, and reconstruction.

3.1 is about the rubber model, 3.2 about the classical one. Each of their common statements is one
check here, which takes the model.
"""

from dataclasses import replace
from functools import cache, partial

import numpy as np
from scipy.optimize import minimize

from robotball import Scene
from robotball.engines.ensembles.orbits import kernel_start, orbit
from robotball.equations import Rolling
from robotball.rotations import Array, rotation_matrix
from robotball.scene import along_momentum, section_state
from tests.paper import formulas as f
from tests.paper.claim import MINUS, AtLeast, Errors, Section, by
from tests.paper.engine_ball import (
    CLASSICAL,
    DRIVEN,
    MOTION,
    RUBBER,
    Seen,
    largest,
    seen,
    seen_of,
)
from tests.paper.formulas import Numbers, cross, paper_scene

RUBBER_MODEL = Section("3.1. Rolling without slipping and spinning (rubber model)")
CLASSICAL_MODEL = Section("3.2. Rolling without slipping (classical model)")
RECONSTRUCTION = Section("3.3. Reconstruction")

MOMENTUM = "kg m²/s"
_ROUTH_SPHERE = "routh_sphere"
_AS_RUBBER = '"the autonomous system of equations (3.2)"'
_BY_RUBBER = {"formula": f.rubber_velocity}


# The momentum --------------------------------------------------------------------------------


def _momentum(classical: bool, n: Numbers, omega: Array, gamma: Array, sign: float = 1.0) -> Array:
    """Return γ×(Ĩω + K) of (3.1), or Ĩω + K + d(Ω,γ)γ of 3.2; the sign -1 is the printed one."""
    carried = f.contact_inertia(n, gamma) @ omega
    if classical:
        return carried + n.K + sign * n.d * (n.Omega @ gamma) * gamma
    return cross(gamma, carried + sign * n.K)


@cache
def _driven(classical: bool) -> Seen:
    """Roll the ball of Fig. 12 while its rates swing; in the classical model with (M, γ) = 3."""
    if not classical:
        return seen(DRIVEN)
    # (M, γ) = 3, as 0 would hide the terms that the classical model has more than rubber.
    return seen_of(_from_section(paper_scene(DRIVEN), "classical", 3.6, c=3.0), 10.0)


def _from_section(scene: Scene, rolling: Rolling, L: float, c: float = 0.0) -> Scene:
    """Return the ball of a model, from (L, l) = (L, 0.6) at g = 0 with f = 25 and (M, γ) = c."""
    gamma, M = section_state(L, 0.6, 0.0, 25.0, c)
    axes = scene.principal_axes
    return replace(scene, rolling=rolling, start=along_momentum(axes @ gamma, axes @ M))


@RUBBER_MODEL.claim("E1, (3.1)", "M = γ×(Ĩω + K), K = k - ma²Ω, stays in space", "M = γ×(Ĩω - K)")
@by(MOTION, "the sign of K", bound=2e-7, unit=MOMENTUM, printed=MINUS, classical=False)
@CLASSICAL_MODEL.claim("E2, 3.2", "M = Ĩω + K + d(Ω,γ)γ stays in space", "M = Ĩω + K - d(Ω,γ)γ")
@by(
    MOTION,
    "the sign of the last term",
    bound=4e-6,
    unit=MOMENTUM,
    printed=MINUS,
    classical=True,
)
def _kept_momentum(classical: bool, twist: float = 1.0) -> Errors:
    """Measure how far M moves in space, by the corrected and by the printed sign."""
    ball = seen(CLASSICAL if classical else RUBBER)
    yield ball.drift(ball.of(lambda n, w, gamma: _momentum(classical, n, w, gamma, twist)))


@RUBBER_MODEL.claim("(3.1)", "M is the momentum of the bodies")
@by(MOTION, "the sign of d", bound=2e-7, unit=MOMENTUM, classical=False)
@CLASSICAL_MODEL.claim("3.2", "M is the momentum of the bodies")
@by(MOTION, "the sign of d", bound=4e-6, unit=MOMENTUM, classical=True)
def _momentum_of_the_bodies(classical: bool, twist: float = 1.0) -> Errors:
    """Compare M, while Ω and K change, with the momentum and spin of MuJoCo's bodies."""
    ball = _driven(classical)
    formula = ball.of(lambda n, w, gamma: _momentum(classical, replace(n, d=twist * n.d), w, gamma))
    yield largest(formula - ball.momentum)
    ours = ball.of(lambda n, w, gamma: np.array(f.ball(n, classical).momentum(w, gamma)))
    yield largest(ours - ball.momentum)


_K_STAYS = {"constant": True}


@RUBBER_MODEL.claim("3.1", "M stays while Ω and K change in time")
@by(MOTION, "K as it began", _K_STAYS, bound=2e-7, unit=MOMENTUM, classical=False)
@CLASSICAL_MODEL.claim("3.2", "M stays while Ω and K change in time")
@by(MOTION, "K as it began", _K_STAYS, bound=4e-6, unit=MOMENTUM, classical=True)
def _under_changing_rates(classical: bool, constant: bool = False) -> Errors:
    """Measure how far M moves in space while Ω and K change; constant: with the K of the start."""
    ball = _driven(classical)
    first = ball.numbers[0].K

    def formula(n: Numbers, omega: Array, gamma: Array) -> Array:
        return _momentum(classical, replace(n, K=first) if constant else n, omega, gamma)

    yield ball.drift(ball.of(formula))


# The reduced equations -----------------------------------------------------------------------


@RUBBER_MODEL.claim("(3.2)", "ω(M, γ) solves (3.1) and (2.2)")
@by("linear equations", "the sign of Ω", bound=1e-13, unit="rad/s")
def _rubber_inverse(twist: float = 1.0) -> Errors:
    """Compare ω of (3.2) with the solution of (3.1) and (2.2), linear in ω, for M and γ."""
    for state in f.states(31):
        n, gamma, M = state.n, state.gamma, state.momentum(classical=False)
        linear = np.vstack([f.hat(gamma).T @ f.contact_inertia(n, gamma), gamma])
        given = np.append(M - cross(gamma, n.K), n.Omega @ gamma)
        # Four equations for three unknowns: γ×(…) has no part along γ, so they are consistent, and
        # least squares need no choice of three.
        omega = np.linalg.lstsq(linear, given, rcond=None)[0]
        found = f.rubber_velocity(replace(n, Omega=twist * n.Omega), M, gamma)
        yield found - omega
        yield f.ball(n).angular_velocity(M, gamma) - omega


@CLASSICAL_MODEL.claim("(3.3)", "ω(M, γ) solves M = Ĩω + …")
@by("linear equations", "the sign of Ω", bound=3e-14, unit="rad/s")
def _classical_inverse(twist: float = 1.0) -> Errors:
    """Compare ω of (3.3) with the solution of M = Ĩω + K + d(Ω,γ)γ, linear in ω."""
    for state in f.states(34):
        n, gamma = state.n, state.gamma
        given = state.M - n.K - n.d * (n.Omega @ gamma) * gamma
        omega = np.linalg.solve(f.contact_inertia(n, gamma), given)
        found = f.classical_velocity(replace(n, Omega=twist * n.Omega), state.M, gamma)
        yield found - omega
        yield f.ball(n, classical=True).angular_velocity(state.M, gamma) - omega


@RUBBER_MODEL.claim("(3.2)", "ω(M, γ) of the rubber ball")
@by(MOTION, "the sign of M", bound=2e-7, unit="rad/s", classical=False)
@CLASSICAL_MODEL.claim("E5, 3.2", "the reduced system is (3.3)", _AS_RUBBER)
@by(MOTION, "the sign of M", bound=4e-6, unit="rad/s", printed=_BY_RUBBER, classical=True)
def _velocity(classical: bool, twist: float = 1.0, formula: f.Velocity | None = None) -> Errors:
    """Compare ω(M, γ), with the M that the motion starts with, with MuJoCo's ω.

    The classical ball's is printed as (3.2).
    """
    ball, velocity = _driven(classical), formula or f.velocity_of(classical)
    states = zip(ball.numbers, ball.carried(ball.momentum), ball.gamma, strict=True)
    yield largest(np.array([velocity(n, twist * M, gamma) for n, M, gamma in states]) - ball.omega)


@RUBBER_MODEL.claim("3.1", "F₀, F₁ and F₂ stay")
@by("(3.2) by scipy", "the sign of dM/dt", bound=1e-10, name="fig14")
@CLASSICAL_MODEL.claim("3.2", "F₀, F₁ ≠ 0 and F₂ stay")
@by("(3.3) by scipy", "the sign of dM/dt", bound=1e-10, name=CLASSICAL)
def _kept_integrals(name: str, twist: float = 1.0) -> Errors:
    """Compute the changes of γ², (M, γ) and M² over 20 s of the reduced equations, relative."""
    scene = paper_scene(name)
    classical = scene.rolling == "classical"
    gamma, M = section_state(0.0, 0.6, 0.0, 25.0, c=3.0 if classical else 0.0)
    rate = f.reduced(f.velocity_of(classical), f.numbers(scene.parameters))
    sense, start = np.repeat([twist, 1.0], 3), np.concatenate([M, gamma])
    found = f.followed(lambda x: sense * rate(x), start, np.linspace(0.0, 20.0, 101))
    M_t, gamma_t = found[:, :3], found[:, 3:]
    # γ² is 1 and M² is 25: relative to its own size each integral has the same bound.
    size = float(M @ M)
    kept = [(gamma_t**2).sum(1), (M_t * gamma_t).sum(1) / np.sqrt(size), (M_t**2).sum(1) / size]
    yield np.ptp(kept, axis=1)


_NO_M = {"size": 0.0}


@RUBBER_MODEL.claim("3.1", "the level of F₀, F₁, F₂ has three dimensions")
@by("rank of the gradients", "M = 0", _NO_M, bound=0, unit="of 100 wrong", classical=False)
@CLASSICAL_MODEL.claim("3.2", "the level of F₀, F₁, F₂ has three dimensions")
@by("rank of the gradients", "M = 0", _NO_M, bound=0, unit="of 100 wrong", classical=True)
def _three_dimensional(classical: bool, size: float = 1.0) -> Errors:
    """Count how often the gradients of F₀, F₁, F₂ at 100 states have not the rank 3.

    size: times M; at M = 0 the level is the sphere of section 4.
    """
    for state in f.states(32):
        M = size * state.momentum(classical)
        gradients = f.integral_gradients(M, state.gamma)
        yield np.linalg.matrix_rank(gradients, tol=1e-9) != 3


# Energy and measure --------------------------------------------------------------------------


def energies(ball: Seen, classical: bool, twist: float = 1.0) -> Array:
    """Return (ω, A⁻¹ω)/2 - (Ω, A⁻¹ω), less d(γ, ω-Ω)²/2 if classical, at all times."""

    def energy(n: Numbers, omega: Array, gamma: Array) -> float:
        carried = (n.I + n.d * f.E) @ omega
        spin = gamma @ (omega - n.Omega) if classical else 0.0
        return float(omega @ carried / 2 - twist * n.Omega @ carried - n.d * spin**2 / 2)

    return ball.of(energy)


@RUBBER_MODEL.claim("Remark 5", "in general E is no integral")
@by(MOTION, "A, Ω, K on one axis", {"symmetric": True})
def _no_energy(symmetric: bool = False) -> AtLeast:
    """Compute the change of E of Fig. 12's ball; symmetric: of Routh's sphere."""
    # The control is a ball that has the integral, so that it is found where there is one.
    ball = _routh(classical=False) if symmetric else seen(RUBBER)
    E = energies(ball, classical=False)
    return AtLeast(float(np.ptp(E)), bound=1.0, unit="J")


def _rubber_routh() -> Scene:
    """Return Routh's sphere without spinning."""
    return _from_section(paper_scene(_ROUTH_SPHERE), "rubber", 3.0)


@cache
def _routh(classical: bool) -> Seen:
    """Roll Routh's sphere, all turning on its axis of symmetry, in either model."""
    return seen(_ROUTH_SPHERE) if classical else seen_of(_rubber_routh(), 10.0)


@RUBBER_MODEL.claim("Remark 5", "A, Ω, K on one axis: E stays; classical")
@by(MOTION, "the sign of (Ω, A⁻¹ω)", bound=2e-6, unit="J", classical=True)
@RUBBER_MODEL.claim("Remark 5", "A, Ω, K on one axis: E stays; rubber")
@by(MOTION, "the sign of (Ω, A⁻¹ω)", bound=2e-6, unit="J", classical=False)
def _routh_energy(classical: bool, twist: float = 1.0) -> Errors:
    """Compute the change of E of Routh's sphere."""
    yield np.ptp(energies(_routh(classical), classical, twist))


@RUBBER_MODEL.claim("Remark 5", "and (1/d - (Aγ,γ))^(-1/2) dM dγ; classical")
@by("divergence of (3.3)", "the exponent", bound=1e-14, unit="1/s", classical=True)
@RUBBER_MODEL.claim("Remark 5", "and (Aγ,γ)^(-1/2) dM dγ is kept; rubber")
@by("divergence of (3.2)", "the exponent", bound=1e-14, unit="1/s", classical=False)
def _measure(classical: bool, twist: float = 1.0) -> Errors:
    """Compute the divergence of ρ times (3.2) or (3.3) for random Routh spheres.

    ρ is (Aγ,γ)^(-1/2), or (1/d - (Aγ,γ))^(-1/2) if classical.
    """
    for state in f.states(33):
        n, M, gamma = f.still(state.n), state.momentum(classical), state.gamma
        # The divergence of ρ times the field is zero where ρ is the density of an invariant
        # measure.
        yield f.divergence(_symmetric(n), M, gamma, classical, -0.5 * twist)
        # Any other ball keeps no measure, and robotball has what this density grows by.
        yield f.divergence(n, M, gamma, classical, -0.5) - f.ball(n, classical).divergence(gamma)


def _symmetric(n: Numbers) -> Numbers:
    """Return the ball with I₁ = I₂, and with Ω and K along the third axis."""
    I = np.diag(n.I[[0, 0, 2], [0, 0, 2]])
    return replace(f.still(n), I=I, Omega=n.Omega * f.E[2], K=n.K * f.E[2])


@RUBBER_MODEL.claim("3.1", "in general no measure with continuous density")
@by("volume around a cycle", "A, Ω, K on one axis", {"symmetric": True})
def _no_measure(symmetric: bool = False) -> AtLeast:
    """Measure how far the volume near a cycle of Fig. 11a is from coming back: |ln det| per period.

    With a continuous density it would. symmetric: near a motion of Routh's sphere, which has one.
    """
    # Around a closed orbit a continuous density comes back, so volume must, too. The cycle
    # attracts, and so it does not: an exponent that is no zero excludes every such density at once.
    scene = _rubber_routh() if symmetric else paper_scene(RUBBER)
    n, period = f.numbers(scene.parameters), 8.74326
    # Fig. 12's motion is on the cycle after 600 s, to 1e-9.
    times = np.append(0.0, 600.0 + np.linspace(0.0, period, 201))
    parameters, attitude, momentum = kernel_start(scene)
    states = orbit(parameters, attitude[0], momentum[0], times)
    axes = rotation_matrix(states[1:-1, :4])
    growth = [f.divergence(n, momentum[0] @ S, S[2], False, -0.5) for S in axes]
    return AtLeast(abs(float(np.mean(growth))) * period, bound=0.1)


# Reconstruction ------------------------------------------------------------------------------


def _horizontal(ball: Seen) -> tuple[Array, Array, Array]:
    """Return M, M - cγ (n, 3) and √(f - c²) (n,) of a motion."""
    M, gamma = ball.momentum, ball.gamma
    c = (M * gamma).sum(axis=1)
    return M, M - c[:, None] * gamma, np.sqrt((M * M).sum(axis=1) - c * c)


@RECONSTRUCTION.claim("3.3", "α = -(M - cγ)/√(f - c²), β = M×γ/√(f - c²)")
@by(MOTION, "the sign of α", bound=2e-7)
def _space_axes(twist: float = 1.0) -> Errors:
    """Compare α = -(M - cγ)/√(f - c²) and β = M×γ/√(f - c²) with MuJoCo's, where OX is laid so."""
    ball = seen(CLASSICAL)
    M, level, size = _horizontal(ball)
    yield largest(-twist * level / size[:, None] - ball.axes[:, 0])
    yield largest(np.cross(M, ball.gamma) / size[:, None] - ball.axes[:, 1])


@RECONSTRUCTION.claim("3.3", "Ẋ, Ẏ by M and γ; classical")
@by(MOTION, "the sign of Ẏ", bound=6e-6, unit="m/s", name=CLASSICAL)
@RECONSTRUCTION.claim("3.3", "Ẋ, Ẏ by M and γ; rubber")
@by(MOTION, "the sign of Ẏ", bound=1.5e-6, unit="m/s", name=RUBBER)
def _path(name: str, twist: float = 1.0) -> Errors:
    """Compare Ẋ = a(M×γ, ω - Ω)/√(f - c²) and Ẏ = a(M - cγ, ω - Ω)/√(f - c²) with MuJoCo's."""
    ball = seen(name)
    M, level, size = _horizontal(ball)
    shell = ball.of(lambda n, omega, _: n.a * (omega - n.Omega))
    X = (np.cross(M, ball.gamma) * shell).sum(axis=1) / size
    Y = twist * (level * shell).sum(axis=1) / size
    yield ball.path_error(X, Y)


_greatest = partial(
    by, f"{MOTION}, 150 s, over the greatest", "a tenth of M", control={"twist": 0.1}, bound=1.0
)


@RECONSTRUCTION.claim("3.3", "f and c bound the shell's speed; classical")
@_greatest(name=CLASSICAL)
@RECONSTRUCTION.claim("3.3", "f and c bound the shell's speed; rubber")
@_greatest(name="fig14")
def _bounded(name: str, twist: float = 1.0) -> Errors:
    """Compute |ω - Ω| in 150 s of MuJoCo's motion over its maximum for all γ, M with f and c.

    Those of the start; twisted, of a tenth of the momentum.
    """
    scene, ball = paper_scene(name), seen(name, 150.0, 0.05)
    n, velocity = f.numbers(scene.parameters), f.velocity_of(scene.rolling == "classical")
    # The shell's speed at a tenth of M has a lower bound, which the motion passes.
    kept = twist * scene.start.momentum
    size = float(np.linalg.norm(kept))

    def slowness(x: Array) -> float:
        gamma, M = section_state(size * np.sin(x[0]), x[1], x[2], size**2, kept[2])
        return -float(np.linalg.norm(velocity(n, M, gamma) - n.Omega))

    random = np.random.default_rng(35)
    # The search is local, so it begins at several places and the greatest maximum counts.
    starts = random.uniform(0.0, 2 * np.pi, (6, 3))
    most = max(-float(minimize(slowness, x).fun) for x in starts)
    yield largest(ball.omega - n.Omega) / most

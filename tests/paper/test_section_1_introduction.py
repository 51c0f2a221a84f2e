"""Section 1, the introduction: Chaplygin's ball in both models, and the axes of the frame."""

from dataclasses import replace
from functools import cache

import numpy as np

from robotball import integrate, simulate
from robotball.qualitative.sections import period_of, shared_integral
from robotball.rotations import Array
from robotball.scene import Start
from robotball.sensing import of_shell
from tests.paper import formulas as f
from tests.paper.claim import AtLeast, Errors, Section, by
from tests.paper.engine_ball import (
    DRIVEN,
    MOTION,
    NAME,
    RUBBER,
    largest,
    seen,
    seen_of,
)
from tests.paper.formulas import Numbers, cross, paper_scene

SECTION = Section("1. Introduction")
SECTION.unchecked("Figs 1-2", "S. A. Chaplygin; a beaver ball", "photographs: nothing to compute")
claim = SECTION.claim

_TIMES = np.linspace(0.0, 20.0, 201)
# A unit vector in decimal numbers, along no axis, so that no term vanishes by symmetry.
_GAMMA, _OMEGA = np.array([0.6, 0.48, 0.64]), np.array([3.0, -2.0, 1.0])


def chaplygin(A: tuple[float, float, float] = (0.8, 0.6, 0.7)) -> Numbers:
    """Return a ball in which nothing turns."""
    return f.with_A(A, np.zeros(3), np.zeros(3), d=0.9)


def rolling(n: Numbers, omega: Array, rubber: bool) -> tuple[Array, Array]:
    """Integrate (2.4), with λ₀ of (2.5) if `rubber`, from ω; ω and γ (201, 3)."""
    found = f.followed(f.unreduced(n, rubber), np.concatenate([omega, _GAMMA]), _TIMES)
    return found[:, :3], found[:, 3:]


@cache
def _thrown(rubber: bool) -> tuple[Array, Array]:
    """Return ω and γ (201, 3) of Chaplygin's ball in either model."""
    return rolling(chaplygin(), f.level(_OMEGA, _GAMMA) if rubber else _OMEGA, rubber)


@claim("1, par. 2", "Chaplygin's ball keeps its energy")
@by("(2.4) by scipy", "the sign of d", bound=1e-10)
def _kept_energy(twist: float = 1.0) -> Errors:
    """Compute the change of a classical ball's T = (ω, Iω)/2 + mv²/2, v = -aγ×ω; d = ma²."""
    n, (omega, gamma) = chaplygin(), _thrown(rubber=False)
    v = np.cross(gamma, omega)
    T = (omega @ n.I * omega).sum(axis=1) / 2 + twist * n.d * (v * v).sum(axis=1) / 2
    yield np.ptp(T) / T[0]


@claim("1, par. 2", "it keeps the measure (1/d - (Aγ,γ))^(-1/2) dM dγ")
@by("divergence of (3.3)", "the exponent", bound=1e-14, unit="1/s")
def _invariant_measure(twist: float = 1.0) -> Errors:
    """Compute the divergence of ρ times (3.3) for Ω = K = 0, where ρ = (1/d - (Aγ,γ))^(-1/2)."""
    for state in f.states(11):
        # Chaplygin's ball has no drives: the paper's introduction is about Ω = K = 0.
        n = replace(f.still(state.n), Omega=np.zeros(3), K=np.zeros(3))
        yield f.divergence(n, state.M, state.gamma, True, -0.5 * twist)


@claim("1, par. 2", "with M vertical Chaplygin's ball moves as Euler's top")
@by("(2.4) and Euler by scipy", "the sign of d", bound=4e-11)
def _euler(twist: float = 1.0) -> Errors:
    """Compare γ of (2.4) from M = cγ with Euler's γ' = γ×Aγ in the time ct/(1 - d(Aγ,γ)), c = 3."""
    n, c = chaplygin(), 3.0
    omega = np.linalg.solve(f.contact_inertia(n, _GAMMA), c * _GAMMA).astype(float)
    _, gamma = rolling(n, omega, rubber=False)
    speed = c / (1 - twist * n.d * (n.A @ _GAMMA @ _GAMMA))
    top = f.followed(lambda x: speed * cross(x, n.A @ x), _GAMMA, _TIMES)
    yield largest(gamma - top)


@claim("1, par. 3", "the rubber Chaplygin ball keeps (ω, A⁻¹ω)/2")
@by("(2.4)-(2.5) by scipy", "the sign of d", bound=1e-11)
def _rubber_energy(twist: float = 1.0) -> Errors:
    """Compute the change of (ω, A⁻¹ω)/2 of a rubber ball, for which (ω, γ) = 0."""
    n, (omega, _) = chaplygin(), _thrown(rubber=True)
    T = (omega @ (n.I + twist * n.d * f.E) * omega).sum(axis=1) / 2
    yield np.ptp(T) / T[0]


@claim("1, par. 3", "of E/d - A it runs on the tori of the classical ball of A")
@by("(2.4)-(2.5) by scipy", "the sign of A", bound=4e-11)
def _same_tori(twist: float = 1.0) -> Errors:
    """Compute a classical ball's energy, (M, γ) = 0, along the motion of E/d - A's rubber ball.

    At equal γ and M, the rubber ball's being M×γ turned back: both then run on the same tori.
    """
    n = chaplygin()
    other = f.with_A(tuple(1 / n.d - twist * n.moments), np.zeros(3), np.zeros(3))
    omega, gamma = rolling(other, f.level(_OMEGA, _GAMMA), rubber=True)
    L = np.array(
        [f.level(f.contact_inertia(other, v) @ w, v) for w, v in zip(omega, gamma, strict=True)]
    )
    # Where nothing turns inside, the classical energy is (M, ω)/2.
    E = [each @ f.classical_velocity(n, each, v) / 2 for each, v in zip(L, gamma, strict=True)]
    for kept in (np.array(E), shared_integral(f.ball(other), gamma, L)):
        yield np.ptp(kept) / abs(kept[0])


@claim("1, par. 3", "and the windings of both are transversal")
@by(MOTION, "the rubber ball's own", {"name": "rubber_chaplygin_ball"})
def _transversal(name: str = "chaplygin_ball_same_tori") -> AtLeast:
    """Compute the least sine of the angle between ω of MuJoCo's rubber ball and the classical one.

    At the same γ and M×γ. Both vectors turn at ω, so that motions touch where ω has the same axis.
    """
    ball, scene = seen("rubber_chaplygin_ball"), paper_scene(name)
    n, classical = f.numbers(scene.parameters), scene.rolling == "classical"
    momenta = np.cross(ball.momentum, ball.gamma) if classical else ball.momentum
    states = zip(momenta, ball.gamma, strict=True)
    omega = np.array([f.velocity_of(classical)(n, *state) for state in states])
    sizes = np.linalg.norm(ball.omega, axis=1) * np.linalg.norm(omega, axis=1)
    return AtLeast(float((np.linalg.norm(np.cross(ball.omega, omega), axis=1) / sizes).min()), 0.05)


@claim("1, par. 4", "no unlimited acceleration of an unbalanced ball, in 11 turns of its mass")
@by(f"equations; {NAME}", "the level plane", {"tilt": 0.05}, bound=20.0, unit="rad/s")
def _accelerated(tilt: float = 0.0) -> Errors:
    """Yield the shell's speeds, once a turn of a toy's capsule, on a plane that falls by `tilt`.

    The paper says it of other systems [4-6], and 3.3 excludes it of balanced balls. Of this one
    docs/periodic.md has 10⁴ turns, with 18.1 rad/s at most.
    """
    toy = paper_scene("beaver_ball")
    down = (np.sin(tilt), 0.0, -np.cos(tilt))
    start = Start(toy.start.attitude, toy.momentum_of(np.array([8.0, 6.0, 0.0])))
    scene = replace(toy, start=start, gravity_direction=down)
    times = period_of(scene) * np.arange(12.0)
    for motion in (integrate(scene, times, 1e-9), simulate(scene, times)):
        yield np.linalg.norm(of_shell(motion), axis=1)


@claim("1, par. 5", "constant rates: the motion does not depend on the time")
@by(f"{NAME}, from 3 s on", "rates that change", {"name": DRIVEN}, bound=2e-8)
def _autonomous(name: str = RUBBER) -> Errors:
    """Compare γ of MuJoCo's ball from 3 s on with γ of one started there, its hinges at zero."""
    scene = paper_scene(name)
    whole = seen(scene.name)
    i = int(np.searchsorted(whole.motion.times, 3.0 - 1e-9))
    # A rubber ball's M is horizontal by (3.1), and a start is held to that.
    start = Start(whole.motion.attitude[i], whole.motion.momentum[i] * [1.0, 1.0, 0.0])
    again = seen_of(replace(scene, start=start), 5.0)
    off = again.gamma - whole.gamma[i : i + len(again.gamma)]
    yield largest(off)

"""What is ours and not the paper's: balances, symmetries and sums."""

from dataclasses import replace
from functools import partial

import numpy as np
from scipy.integrate import cumulative_simpson

from robotball import sample_times, simulate
from robotball.qualitative.basins import distance, level_points
from robotball.qualitative.cycles import Cycle, monodromy_of
from robotball.qualitative.sections import section
from robotball.qualitative.straight_motions import straight_motion
from robotball.rotations import Array
from robotball.start import along_momentum
from validation.paper import formulas as f
from validation.paper.claim import Claim, Residual
from validation.paper.engine import CLASSICAL, MOTION, RUBBER, largest, seen
from validation.paper.formulas import Numbers, Velocity, cross
from validation.paper.scenes import paper_scene
from validation.paper.section_3_1 import MOMENTUM, energies
from validation.paper.section_5_2 import F, andoyer
from validation.paper.section_5_3 import chaotic, regular, settled, starts

# Balances and symmetries ---------------------------------------------------------------------


def turned_momentum(twist: float) -> Residual:
    """M×γ, M from MuJoCo's bodies, beside the horizontal part of L = Ĩω + K + d(Ω,γ)γ."""
    ball = seen(RUBBER)
    L = ball.of(lambda n, w, g: f.level(f.contact_inertia(n, g) @ w + n.K, g))
    return Residual(largest(twist * np.cross(ball.momentum, ball.gamma) - L), 2e-7, unit=MOMENTUM)


def energy_balance(name: str, bound: float, twist: float) -> Residual:
    """E(t) - E(0) along MuJoCo's motion, beside ∫ -(Ω, (A⁻¹ω + K)×ω) dt."""
    ball = seen(name)

    def power(n: Numbers, omega: Array, _: Array) -> float:
        carried = (n.I + n.d * f.E) @ omega
        return float(-n.Omega @ cross(carried + twist * n.K, omega))

    E = energies(ball, classical=name == CLASSICAL)
    work = cumulative_simpson(ball.of(power), x=ball.motion.times, initial=0)
    return Residual(float(np.abs(E - E[0] - work).max()), bound, unit="J")


def full_rates(n: Numbers, velocity: Velocity, M: Array, gamma: Array) -> Array:
    """dM/dt, dγ/dt and (Ẋ, Ẏ) of section 3.3 (8,)."""
    omega, c = velocity(n, M, gamma), M @ gamma
    size = np.sqrt(M @ M - c * c)
    shell = n.a * (omega - n.Omega) / size
    path = [cross(M, gamma) @ shell, (M - c * gamma) @ shell]
    return np.concatenate([cross(M, omega), cross(gamma, omega), path])


def reversal(classical: bool, twist: float) -> Residual:
    """The rates at (Dγ, ∓DM), beside minus the images of those at (γ, M), if Ωᵢ = Kᵢ = 0."""
    worst, sign = 0.0, 1.0 if classical else -1.0
    velocity = f.classical_velocity if classical else f.rubber_velocity
    D = np.array([1.0, -twist, 1.0])
    for state in f.states(91):
        n = replace(f.still(state.n), Omega=state.n.Omega * [1, 0, 1], K=state.n.K * [1, 0, 1])
        M = state.M if classical else f.level(state.M, state.gamma)
        here = full_rates(n, velocity, M, state.gamma)
        there = full_rates(n, velocity, sign * D * M, D * state.gamma)
        off = np.concatenate([there[:3] + sign * D * here[:3], there[3:6] + D * here[3:6]])
        worst = max(worst, float(np.abs(off).max()))
    return Residual(worst, bound=1e-14)


def mirror(twist: float) -> Residual:
    """The rates at (-γ, -M): those of M, γ turned round, Ẋ the same and Ẏ turned round."""
    worst = 0.0
    for state in f.states(92):
        n, M = f.still(state.n), f.level(state.M, state.gamma)
        here = full_rates(n, f.rubber_velocity, M, state.gamma)
        there = full_rates(n, f.rubber_velocity, -M, -state.gamma)
        image = here * [*[-1.0] * 6, 1.0, -twist]
        worst = max(worst, float(np.abs(there - image).max()))
    return Residual(worst, bound=1e-14)


def own_mirror_image(twist: float) -> Residual:
    """How far -γ, -M of Fig. 11a's cycle are from it: they cross g = π where γ, M cross g = 0."""
    cycle = settled()[0]
    away = distance(-twist * points(cycle), points(cycle, g=np.pi if twist == 1 else 0.3))
    return Residual(float(away.max()), bound=3e-13)


def points(cycle: Cycle, g: float = 0.0) -> Array:
    """γ and M/|M| side by side (4, 6) at four crossings of a periodic orbit."""
    through = section(regular(), cycle.attitude[None], cycle.momentum[None], count=4, g=g)
    return level_points(through.attitudes, cycle.momentum[None])[0]


def sum_on_a_cycle(twist: float) -> Residual:
    """ln det of the monodromy of Fig. 11a's cycle, beside ∫ -(Aγ, γ×Ω)/(Aγ,γ) dt."""
    cycle = settled()[0]
    _, monodromy, volume = monodromy_of(regular(), cycle.attitude, cycle.momentum, cycle.period)
    return Residual(float(np.log(np.linalg.det(monodromy))) - twist * volume, bound=2e-13)


def sum_on_straight_lines(twist: float) -> Residual:
    """The eigenvalues near classical motions with ω = 0, beside (Aγ, γ×Ω)/(1/d - (Aγ,γ))."""
    ball, off = paper_scene(CLASSICAL).parameters, 0.0
    n = f.numbers(ball)
    for gamma in np.array([[0.6, 0.48, 0.64], [-0.8, 0.36, -0.48], [0.48, -0.8, 0.36]]):
        A_gamma = n.A @ gamma
        divergence = A_gamma @ cross(gamma, n.Omega) / (1 / n.d - A_gamma @ gamma)
        found = straight_motion(ball, gamma).eigenvalues.sum().real
        off = max(off, abs(float(found - twist * divergence)))
    return Residual(off, bound=2e-14, unit="1/s")


def straight_classical(twist: float) -> Residual:
    """Where MuJoCo's classical ball, from M = K + d(Ω,γ)γ, is after 5 s, beside a|γ×Ω|t."""
    scene, gamma = paper_scene(CLASSICAL), np.array([0.6, 0.48, 0.64])
    n = f.numbers(scene.parameters)
    M = n.K + twist * n.d * (n.Omega @ gamma) * gamma
    scene = replace(scene, start=along_momentum(gamma, M))
    path = simulate(scene, sample_times(5.0)).contact_point
    far = 5.0 * n.a * float(np.linalg.norm(cross(gamma, n.Omega)))
    return Residual(float(np.linalg.norm(path[-1])) - far, bound=2e-12, unit="m")


def one_way(twist: float) -> Residual:
    """How many of 64 orbits of Fig. 11b cross g = 0 in one direction only, in 1000 crossings.

    An orbit may keep to one direction for a while: two of these do for 50 crossings. Twisted, in
    the first 5.
    """
    count = 1000 if twist == 1 else 5
    found = section(chaotic(), *starts(64), count=count, tolerance=1e-9)
    both = (found.directions == 1).any(axis=1) & (found.directions == -1).any(axis=1)
    return Residual(int(np.count_nonzero(~both)), bound=0, unit="of 64 do not")


def without_angles(twist: float) -> Residual:
    """(M×γ)₃ beside -√(f - L²) sin g, by (5.5) at random L, l and g."""
    random, worst = np.random.default_rng(94), 0.0
    for _ in range(100):
        L, l, g = random.uniform(-5, 5), *random.uniform(0, 2 * np.pi, 2)
        third = cross(*andoyer(L, l, g))[2]
        worst = max(worst, abs(float(third + twist * np.sqrt(F - L**2) * np.sin(g))))
    return Residual(worst, bound=1e-14, unit=MOMENTUM)


CLAIMS = (
    Claim("3.1", "M×γ is the horizontal part of L", turned_momentum, MOTION, "the sign of M"),
    Claim(
        "3.1",
        "dE/dt = -(Ω, (A⁻¹ω + K)×ω)",
        partial(energy_balance, RUBBER, 1.5e-6),
        MOTION,
        "sign of K",
    ),
    Claim(
        "3.2", "dE/dt: classical", partial(energy_balance, CLASSICAL, 1e-5), MOTION, "the sign of K"
    ),
    Claim(
        "3.1",
        "Ωᵢ = Kᵢ = 0: (γ, M, t) → (Dγ, -DM, -t)",
        partial(reversal, False),
        "(3.2) at random states",
        "D by another axis too",
    ),
    Claim(
        "3.2",
        "classical: (γ, M, t) → (Dγ, DM, -t)",
        partial(reversal, True),
        "(3.3) at random states",
        "D by another axis too",
    ),
    Claim(
        "3.2",
        "classical: M = K + d(Ω,γ)γ rolls straight at a|γ×Ω|",
        straight_classical,
        MOTION,
        "the sign of d",
    ),
    Claim(
        "5.2", "(M×γ)₃ = -√(f - L²) sin g", without_angles, "(5.5) at random L, l, g", "the sign"
    ),
    Claim(
        "5.2", "each orbit crosses g = 0 in both directions", one_way, "the section", "5 crossings"
    ),
    Claim(
        "5.3",
        "(γ, M) → (-γ, -M) reverses dY/dt alone",
        mirror,
        "(3.2) and (3.3) at random states",
        "the sign of Ẏ",
    ),
    Claim(
        "Fig. 11a",
        "the periodic motion is its own image by that",
        own_mirror_image,
        "the section",
        "g, sign",
    ),
    Claim(
        "5.3",
        "rubber: the exponents' sum is the mean divergence",
        sum_on_a_cycle,
        "the monodromy",
        "the sign",
    ),
    Claim(
        "5.3", "classical: the same, where ω = 0", sum_on_straight_lines, "eigenvalues", "the sign"
    ),
)

"""Statements of our own about the ball, checked as those of the paper are.

Balances, symmetries and sums; the balls that can be built; the numbers of the motions of its
figures.
"""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache, partial

import numpy as np
from scipy.integrate import cumulative_simpson

from robotball import InputError, sample_times, simulate
from robotball import equations as eq
from robotball.ball import beyond_the_shell, check_inertia
from robotball.designing import masses_allowed
from robotball.engines.ensembles.orbits import kernel_start
from robotball.qualitative import straight_motions as lines
from robotball.qualitative.cycles import Cycle, monodromy_of, nearest
from robotball.qualitative.equilibria import proposition_2
from robotball.qualitative.long_run import (
    CHAOS,
    TORUS,
    Basins,
    Drift,
    basins,
    drift,
    exponents,
)
from robotball.qualitative.normal_forms import flow_near, lyapunov_value
from robotball.qualitative.sections import section
from robotball.rotations import Array, on_circle, tangents
from robotball.scene import along_momentum
from tests.paper import formulas as f
from tests.paper.captions import CAPTIONS, line_ball
from tests.paper.claim import Errors, Residual, Section, Value, by
from tests.paper.engine_ball import CLASSICAL, MOTION, RUBBER, largest, seen
from tests.paper.formulas import Numbers, Velocity, cross, paper_scene
from tests.paper.point_masses import MASSES, Body, moments
from tests.paper.test_section_3_momentum import MOMENTUM, energies
from tests.paper.test_section_4_2_with_k import cycle, foci, four_fewer, growth_in_a_turn
from tests.paper.test_section_5_1_straight_lines import F, andoyer, line
from tests.paper.test_section_5_3_attractors import (
    LONG,
    chaotic,
    ensemble,
    regular,
    settled,
    starts,
)

SECTION = Section("Ours, not the paper's")
claim = SECTION.claim

# Balances and symmetries ---------------------------------------------------------------------


@claim("3.1", "M×γ is the horizontal part of L")
@by(MOTION, "the sign of M", bound=2e-7, unit=MOMENTUM)
def _turned_momentum(twist: float = 1.0) -> Errors:
    """Compare M×γ, M from MuJoCo's bodies, with the horizontal part of L = Ĩω + K + d(Ω,γ)γ."""
    ball = seen(RUBBER)
    L = ball.of(lambda n, w, g: f.level(f.contact_inertia(n, g) @ w + n.K, g))
    yield largest(twist * np.cross(ball.momentum, ball.gamma) - L)


@claim("3.2", "dE/dt: classical")
@by(MOTION, "the sign of K", bound=1e-5, unit="J", name=CLASSICAL)
@claim("3.1", "dE/dt = -(Ω, (A⁻¹ω + K)×ω)")
@by(MOTION, "sign of K", bound=1.5e-6, unit="J", name=RUBBER)
def _energy_balance(name: str, twist: float = 1.0) -> Errors:
    """Compare E(t) - E(0) along MuJoCo's motion with ∫ -(Ω, (A⁻¹ω + K)×ω) dt."""
    ball, classical = seen(name), name == CLASSICAL
    n, omega, gamma = ball.numbers[0], tuple(ball.omega.T), tuple(ball.gamma.T)
    ours = eq.energy(omega, gamma, tuple(n.Omega), tuple(n.moments), n.d, spinning=classical)
    power = ball.of(lambda n, w, _: -n.Omega @ cross((n.I + n.d * f.E) @ w + twist * n.K, w))
    work = cumulative_simpson(power, x=ball.motion.times, initial=0)
    for E in (energies(ball, classical), ours):
        yield E - E[0] - work


def _full_rates(n: Numbers, velocity: Velocity, M: Array, gamma: Array) -> Array:
    """Return dM/dt, dγ/dt and (Ẋ, Ẏ) of section 3.3 (8,)."""
    omega, c = velocity(n, M, gamma), M @ gamma
    size = np.sqrt(M @ M - c * c)
    shell = n.a * (omega - n.Omega) / size
    path = [cross(M, gamma) @ shell, (M - c * gamma) @ shell]
    return np.concatenate([cross(M, omega), cross(gamma, omega), path])


@claim("3.2", "classical: (γ, M, t) → (Dγ, DM, -t)")
@by("(3.3) at random states", "D by another axis too", bound=1e-14, classical=True)
@claim("3.1", "Ωᵢ = Kᵢ = 0: (γ, M, t) → (Dγ, -DM, -t)")
@by("(3.2) at random states", "D by another axis too", bound=1e-14, classical=False)
def _reversal(classical: bool, twist: float = 1.0) -> Errors:
    """Compare the rates at (Dγ, ∓DM) with minus the images of those at (γ, M), if Ωᵢ = Kᵢ = 0."""
    sign = 1.0 if classical else -1.0
    velocity = f.velocity_of(classical)
    D = np.array([1.0, -twist, 1.0])
    for state in f.states(91):
        n = replace(f.still(state.n), Omega=state.n.Omega * [1, 0, 1], K=state.n.K * [1, 0, 1])
        M = state.momentum(classical)
        here = _full_rates(n, velocity, M, state.gamma)
        there = _full_rates(n, velocity, sign * D * M, D * state.gamma)
        yield np.concatenate([there[:3] + sign * D * here[:3], there[3:6] + D * here[3:6]])


@claim("3.2", "classical: M = K + d(Ω,γ)γ rolls straight at a|γ×Ω|")
@by(MOTION, "the sign of d")
def _straight_classical(twist: float = 1.0) -> Residual:
    """Compare the way of MuJoCo's classical ball, from M = K + d(Ω,γ)γ, in 5 s with a|γ×Ω|t."""
    scene, gamma = paper_scene(CLASSICAL), np.array([0.6, 0.48, 0.64])
    n = f.numbers(scene.parameters)
    M = n.K + twist * n.d * (n.Omega @ gamma) * gamma
    scene = replace(scene, start=along_momentum(gamma, M))
    path = simulate(scene, sample_times(5.0)).contact_point
    far = 5.0 * n.a * float(np.linalg.norm(cross(gamma, n.Omega)))
    return Residual(float(np.linalg.norm(path[-1])) - far, bound=2e-12, unit="m")


@claim("3.2", "classical: the straight lines of an f and a c")
@by("all round (K + dΩ, γ) = c", "the sign of d", bound=0, unit="of 50 wrong")
def _classical_lines(twist: float = 1.0) -> Errors:
    """Count the balls whose lines with an f and a c are not where γ with (M, γ) = c has M² = f.

    There M = K + d(Ω,γ)γ. f and c are those of a random line, so that there is one.
    """
    turn = np.linspace(0.0, 2 * np.pi, 20001)
    for state in f.states(93, 50):
        n, gamma = f.still(state.n), state.gamma
        M = n.K + n.d * (n.Omega @ gamma) * gamma
        level, c, axis = float(M @ M), float(M @ gamma), n.K + n.d * n.Omega
        across, foot = tangents(f.unit(axis)), c * axis / (axis @ axis)
        circle = foot + np.sqrt(1 - foot @ foot) * on_circle(across, turn)
        along = twist * n.d * (circle @ n.Omega)
        off = ((n.K + along[:, None] * circle) ** 2).sum(axis=1) - level
        meets = circle[:-1][off[1:] * off[:-1] < 0]
        found = lines.straight_motions(f.ball(n, classical=True), level, c)
        apart = [np.linalg.norm(meets - each.gamma, axis=1) for each in found]
        # As many, and each near one of the others, which are known to a step of the circle.
        yield len(found) != len(meets) or any(
            np.min(apart, axis=axis).max() > turn[1] for axis in (0, 1)
        )


@claim("Prop. 2", "dr/dt = l₁r³: l₁ = B/(8a₃A₁A₂(A₁ + A₂))")
@by("a turn about Γ₅ by scipy", "the sign of A₂", bound=2e-2)
def _focus_by_how_much(twist: float = 1.0) -> Errors:
    """Compare how γ₁ grows in a turn from ±0.01 with l₁ by Prop. 2's numbers, and by robotball's.

    Where γ is off by r Re(q e^iφ), with the eigenvector q of length 1, γ₁ has √(A₂/(A₁ + A₂)) of r.
    """
    for n, _ in foci()[:6]:
        A1, A2, B = proposition_2(f.ball(n))
        rate = B / (8 * n.moments[2] * A1 * A2 * (A1 + twist * A2))
        period, share = 2 * np.pi * n.moments[2] / np.sqrt(A1 * A2), A2 / (A1 + A2)
        # The mean of both sides is free of r⁴; r⁵ leaves 0.8 %.
        growth = (growth_in_a_turn(n, 0.01) - growth_in_a_turn(n, -0.01)) / 2
        for each in (rate, lyapunov_value(flow_near(f.ball(n), f.E[2]), 2)):
            yield growth * share / (period * 0.01**3 * each) - 1


@claim("5.2", "(M×γ)₃ = -√(f - L²) sin g")
@by("(5.5) at random L, l, g", "the sign", bound=1e-14, unit=MOMENTUM)
def _without_angles(twist: float = 1.0) -> Errors:
    """Compare (M×γ)₃ with -√(f - L²) sin g, by (5.5) at random L, l and g."""
    random = np.random.default_rng(94)
    for _ in range(100):
        L, l, g = random.uniform(-5, 5), *random.uniform(0, 2 * np.pi, 2)
        third = cross(*andoyer(L, l, g))[2]
        yield third + twist * np.sqrt(F - L**2) * np.sin(g)


@claim("5.2", "each orbit crosses g = 0 in both directions")
@by("the section", "5 crossings", {"count": 5}, bound=0, unit="of 64 do not")
def _one_way(count: int = 1000) -> Errors:
    """Count how many of 64 orbits of Fig. 11b cross g = 0 in one direction only, in 1000 crossings.

    An orbit may keep to one direction for a while: two of these do for 50 crossings.
    """
    found = section(chaotic(), *starts(64), count=count, tolerance=1e-9)
    both = (found.directions == 1).any(axis=1) & (found.directions == -1).any(axis=1)
    yield int(np.count_nonzero(~both))


@claim("5.3", "(γ, M) → (-γ, -M) reverses dY/dt alone")
@by("(3.2) and (3.3) at random states", "the sign of Ẏ", bound=1e-14)
def _mirror(twist: float = 1.0) -> Errors:
    """Compare the rates at (-γ, -M) with those at (γ, M): of M, γ and Y the sign is the other."""
    for state in f.states(92):
        n, M = f.still(state.n), state.momentum(classical=False)
        here = _full_rates(n, f.rubber_velocity, M, state.gamma)
        there = _full_rates(n, f.rubber_velocity, -M, -state.gamma)
        image = here * [*[-1.0] * 6, 1.0, -twist]
        yield there - image


@claim("Fig. 11a", "the periodic motion is its own image by that")
@by("the section", "g, sign", {"twist": -1.0, "g": 0.3}, bound=3e-13)
def _own_mirror_image(twist: float = 1.0, g: float = np.pi) -> Errors:
    """Measure how far -γ, -M of Fig. 11a's cycle are from it.

    They cross g = π where γ, M cross g = 0.
    """
    cycle = settled()[0]
    yield nearest(-twist * points(cycle), points(cycle, g))


def points(cycle: Cycle, g: float = 0.0) -> Array:
    """Return γ and M/|M| side by side (4, 6) at four crossings of a periodic orbit."""
    return section(regular(), cycle.attitude[None], cycle.momentum[None], count=4, g=g).states[0]


@claim("5.3", "rubber: the exponents' sum is the mean divergence")
@by("the monodromy", "the sign")
def _sum_on_a_cycle(twist: float = 1.0) -> Residual:
    """Compare ln det of the monodromy of Fig. 11a's cycle with ∫ -(Aγ, γ×Ω)/(Aγ,γ) dt."""
    cycle = settled()[0]
    _, monodromy, volume = monodromy_of(regular(), cycle.attitude, cycle.momentum, cycle.period)
    return Residual(float(np.log(np.linalg.det(monodromy))) - twist * volume, bound=2e-13)


@claim("5.3", "classical: the same, where ω = 0")
@by("eigenvalues", "the sign", bound=2e-14, unit="1/s")
def _sum_on_straight_lines(twist: float = 1.0) -> Errors:
    """Compare the eigenvalues near classical motions with ω = 0 with (Aγ, γ×Ω)/(1/d - (Aγ,γ))."""
    ball = paper_scene(CLASSICAL).parameters
    n = f.numbers(ball)
    for gamma in np.array([[0.6, 0.48, 0.64], [-0.8, 0.36, -0.48], [0.48, -0.8, 0.36]]):
        A_gamma = n.A @ gamma
        divergence = A_gamma @ cross(gamma, n.Omega) / (1 / n.d - A_gamma @ gamma)
        yield lines.straight_motion(ball, gamma).eigenvalues.sum().real - twist * divergence


# The numbers of the figures' motions ---------------------------------------------------------

# A statement that is a number: twisted, the number by a hundredth.
_number = partial(by, twist="the number, by a hundredth", control={"twist": 1.01})


@claim("4.2", "|κ₂| = 1 at K₃ = 2.08207: Θ disappears")
@_number("search", bound=0, unit="points off", K3=2.08207, more=6)
@claim("4.2", "|κ₁| = 1 at K₃ = 0.51503: Δ disappears")
@_number("search", bound=0, unit="points off", K3=0.51503, more=10)
def _vanishing(K3: float, more: int, twist: float = 1.0) -> Errors:
    """Count how far the numbers of fixed points beside K₃ are from `more` and four less."""
    yield from four_fewer(twist * K3, 1e-4, more, 200)


@claim("Fig. 8", "the period of its limit cycle")
@_number("Newton", name="fig08", stated=6.09094, within=1e-5)
@claim("Fig. 7", "the period of its limit cycle")
@_number("Newton", name="fig07", stated=60.0086, within=1e-4)
def _cycle_period(name: str, stated: float, within: float, twist: float = 1.0) -> Value:
    """Compute the period of the only limit cycle of a figure."""
    found = cycle(name)
    period = found.period if found else float("nan")
    return Value(float(period), twist * stated, within, unit="s")


@claim("Fig. 10", "16/7.69 does not depend on Ω₃")
@by("eigenvalues; stability_limit", "K₁, by a tenth", {"twist": 1.1}, bound=0, unit="of 4 wrong")
def _limit_for_any_turning(twist: float = 1.0) -> Errors:
    """Count the Ω₃ of 0.5, 1, 2, 4 at which σ₋ is not stable below and unstable above 16/7.69."""
    for Omega3 in (0.5, 1.0, 2.0, 4.0):
        n = line_ball(Omega3)
        n = replace(n, K=n.K * [twist, 1.0, 1.0])
        rates = [line(n, 16 / 7.69 * side, "σ₋").rates.real.max() for side in (0.999, 1.001)]
        limit = lines.stability_limit(f.ball(n)) or 0.0
        yield not (rates[0] < 0 < rates[1] and abs(limit - 16 / 7.69) < 1e-12)


@claim("Fig. 10", "at f = 3 all four are saddle-foci")
@by("eigenvalues", "f = 2", {"level": 2.0}, bound=0, unit="of 4 off")
def _saddle_foci(level: float = 3.0) -> Errors:
    """Count the lines at a level f that are no saddle-foci: a real rate, a pair of other sign."""
    for name in ("σ₊", "σ₋", "δ₊", "δ₋"):
        rates = line(line_ball(), level, name).rates
        real, pair = rates[np.abs(rates.imag) < 1e-9].real, rates[np.abs(rates.imag) > 1e-9].real
        yield not (len(real) == 1 and len(pair) == 2 and real[0] * pair[0] < 0)


@claim("Fig. 11a", "the period of its periodic orbit")
@_number("Newton")
def period(twist: float = 1.0) -> Value:
    """Compute the period of Fig. 11a's periodic orbit."""
    return Value(float(settled()[0].period), twist * 8.74326, bound=1e-5, unit="s")


@claim("Fig. 11a", "|multiplier|")
@_number("the monodromy")
def _multiplier(twist: float = 1.0) -> Value:
    """Compute the modulus of the periodic orbit's multipliers, a complex pair."""
    found = float(np.abs(settled()[0].multipliers).max())
    return Value(found, twist * 0.92816, bound=1e-5)


@cache
def reached() -> Basins:
    """Find where 64 starts of Fig. 11a end up."""
    return basins(regular(), *starts(64))


@claim("Fig. 11a", "one periodic orbit attracts, and else a torus")
@by("64 starts", "Fig. 11b", {"chaos": True})
def _attracting_cycles(chaos: bool = False) -> Value:
    """Count the periodic orbits that attract, of 64 starts; what else attracts must be a torus.

    chaos: of 8 starts of Fig. 11b.
    """
    found = basins(chaotic(), *starts(8)) if chaos else reached()
    number = len(found.cycles) if found.share(CHAOS) == 0 else float("nan")
    return Value(number, corrected=1, bound=0, unit="cycle")


@cache
def _velocities(on_torus: bool) -> Array:
    """Return the mean velocities along OX of the starts that reach a torus, or of the others."""
    attitudes, momenta = starts(64)
    chosen = (reached().labels == TORUS) == on_torus
    return drift(regular(), attitudes[chosen], momenta[chosen], 2e4, 3000.0).velocities[:, 0]


@claim("Fig. 11a", "one torus: all on it have the same drift")
@by("2e4 s", "all starts", {"kinds": (True, False)}, bound=1e-3, unit="m/s")
def _one_torus(kinds: Sequence[bool] = (True,)) -> Errors:
    """Measure how far the mean velocities of all starts that reach a torus, or not, are apart."""
    # Means over T = 2e4 s of a motion with two frequencies are off by some 1/T.
    yield np.ptp(np.concatenate([_velocities(each) for each in kinds]))


_in_chaos = partial(by, "16 runs of 1e5 s", "the number, by a tenth", control={"twist": 1.1})


@claim("5.3", "D to a further digit")
@_in_chaos(index=2, stated=1.832, within=5.5e-3)
@claim("5.3", "Λ₆ to a further digit")
@_in_chaos(index=1, stated=-0.139, within=2e-3)
@claim("5.3", "Λ₁ to a further digit")
@_in_chaos(index=0, stated=0.116, within=2e-3)
def _further_digit(index: int, stated: float, within: float, twist: float = 1.0) -> Value:
    """Compute Λ₁, Λ₆ or D of Fig. 11b."""
    found = *ensemble().mean, ensemble().dimension
    return Value(found[index], twist * stated, within)


@claim("5.3", "the classical ball is chaotic too: λ₁")
@by("16 runs of 1e4 s", "rubber", {"rubber": True})
def _classical_exponent(rubber: bool = False) -> Value:
    """Compute λ₁ of the classical ball with Fig. 14's numbers and c = 3, or of the rubber one."""
    ball = paper_scene(CLASSICAL).parameters
    found = ensemble() if rubber else exponents(ball, *starts(16, c=3.0), 1e4)
    return Value(found.mean[0], corrected=0.34, bound=5e-3, unit="1/s")  # ± 0.001


@cache
def _drift_of(name: str) -> Drift:
    """Return the mean motion of a figure's contact point; of Fig. 12 over whole periods."""
    if name == "fig14":
        return drift(chaotic(), *starts(16), LONG)
    duration = 1000 * settled()[0].period if name == "fig12" else LONG
    return drift(*kernel_start(paper_scene(name)), duration, 3000.0)


@claim("Fig. 14", "drift along X")
@_number("16 runs of 1e5 s", name="fig14", stated=3.276, within=1e-2)
@claim("Fig. 13", "drift along X")
@_number("1e5 s", name="fig13", stated=3.665, within=1e-3)
@claim("Fig. 12", "drift along X")
@_number("1000 periods", name="fig12", stated=3.65907, within=1e-5)
def _drift_along(name: str, stated: float, within: float, twist: float = 1.0) -> Value:
    """Compute the drift along OX = -M/√f."""
    return Value(float(_drift_of(name).mean[0]), twist * stated, within, unit="m/s")


@claim("Figs 12-14", "no drift along Y")
@by("1e5 s", "along OX", {"axis": 0})
def _drift_across(axis: int = 1) -> Residual:
    """Compute the drift along OY in Figs 12, 13 and 14, the largest; axis 0: along OX."""
    across = [float(_drift_of(name).mean[axis]) for name in ("fig12", "fig13", "fig14")]
    # Fig. 14's is a mean of chaos: the standard error is 1.3e-3.
    return Residual(max(across, key=abs), bound=8e-3, unit="m/s")


# Balls that can be built --------------------------------------------------------------------


@claim("App. A", "b = 1/a: a body has I iff d ≤ Σb - 2 max b")
@by("random bodies", "the sign of max b", bound=0, unit="of 1000 wrong")
def _triangle_inequality(twist: float = 1.0) -> Errors:
    """Count how often d ≤ Σb - 2 max b, b = 1/a, is wrong about I = b - d being that of a body."""
    random = np.random.default_rng(5)
    for _ in range(1000):
        b = random.uniform(1.0, 3.0, 3)
        d = random.uniform(0.0, b.min())
        yield (d <= b.sum() - 2 * twist * b.max()) != _is_an_inertia(np.diag(b - d))


def _is_an_inertia(tensor: Array) -> bool:
    """Return whether a rigid body can have the inertia (3, 3)."""
    try:
        check_inertia("body", tensor)
    except InputError:
        return False
    return True


@claim("App. A", "mass inside needs d ≥ Σb/5, max b ≤ (2/5)Σb")
@by("random clouds", "1/5, to 2/5", control={"twist": 0.5}, bound=0, unit="of 1000 wrong")
def _mass_inside(twist: float = 1.0) -> Errors:
    """Count the clouds of masses within for which not d ≥ Σb/5 and max b ≤ (2/5) Σb, of 1000."""
    random = np.random.default_rng(6)
    for _ in range(1000):
        masses, r = random.uniform(size=20), random.normal(size=(20, 3))
        r *= random.uniform(0.3, 1.0) / np.linalg.norm(r, axis=1, keepdims=True)
        r *= [1.0, 1.0, random.uniform()]
        d = masses.sum()  # a = 1
        I = np.eye(3) * (masses @ (r * r).sum(axis=1)) - np.einsum("n,ni,nj->ij", masses, r, r)
        b = np.linalg.eigvalsh(I) + d
        yield not (b.sum() / 5 <= twist * d and b.max() <= 0.4 * b.sum())


_largest_d = partial(by, "I and d", "the largest d, by a hundredth", {"twist": 1.01}, bound=3e-5)


@claim("Figs 9-10", "max b = 0.4762 Σb; m ≤ 1/3, below Σb/5")
@_largest_d(name="fig10", stated=(0.47619, 1.4, 1 / 3))
@claim("Figs 5-8", "max b = 0.4255 Σb; m ≤ 7/6, below Σb/5")
@_largest_d(name="fig06", stated=(0.42553, 1.56667, 7 / 6))
@claim("Figs 11-14", "max b = 0.3836 Σb; 0.869 ≤ m ≤ 1.012")
@_largest_d(name="fig14", stated=(0.38356, 0.86905, 1.0119))
def limits(name: str, stated: tuple[float, float, float], twist: float = 1.0) -> Errors:
    """Compare max b/Σb, Σb/5 and Σb - 2 max b of a figure's A with the stated ones; relative."""
    b = 1 / np.array(paper_scene(name).parameters.A)
    found = np.array([b.max() / b.sum(), *masses_allowed(np.diag(b), 1.0)])
    yield found / stated / [1, 1, twist] - 1


@claim("Figs 5-14", "only the balls of 11 to 14 can be built")
@by("their bodies", "the other ones", {"sound": False}, bound=0, unit="of 11 wrong")
def _buildable(sound: bool = True) -> Errors:
    """Count the balls of the catalog that can be built though it says not, or the reverse."""
    for name in (*CAPTIONS, "fig10_stable"):
        stated = (name in ("fig12", "fig13", "fig14")) == sound
        yield stated == bool(beyond_the_shell(paper_scene(name).ball))


@claim("(A.3)", "one rotor along K + (J_s + d)Ω gives any K")
@by(MASSES, "the sign of d", bound=1e-14, unit=MOMENTUM)
def _one_rotor(twist: float = 1.0) -> Errors:
    """Compare K, by Σ r×mu of balls with one rotor, with the wanted one.

    The rotor is along K + (J_s + d)Ω and turns at |K + (J_s + d)Ω|/j.
    """
    random = np.random.default_rng(7)
    for moment in moments(93, rotors=0):
        bare, wanted = moment.ball, random.normal(size=3)
        rotor = Body(np.full(4, 0.01), np.zeros((4, 3)), np.zeros(3), f.E[2])
        d = (bare.mass + rotor.mass) * bare.a**2
        needed = wanted + (bare.shell.moment(bare.shell.axis) + twist * d) * bare.Omega
        axis = f.unit(needed)
        points = 0.2 * np.concatenate([tangents(axis), -tangents(axis)])
        rate = float(np.linalg.norm(needed)) / (rotor.mass * 0.2**2)
        turning = replace(rotor, points=points, axis=axis, rate=rate)
        ball = replace(bare, rotors=(turning,))
        k = ball.momenta(np.zeros(3), np.zeros(3))[1]
        yield k - d * ball.Omega - wanted

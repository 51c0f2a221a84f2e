"""Sections 5.2 and 5.3: the section by (5.5), exponents, drift; Figs 11 to 14.

What is chaotic is measured over 1e5 s by 16 starts, with bounds of 5 standard errors or more.
"""

from functools import cache

import numpy as np

from robotball import load_scene
from robotball.engines.reduced.compiled.kernels import kernel_start
from robotball.parameters import Parameters
from robotball.qualitative.basins import CHAOS, TORUS, Basins, basins, distance, level_points
from robotball.qualitative.cycles import Cycle, monodromy_of
from robotball.qualitative.drift import Drift, drift
from robotball.qualitative.lyapunov import Exponents, exponents
from robotball.qualitative.sections import fixed_point, section, section_starts
from robotball.qualitative.straight_motions import straight_motion
from robotball.rotations import Array, rotation_matrix
from robotball.start import section_state
from validation.paper.claim import Claim, Residual, Value

F = 25.0  # M² of Figs 11 to 14, (kg m²/s)²
LONG = 1e5  # s


def regular() -> Parameters:
    """The ball of Figs 11a, 12 and 13."""
    return load_scene("fig12").parameters


def chaotic() -> Parameters:
    """The ball of Figs 11b and 14."""
    return load_scene("fig14").parameters


def starts(n: int, c: float = 0.0) -> tuple[Array, Array]:
    """Attitudes (n, 4) and momenta (n, 3) over the section g = 0."""
    random = np.random.default_rng(2)
    return section_starts(random.uniform(-4.5, 4.5, n), random.uniform(0, 2 * np.pi, n), F, c=c)


# The section -------------------------------------------------------------------------------


def without_angles() -> Residual:
    """(M×γ)₃ at the crossings of g = 0, relative to |M|."""
    attitudes, momenta = starts(16)
    found = section(chaotic(), attitudes, momenta, count=50)
    axes = rotation_matrix(found.attitudes.reshape(-1, 4)).reshape(16, 50, 3, 3)
    M = np.einsum("nmij,ni->nmj", axes, momenta)
    off = np.cross(M, axes[:, :, 2])[..., 2] / np.sqrt(F)
    return Residual(float(np.abs(off).max()), bound=1e-12)  # the search stops at 1e-13


def one_way() -> Residual:
    """How many of 64 orbits cross g = 0 in one direction only, in 1000 crossings.

    An orbit may keep to one direction for a while: two of these do for 50 crossings.
    """
    found = section(chaotic(), *starts(64), count=1000, tolerance=1e-9)
    both = (found.directions == 1).any(axis=1) & (found.directions == -1).any(axis=1)
    return Residual(int(np.count_nonzero(~both)), bound=0, unit="of 64")


def edge_of_the_section() -> Value:
    """The distance of γ at l = 0 from γ at l = π, both at L = √f: one point, were it a pole."""
    edge = [section_state(np.sqrt(F), l, g=0.0, f=F)[0] for l in (0.0, np.pi)]
    apart = float(np.linalg.norm(edge[1] - edge[0]))
    return Value(apart, corrected=2.0, bound=1e-12, printed=0.0)


# Fig. 11a: one cycle, one torus ------------------------------------------------------------


@cache
def crossings_of_the_cycle() -> tuple[Cycle, Cycle]:
    """The periodic orbit of Fig. 11a, closed from its crossings in the one and other direction."""
    settled = section(regular(), *section_starts(3.6, 0.6, F), count=200)
    last, before = (fixed_point(regular(), settled.L[0, i], settled.l[0, i], F) for i in (-1, -2))
    return last, before


def orbits_through_the_fixed_points() -> Value:
    """How many periodic orbits the two fixed points of the map belong to."""
    one, other = map(points_on_the_section, crossings_of_the_cycle())
    same = distance(one, other).max() < 1e-9  # both are closed to 1e-11
    return Value(1 if same else 2, corrected=1, bound=0, printed=2, unit="orbit")


def points_on_the_section(cycle: Cycle, g: float = 0.0) -> Array:
    """γ and M/|M| side by side (4, 6) at four crossings of a periodic orbit."""
    through = section(regular(), cycle.attitude[None], cycle.momentum[None], count=4, g=g)
    return level_points(through.attitudes, cycle.momentum[None])[0]


def period() -> Value:
    """The period of that orbit."""
    found = float(crossings_of_the_cycle()[0].period)
    return Value(found, corrected=8.74326, bound=1e-5, unit="s")


def multiplier() -> Value:
    """The modulus of its multipliers, a complex pair."""
    found = float(np.abs(crossings_of_the_cycle()[0].multipliers).max())
    return Value(found, corrected=0.92816, bound=1e-5)


@cache
def reached() -> Basins:
    """Where 64 starts of Fig. 11a end up."""
    return basins(regular(), *starts(64))


def attracting_cycles() -> Value:
    """How many periodic orbits attract, of 64 starts; what else attracts must be a torus."""
    number = len(reached().cycles) if reached().share(CHAOS) == 0 else float("nan")
    return Value(number, corrected=1, bound=0, unit="cycle")


def one_torus() -> Residual:
    """How far the mean velocities of all starts that reach a torus are apart."""
    attitudes, momenta = starts(64)
    on_torus = reached().labels == TORUS
    along = drift(regular(), attitudes[on_torus], momenta[on_torus], 2e4, 3000.0).velocities
    # Means over T = 2e4 s of a motion with two frequencies are off by some 1/T.
    return Residual(float(np.ptp(along[:, 0])), bound=1e-3, unit="m/s")


# Exponents ---------------------------------------------------------------------------------


@cache
def chaotic_exponents() -> Exponents:
    """Of Fig. 11b."""
    return exponents(chaotic(), *starts(16), duration=LONG)


def largest_exponent() -> Value:
    """λ₁ of Fig. 11b."""
    (found, _), (error, _) = chaotic_exponents().mean, chaotic_exponents().error
    return Value(found, corrected=0.116, bound=5e-4 + 5 * error, printed=0.11, unit="1/s")


def smallest_exponent() -> Value:
    """λ₆ of Fig. 11b."""
    (_, found), (_, error) = chaotic_exponents().mean, chaotic_exponents().error
    return Value(found, corrected=-0.139, bound=5e-4 + 5 * error, printed=-0.13, unit="1/s")


def dimension() -> Value:
    """The Kaplan-Yorke dimension of the section of Fig. 11b."""
    found, error = chaotic_exponents().dimension, chaotic_exponents().dimension_error
    return Value(found, corrected=1.832, bound=5e-4 + 5 * error, printed=1.84)


def strangeness() -> Value:
    """λ₁ of Fig. 14's attractor; that of a limit cycle is 0."""
    (found, _), (error, _) = chaotic_exponents().mean, chaotic_exponents().error
    return Value(found, corrected=0.116, bound=5e-4 + 5 * error, printed=0.0, unit="1/s")


def classical_exponent() -> Value:
    """λ₁ of the classical ball with the numbers of Fig. 14."""
    found = exponents(load_scene("classical_chaotic").parameters, *starts(16, c=3.0), 1e4)
    return Value(found.mean[0], corrected=0.34, bound=5e-3, unit="1/s")  # ± 0.001


def sum_on_a_cycle() -> Residual:
    """Rubber: ln det of the monodromy of Fig. 11a's cycle, beside ∫ -(Aγ, γ×Ω)/(Aγ,γ) dt."""
    cycle = crossings_of_the_cycle()[0]
    _, monodromy, volume = monodromy_of(regular(), cycle.attitude, cycle.momentum, cycle.period)
    return Residual(float(np.log(np.linalg.det(monodromy))) - volume, bound=1e-9)


def sum_on_straight_lines() -> Residual:
    """Classical: the eigenvalues near motions with ω = 0, beside (Aγ, γ×Ω)/(1/d - (Aγ,γ))."""
    ball = load_scene("classical_chaotic").parameters
    off = 0.0
    for gamma in ([0.6, 0.48, 0.64], [-0.8, 0.36, -0.48], [0.48, -0.8, 0.36]):
        motion = straight_motion(ball, np.array(gamma))
        divergence = float(ball.divergence((gamma[0], gamma[1], gamma[2])))
        off = max(off, abs(float(motion.eigenvalues.sum().real) - divergence))
    return Residual(off, bound=1e-12, unit="1/s")


# Drift -------------------------------------------------------------------------------------


@cache
def drift_of(name: str) -> Drift:
    """The mean motion of a figure's contact point; of Fig. 12 over whole periods."""
    if name == "fig14":
        return drift(chaotic(), *starts(16), LONG)
    duration = 1000 * period().measured if name == "fig12" else LONG
    return drift(*kernel_start(load_scene(name)), duration, 3000.0)


def drift_along(name: str, stated: float, bound: float) -> Value:
    """Along OX = -M/√f."""
    return Value(float(drift_of(name).mean[0]), corrected=stated, bound=bound, unit="m/s")


def drift_across() -> Residual:
    """Along OY, in Figs 12, 13 and 14, the largest."""
    across = [float(drift_of(name).mean[1]) for name in ("fig12", "fig13", "fig14")]
    # Fig. 14's is a mean of chaos: the standard error is 1.3e-3.
    return Residual(max(across, key=abs), bound=8e-3, unit="m/s")


def mirrored() -> Residual:
    """ω(-M, -γ) = ω(M, γ), by which only dY/dt turns round; relative to the largest ω."""
    random = np.random.default_rng(3)
    gamma, M = random.normal(size=(2, 3, 100))
    gamma /= np.linalg.norm(gamma, axis=0)
    M -= gamma * (gamma * M).sum(axis=0)
    omega = np.array(chaotic().angular_velocity(tuple(M), tuple(gamma)))
    turned = np.array(chaotic().angular_velocity(tuple(-M), tuple(-gamma)))
    return Residual(float(np.abs(omega - turned).max() / np.abs(omega).max()), bound=1e-15)


def own_mirror_image() -> Residual:
    """How far -γ, -M of Fig. 11a's cycle are from it: they cross g = π where γ, M cross g = 0."""
    cycle = crossings_of_the_cycle()[0]
    mirrored = -points_on_the_section(cycle)
    off = distance(mirrored, points_on_the_section(cycle, g=np.pi))
    return Residual(float(off.max()), bound=1e-9)  # closed to 1e-11


CLAIMS = (
    Claim("5.2", "g = 0 is (M×γ)₃ = 0", without_angles),
    Claim("5.2", "each orbit crosses it in both directions", one_way),
    Claim("E25, 5.2", "an annulus, not S²: at L = √f γ depends on l", edge_of_the_section),
    Claim(
        "E23, Fig. 11a",
        "two crossings of one orbit, not two fixed points",
        orbits_through_the_fixed_points,
    ),
    Claim("Fig. 11a", "the period of its periodic orbit", period),
    Claim("Fig. 11a", "|multiplier|", multiplier),
    Claim("Fig. 11a", "one attracting periodic orbit, and else tori", attracting_cycles),
    Claim("Fig. 11a", "one torus: all on it have the same drift", one_torus),
    Claim("E26, 5.3", "Fig. 11b: the largest exponent", largest_exponent),
    Claim("E26, 5.3", "Fig. 11b: the smallest exponent", smallest_exponent),
    Claim("E26, 5.3", "Fig. 11b: the dimension of the section", dimension),
    Claim("E22, Fig. 14", "a strange attractor, not a limit cycle: λ₁ > 0", strangeness),
    Claim("5.3", "the classical ball is chaotic too: λ₁", classical_exponent),
    Claim("5.3", "rubber: the exponents' sum is the mean divergence", sum_on_a_cycle),
    Claim("5.3", "classical: the same, where ω = 0", sum_on_straight_lines),
    Claim("Fig. 12", "drift along X", lambda: drift_along("fig12", 3.65907, 1e-5)),
    Claim("Fig. 13", "drift along X", lambda: drift_along("fig13", 3.665, 1e-3)),
    Claim("Fig. 14", "drift along X", lambda: drift_along("fig14", 3.276, 1e-2)),
    Claim("Figs 12-14", "no drift along Y", drift_across),
    Claim("Figs 12-14", "because (γ, M) → (-γ, -M) turns only dY/dt round", mirrored),
    Claim("Fig. 11a", "and the periodic orbit is its own image by that", own_mirror_image),
)

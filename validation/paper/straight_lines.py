"""Motions along straight lines: section 5.1, Figs 9 and 10, and the classical ball's."""

from dataclasses import replace
from functools import cache

import numpy as np
from scipy.optimize import brentq

from robotball import Scene, load_scene, sample_times, simulate
from robotball.engines.reduced.compiled.kernels import orbit
from robotball.parameters import Parameters, as_vector
from robotball.qualitative.straight_motions import StraightMotion, straight_motion, straight_motions
from robotball.rotations import Array, rotation_matrix
from robotball.start import along_momentum
from validation.paper.claim import Claim, Residual, Value

STABLE, UNSTABLE = 2.0, 3.0  # f = M² on either side of the limit, (kg m²/s)²
SIGMA_PLUS, SIGMA_MINUS, DELTA_PLUS, DELTA_MINUS = "σ₊", "σ₋", "δ₊", "δ₋"


def ball(turning: float = 1.0) -> Parameters:
    """The ball of Fig. 10 with Ω = (0, 0, turning) [rad/s]."""
    return replace(load_scene("fig10").parameters, Omega=(0.0, 0.0, turning))


def lines(f: float, turning: float = 1.0) -> dict[str, StraightMotion]:
    """The four by their names: σ has M along Ω, δ against it; ₊ has (K, γ) > 0."""
    p = ball(turning)
    named = {}
    for motion in straight_motions(p, f):
        kind = "σ" if motion.momentum @ p.Omega > 0 else "δ"
        named[kind + ("₊" if motion.gamma @ p.K > 0 else "₋")] = motion
    return named


def circle_of_lines() -> Residual:
    """ω of γ = c₁K×Ω - c₂Ω²K, γ² = 1, with M = γ×K."""
    return Residual(
        max(float(np.linalg.norm(angular_velocity(gamma))) for _, gamma in verticals()),
        bound=1e-13,  # rounding: measured 4e-16
        unit="rad/s",
    )


def momentum_of_lines() -> Residual:
    """M² = (γ×K)² = c₁²K⁴Ω², and c₁K⁴Ω² as printed."""
    K, Omega = np.array(ball().K), np.array(ball().Omega)
    corrected = printed = 0.0
    for c1, gamma in verticals():
        f = float(np.sum(np.cross(gamma, K) ** 2))
        size = float((K @ K) ** 2 * (Omega @ Omega))
        corrected = max(corrected, abs(f - c1**2 * size))
        printed = max(printed, abs(f - c1 * size))
    return Residual(corrected, bound=1e-12, printed=printed, unit="(kg m²/s)²")


def verticals() -> list[tuple[float, Array]]:
    """c₁ and γ (3,) = c₁K×Ω - c₂Ω²K around the circle γ² = K²Ω²(c₁² + c₂²Ω²) = 1."""
    K, Omega = np.array(ball().K), np.array(ball().Omega)
    scale = 1 / np.linalg.norm(K) / np.linalg.norm(Omega)
    found = []
    for angle in np.linspace(0.0, 2 * np.pi, 12, endpoint=False):
        c1, c2 = scale * np.cos(angle), scale * np.sin(angle) / np.linalg.norm(Omega)
        found.append((float(c1), c1 * np.cross(K, Omega) - c2 * (Omega @ Omega) * K))
    return found


def angular_velocity(gamma: Array) -> Array:
    """ω (3,) where M = γ×K [rad/s]."""
    M = np.cross(gamma, ball().K)
    return np.array(ball().angular_velocity(as_vector(M), as_vector(gamma)))


def scene_from(motion: StraightMotion) -> Scene:
    """Fig. 10's ball on a straight line, with OX against M."""
    scene = load_scene("fig10")
    axes = scene.principal_axes
    return replace(scene, start=along_momentum(axes @ motion.gamma, axes @ motion.momentum))


def direction() -> Residual:
    """Y of MuJoCo's ball after 1 s on each of the four, beside ∓a|Ω|: - for σ, + for δ."""
    corrected, printed = 0.0, 0.0
    for name, motion in lines(STABLE).items():
        scene = scene_from(motion)
        Y = float(simulate(scene, sample_times(1.0)).contact_point[-1, 1])
        expected = (-1 if name.startswith("σ") else 1) * motion.speed
        corrected = max(corrected, abs(Y - expected))
        printed = max(printed, abs(Y + expected))
    return Residual(corrected, bound=1e-10, printed=printed, unit="m")


@cache
def stability_limit(turning: float) -> float:
    """The f at which σ₋ and δ₊ lose their stability."""

    def growth(f: float) -> float:
        named = lines(f, turning)
        return max(float(named[name].eigenvalues.real.max()) for name in (SIGMA_MINUS, DELTA_PLUS))

    return float(brentq(growth, 1.0, 3.0, xtol=1e-12))


def limit() -> Value:
    """The limit, and f = 3 where the paper calls them stable still."""
    return Value(
        stability_limit(1.0), corrected=2.0806, bound=1e-4, printed=UNSTABLE, unit="(kg m²/s)²"
    )


def limit_for_any_turning() -> Residual:
    """How far the limit moves between Ω₃ = 0.5 and 4 rad/s."""
    return Residual(stability_limit(4.0) - stability_limit(0.5), bound=1e-9, unit="(kg m²/s)²")


def saddle_foci() -> Residual:
    """How many of the four at f = 3 are no saddle-foci: a real rate and a pair, of other signs."""
    off = 0
    for motion in lines(UNSTABLE).values():
        real = motion.eigenvalues[motion.eigenvalues.imag == 0].real
        pair = motion.eigenvalues[motion.eigenvalues.imag != 0].real
        off += not (len(real) == 1 and len(pair) == 2 and real[0] * pair[0] < 0)
    return Residual(off, bound=0, unit="of 4 off")


def where_it_goes() -> Residual:
    """Both branches of the unstable manifold of σ₊ at f = 2: how far from δ₊ after 4000 s.

    The last turns about δ₊ die out at 0.0058 1/s.
    """
    sigma, delta = lines(STABLE)[SIGMA_PLUS], lines(STABLE)[DELTA_PLUS]
    off = 0.0
    for side in (0.001, -0.001):
        gamma = sigma.gamma + np.array([0.0, 0.0, side])
        gamma /= np.linalg.norm(gamma)
        M = sigma.momentum - (sigma.momentum @ gamma) * gamma
        start = along_momentum(gamma, M * np.sqrt(STABLE) / np.linalg.norm(M))
        attitudes, _ = orbit(ball(), start.attitude, start.momentum, np.array([0.0, 4000.0]))
        off = max(off, float(np.linalg.norm(rotation_matrix(attitudes[-1])[2] - delta.gamma)))
    return Residual(off, bound=1e-6)


def turns_round() -> Residual:
    """dY/dt of MuJoCo's ball of fig10_stable: -a|Ω| after 10 s, +a|Ω| after 100 s."""
    scene = load_scene("fig10_stable")
    motion = simulate(scene, sample_times(100.0))
    speed = np.diff(motion.contact_point[:, 1]) / np.diff(motion.times)
    expected = lines(STABLE)[DELTA_PLUS].speed
    early = float(speed[np.searchsorted(motion.times, 10.0)])
    # At 10 s γ is 0.01 from σ₊, as at the start: measured 1.5e-3.
    return Residual(max(abs(early + expected), abs(speed[-1] - expected)), bound=1e-2, unit="m/s")


def straight_classical() -> Residual:
    """Where MuJoCo's classical ball, started at ω = 0, is after 5 s, beside a|γ×Ω|t."""
    scene = load_scene("classical_chaotic")
    motion = straight_motion(scene.parameters, np.array([0.6, 0.48, 0.64]))
    start = along_momentum(motion.gamma, motion.momentum)
    path = simulate(replace(scene, start=start), sample_times(5.0)).contact_point
    return Residual(float(np.linalg.norm(path[-1])) - 5.0 * motion.speed, bound=1e-9, unit="m")


CLAIMS = (
    Claim("3.2", "classical: ω = 0 for every γ, straight at a|γ×Ω|", straight_classical),
    Claim("(5.4)", "γ = c₁K×Ω - c₂Ω²K, M = γ×K: straight lines, ω = 0", circle_of_lines),
    Claim(
        "E13, (5.4)",
        "c₁K×Ω - c₂Ω²K, not c₁Ω×K + c₂Ω²",
        "Ω² is no vector, and what goes with c₁ and c₂ is lost",
    ),
    Claim("E14, (5.4)", "c₁²K⁴, not c₁K⁴: M² = c₁²K⁴Ω² (derived)", momentum_of_lines),
    Claim("E15, 5.1", "dY/dt = -a|Ω| for σ and + for δ, not the reverse", direction),
    Claim("E16, Fig. 10", "σ₋ and δ₊ are stable for f < 2.0806, not at 3", limit),
    Claim("Fig. 10", "that limit does not depend on Ω₃", limit_for_any_turning),
    Claim("Fig. 10", "at f = 3 all four are saddle-foci", saddle_foci),
    Claim("Fig. 10", "the unstable manifold of σ₊ goes to δ₊, not σ₋", where_it_goes),
    Claim("Fig. 10", "the contact point turns round, -a|Ω| to +a|Ω|", turns_round),
    Claim("Fig. 9", "where straight lines are stable", "its f is not stated"),
)

"""Section 5.2: the variables (L, l, g) of (5.5) and the Poincaré map."""

import numpy as np
from numpy import cos, sin, sqrt
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

from robotball.engines.ensembles.orbits import kernel_start
from robotball.qualitative.sections import section
from robotball.rotations import Array
from robotball.scene import section_state
from validation.paper import formulas as f
from validation.paper.captions import CAPTIONS
from validation.paper.claim import AtLeast, Errors, Residual, Section, Value, largest_error
from validation.paper.engine_ball import MOTION, RUBBER, seen
from validation.paper.formulas import paper_scene

SECTION = Section("5.2. Poincaré map")
claim = SECTION.claim

F = 25.0  # M² of Figs 11 to 14, (kg m²/s)²


def andoyer(L: float, l: float, g: float, level: float = F) -> tuple[Array, Array]:
    """Return M and γ (3,) of (5.5)."""
    root, share = sqrt(level - L**2), L / sqrt(level)
    M = np.array([root * sin(l), root * cos(l), L])
    gamma = np.array(
        [
            share * cos(g) * sin(l) + sin(g) * cos(l),
            share * cos(g) * cos(l) - sin(g) * sin(l),
            -sqrt(1 - share**2) * cos(g),
        ]
    )
    return M, gamma


@claim("5.2", "f > K², Figs 11a, b: no straight line on the level", "all round Σ¹", "f < K²")
def _no_lines(twist: float) -> AtLeast:
    """Measure by how much f exceeds (γ×K)² on all of (Ω,γ) = 0, in Figs 11a and 11b.

    Twisted, f = 5.
    """
    level, least = F if twist == 1 else 5.0, np.inf
    for name in ("fig12", "fig14"):
        n = CAPTIONS[name].n
        M = np.cross(f.sigma(n, np.linspace(0.0, 2 * np.pi, 721)), n.K)
        least = min(least, level - float((M * M).sum(axis=1).max()))
    return AtLeast(float(least), bound=1.0, unit="(kg m²/s)²")


@claim("(5.5)", "γ² = 1, (M, γ) = 0, M² = f", "at random L, l, g", "sign of γ₂")
@largest_error(1e-14)
def _on_the_level(twist: float) -> Errors:
    """Check γ² = 1, (M, γ) = 0 and M² = f by (5.5), and M and γ with those of robotball.scene."""
    random = np.random.default_rng(71)
    for _ in range(100):
        L, l, g = random.uniform(-5, 5), *random.uniform(0, 2 * np.pi, 2)
        M, gamma = andoyer(L, l, g)
        gamma = gamma * [1.0, twist, 1.0]
        ours, M_ours = section_state(L, l, g, F)
        yield [gamma @ gamma - 1, M @ gamma, M @ M / F - 1, *(ours - gamma), *(M_ours - M)]


def _angle_g(M: Array, gamma: Array) -> float:
    """Return g by (5.5): sin g = γ₁cos l - γ₂sin l, cos g = -γ₃/√(1 - L²/f)."""
    across = np.hypot(M[0], M[1])
    sine = (gamma[0] * M[1] - gamma[1] * M[0]) / across
    return float(np.arctan2(sine, -gamma[2] * np.linalg.norm(M) / across))


@claim("(5.6)", "the crossings (l, L) of g = 0", f"{MOTION} and (5.5)", "g₀ = π")
def _crossings(twist: float) -> Residual:
    """Compare (l, L) where MuJoCo's ball of Fig. 12 has g = 0 by (5.5) with robotball's section.

    Between samples by splines; twisted, where it has g = π.
    """
    scene, ball = paper_scene(RUBBER), seen(RUBBER)
    times = ball.motion.times
    M, gamma = CubicSpline(times, ball.momentum), CubicSpline(times, ball.gamma)
    angles = np.array([_angle_g(*each) for each in zip(ball.momentum, ball.gamma, strict=True)])
    angles = np.mod(angles + (0.0 if twist == 1 else np.pi) + np.pi, 2 * np.pi) - np.pi
    passing = np.flatnonzero((angles[1:] * angles[:-1] < 0) & (np.abs(np.diff(angles)) < 1.0))
    found = []
    for i in passing:
        at = brentq(lambda t: np.sin(_angle_g(M(t), gamma(t))), times[i], times[i + 1], xtol=1e-12)
        found.append([np.arctan2(*M(at)[:2]), M(at)[2]])
    parameters, attitudes, momenta = kernel_start(scene)
    expected = section(parameters, attitudes, momenta, count=len(found))
    turn = np.abs(np.array(found)[:, 0] - expected.l[0])
    off = np.minimum(turn, 2 * np.pi - turn) + np.abs(np.array(found)[:, 1] - expected.L[0])
    return Residual(float(off.max()), bound=4e-7)


@claim(
    "E25, 5.2",
    "(l, L/√f) is on an annulus: at L = √f γ depends on l",
    "(5.5)",
    "l = 0 for l = π",
    printed="a point on the sphere S²",
)
def edge(twist: float) -> Value:
    """Compute the distance of γ at l = 0 from γ at l = π, both at L = √f: 0, were it a pole."""
    ends = [andoyer(sqrt(F), l, g=0.0)[1] for l in (0.0, np.pi * (1 + twist) / 2)]
    apart = float(np.linalg.norm(ends[1] - ends[0]))
    return Value(apart, corrected=2.0, bound=1e-12, printed=0.0)

"""Section 4.1, where motions from rest with K = 0 end, and Fig. 5."""

from functools import partial
from itertools import pairwise

import numpy as np
from numpy import sqrt
from scipy.optimize import brentq

from validation.paper.captions import CAPTIONS, captioned_motion, off_orthonormal, orthonormal
from validation.paper.claim import Claim, Residual
from validation.paper.engine import MOTION, long, seen
from validation.paper.section_4_1 import FIG5, circle, on_sigma, side


def ends(twist: float) -> Residual:
    """Where Fig. 5b's motion is after 60 s, beside Σ_s ∩ ζ; as printed it may be all over Σ_s.

    Σ_s ∩ ζ: (Ω,γ) = 0, (Aγ,γ) that of the start, and (Aγ, γ×Ω) > 0.
    """
    ball, start = long("fig05b", 60.0), CAPTIONS["fig05b"].axes[2]

    def off_curve(angle: float) -> float:
        gamma = on_sigma(FIG5, angle)
        return float(FIG5.A @ gamma @ gamma - FIG5.A @ start @ start)

    angles = np.linspace(0.0, 2 * np.pi, 201)
    crossings = [(x, y) for x, y in pairwise(angles) if off_curve(x) * off_curve(y) < 0]
    meeting = [on_sigma(FIG5, brentq(off_curve, x, y, xtol=1e-14)) for x, y in crossings]
    stable = [gamma for gamma in meeting if twist * side(FIG5, gamma) > 0]
    all_over = [gamma for x in angles if side(FIG5, gamma := on_sigma(FIG5, x)) > 0]
    near = min(np.linalg.norm(gamma - ball.gamma[-1]) for gamma in stable)
    far = max(np.linalg.norm(gamma - ball.gamma[-1]) for gamma in all_over)
    return Residual(float(near), bound=1e-6, printed=float(far))


def periodic(twist: float) -> Residual:
    """How far beside its start MuJoCo's γ of Fig. 5c, whose ζ misses Σ¹, comes back.

    Twisted, of Fig. 5b.
    """
    ball = seen("fig05c" if twist == 1 else "fig05b", 60.0)
    away = ball.gamma - ball.gamma[0]
    distance = np.linalg.norm(away, axis=1)
    later = int(np.argmax(distance > 0.1))
    i = later + int(np.argmin(distance[later:]))
    direction = (ball.gamma[1] - ball.gamma[0]) / distance[1]
    # The samples on either side lie along the motion.
    beside = away[i] - (away[i] @ direction) * direction
    return Residual(float(np.linalg.norm(beside)), bound=4e-6)


def misprint(name: str, row: int, printed: tuple[float, ...], twist: float) -> Residual:
    """The largest entry of SSᵀ - E of a caption, corrected and printed."""
    axes = CAPTIONS[name].axes.copy()
    axes[row] = printed
    return Residual(orthonormal(name, twist).corrected, 1e-15, off_orthonormal(axes))


CLAIMS = (
    Claim("4.1", "ζ that misses Σ¹ is periodic", periodic, MOTION, "ζ that meets Σ¹"),
    Claim(
        "E24, 4.1",
        "ζ that meets Σ¹ ends on Σ_s ∩ ζ",
        ends,
        MOTION,
        "Σ_u for Σ_s",
        printed="tends to Σ_s ∪ ζ",
    ),
    Claim(
        "E17, Fig. 5b",
        "α₂(0) = -2√19/95: α, β, γ are orthonormal",
        partial(misprint, "fig05b", 0, (sqrt(8949) / 95, 2 * sqrt(19) / 95, 0)),
        "arithmetic",
        "the sign of γ₁",
        printed="α₂(0) = 2√19/95",
    ),
    Claim(
        "E18, Fig. 5c",
        "γ₃(0) = √39/20: α, β, γ are orthonormal",
        partial(misprint, "fig05c", 2, (19 / 20, 0, sqrt(33) / 20)),
        "arithmetic",
        "the sign of γ₁",
        printed="γ₃(0) = √33/20",
    ),
    captioned_motion("fig05b", 1.5e-6),
    captioned_motion("fig05c", 4e-7),
    captioned_motion("fig05d", 1e-7),
    Claim(
        "Fig. 5d",
        "Γ₁, and a circle of radius √5/4",
        partial(circle, 0, 2e-7),
        MOTION,
        "sign of Ω₃²",
    ),
)

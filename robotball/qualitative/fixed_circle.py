"""The circle Σ¹ of fixed points of (4.1) where K = 0, section 4.1.

With K = 0 dγ/dt = (Ω,γ) γ×Aγ/(Aγ,γ), which is zero on the whole circle (Ω,γ) = 0. Along it
one eigenvalue is 0; the other is -(Aγ, γ×Ω)/(Aγ,γ), so that a quarter of the circle attracts, Σ_s,
and the next one repels, Σ_u.
"""

from dataclasses import dataclass

import numpy as np

from robotball import equations as eq
from robotball.parameters import Parameters
from robotball.qualitative.equilibria import flow
from robotball.qualitative.fixed_point_formulas import without_rounding
from robotball.rotations import Array, perpendicular

MOST_SAMPLES = 100_000


@dataclass(frozen=True)
class FixedCircle:
    """Fixed points γ = cos ψ axes[0] + sin ψ axes[1], of which those with sin 2ψ > 0 attract: Σ_s.

    axes (2, 3): unit vectors across Ω, right-handed with it, along which Σ_s and Σ_u meet; index:
    what the circle as a whole adds to the sum of the indices on the sphere, which is 2.
    """

    parameters: Parameters
    axes: Array
    index: int

    def at(self, angles: Array) -> Array:
        """γ (n, 3) at angles ψ (n,) [rad]."""
        return np.stack([np.cos(angles), np.sin(angles)], axis=-1) @ self.axes

    def rate(self, gamma: Array) -> Array:
        """The eigenvalue (n,) across the circle at γ (n, 3) on it [1/s]."""
        p = self.parameters
        return np.asarray(eq.rubber_divergence(tuple(gamma.T), p.Omega, p.A))


def fixed_circle(parameters: Parameters) -> FixedCircle | None:
    """The circle of fixed points of a rubber ball with K = 0 and Ω ≠ 0; None for any other ball."""
    parameters = without_rounding(parameters)
    if parameters.rolling != "rubber" or np.any(parameters.K) or not np.any(parameters.Omega):
        return None
    along = np.array(parameters.Omega) / np.linalg.norm(parameters.Omega)
    first = perpendicular(along)
    plane = np.stack([first, np.cross(along, first)])
    # (Aγ, γ×Ω) is |Ω| (A₁₁ - A₂₂)/2 sin 2ψ in axes that make A diagonal there, the larger first.
    weights, vectors = np.linalg.eigh(plane * parameters.A @ plane.T)
    larger = vectors[:, np.argmax(weights)] @ plane
    axes = np.stack([larger, np.cross(along, larger)])
    return FixedCircle(parameters, axes, index_of(parameters, axes))


def index_of(parameters: Parameters, axes: Array) -> int:
    """How often (4.1) turns round along a line just below the circle, less that just above it.

    Between the lines and the circle there is no other fixed point.
    """
    along = np.cross(*axes)
    heights = np.abs(along)[np.abs(along) > 1e-9]  # of the principal axes over the circle
    height = min(0.02, float(heights.min()) / 2)
    samples = min(MOST_SAMPLES, int(40 / height))
    angle = np.linspace(0.0, 2 * np.pi, samples + 1)
    out = np.stack([np.cos(angle), np.sin(angle)], axis=1) @ axes
    ahead = np.stack([-np.sin(angle), np.cos(angle)], axis=1) @ axes
    turns = []
    for sign in (-1.0, 1.0):
        gamma = np.sqrt(1 - height**2) * out + sign * height * along
        rate = np.stack(flow(parameters, tuple(gamma.T)), axis=1)
        direction = np.unwrap(np.arctan2(rate @ along, (rate * ahead).sum(axis=1)))
        turns.append(round(float(direction[-1] - direction[0]) / (2 * np.pi)))
    return turns[0] - turns[1]

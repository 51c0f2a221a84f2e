"""The isolated fixed points of (4.1) in closed form, sections 4.1 and 4.2, for K = (0, 0, K₃).

Beside Γ₅,₆ = (0, 0, ±1) a fixed point then has γ₁ = 0, one of Δ, or γ₂ = 0, one of Θ. There, with
γⱼ = sin φ and γ₃ = cos φ, (4.1) reads

    sin(2φ + ν) = κ,  ν = atan2(Ω₃, Ωⱼ),  κ = (2aⱼa₃K₃/(a₃ - aⱼ) - Ω₃)/√(Ωⱼ² + Ω₃²),

with four solutions where |κ| < 1. ν₁, κ₁ of the paper belong to Δ (j = 2), ν₂, κ₂ to Θ (j = 1).
"""

from dataclasses import replace

import numpy as np

from robotball.equations import Vector
from robotball.errors import InputError
from robotball.parameters import Parameters, as_vector
from robotball.rotations import Array

ROUNDING = 1e-14  # of what a number was computed from: one that is smaller is zero
EQUAL = 1e-12  # of a moment: one that differs by less is the same
SAME = 1e-6  # of a unit vector: what is that near a point of a formula is that point


def without_rounding(parameters: Parameters) -> Parameters:
    """The ball with what is rounding of Ω and of K = k - dΩ at zero."""

    def exact(v: Vector, size: float) -> Vector:
        return as_vector(np.where(np.abs(v) <= ROUNDING * size, 0.0, v))

    turning = float(np.linalg.norm(parameters.Omega))
    size = float(np.linalg.norm(parameters.K)) + parameters.d * turning
    return replace(parameters, Omega=exact(parameters.Omega, turning), K=exact(parameters.K, size))


def nu(parameters: Parameters, j: int) -> float:
    """ν [rad] of the circle on which γⱼ and γ₃ are not zero; j is 0 or 1."""
    return float(np.arctan2(parameters.Omega[2], parameters.Omega[j]))


def kappa(parameters: Parameters, j: int) -> float:
    """κ of that circle."""
    a, a3 = parameters.A[j], parameters.A[2]
    level = 2 * a * a3 * parameters.K[2] / (a3 - a) - parameters.Omega[2]
    return float(level / np.hypot(parameters.Omega[j], parameters.Omega[2]))


def proposition_2(parameters: Parameters) -> tuple[float, float, float]:
    """A₁, A₂ [1/s] and B of Proposition 2, by which Γ₅ and Γ₆ are saddles or weak foci.

    A₁A₂ < 0: saddles; else weak foci, stable iff B/A₁ < 0, with B without the paper's factor K₃.
    """
    (a1, a2, a3), (Omega1, Omega2, Omega3) = parameters.A, parameters.Omega
    A1 = a1 * a3 * parameters.K[2] + (a1 - a3) * Omega3
    A2 = a2 * a3 * parameters.K[2] + (a2 - a3) * Omega3
    return A1, A2, Omega1 * Omega2 * ((a2 - a3) ** 2 * A1**2 - (a1 - a3) ** 2 * A2**2)


def closed_form_points(parameters: Parameters) -> dict[str, Array]:
    """All isolated fixed points γ (3,) of (4.1) by the paper's names; two that coincide twice.

    Γ₁ … Γ₆ of (4.4) where K = 0, without those that lie on the circle (Ω, γ) = 0 of fixed points;
    else Γ₅, Γ₆, δ₁ … δ₄, θ₁ … θ₄, as far as they exist.

    Raises InputError unless the ball is a rubber one with K = (0, 0, K₃) and three different aⱼ,
    so that no other curve is filled, and where K₃ ≠ 0 but Ωⱼ = Ω₃ = 0 for a j of 1, 2.
    """
    parameters = without_rounding(parameters)
    Omega, K, A = parameters.Omega, parameters.K, np.sort(parameters.A)
    if parameters.rolling != "rubber" or K[0] != 0 or K[1] != 0:
        raise InputError("the closed form needs a rubber ball with K = (0, 0, K3)")
    if np.diff(A).min() <= EQUAL * A[2]:
        raise InputError("the closed form needs three different moments of inertia")
    if K[2] == 0:
        return principal_points(Omega)
    if Omega[2] == 0 and 0 in Omega[:2]:
        raise InputError("the closed form needs Omega_3, or both Omega_1 and Omega_2, not zero")
    points = {"Γ₅": np.array([0.0, 0.0, 1.0]), "Γ₆": np.array([0.0, 0.0, -1.0])}
    for letter, j in (("δ", 1), ("θ", 0)):
        if abs(kappa(parameters, j)) > 1:
            continue
        arc, shift = np.arcsin(kappa(parameters, j)), nu(parameters, j)
        first, second = (arc - shift) / 2, -(arc + shift) / 2
        angles = (first, first + np.pi, second + np.pi / 2, second + 3 * np.pi / 2)
        for number, angle in zip("₁₂₃₄", angles, strict=True):
            gamma = np.zeros(3)
            gamma[j], gamma[2] = np.sin(angle), np.cos(angle)
            points[letter + number] = gamma
    return points


def principal_points(Omega: Vector) -> dict[str, Array]:
    """Γ₁ … Γ₆ of (4.4), the principal axes, but for those across Ω."""
    signed = [sign * axis for axis in np.eye(3) for sign in (1.0, -1.0)]
    return {
        f"Γ{number}": gamma
        for number, gamma in zip("₁₂₃₄₅₆", signed, strict=True)
        if gamma @ Omega != 0
    }


def name_of(parameters: Parameters, gamma: Array) -> str:
    """The paper's name of the fixed point γ (3,), or nothing where it has none for it."""
    try:
        points = closed_form_points(parameters)
    except InputError:
        return ""
    near = (name for name, point in points.items() if np.abs(point - gamma).max() < SAME)
    return next(near, "")

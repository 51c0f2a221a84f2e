"""The fixed points of (4.1) in closed form, section 4.1, for K = (0, 0, K₃).

Beside Γ₅,₆ = (0, 0, ±1) a fixed point then has γ₁ = 0 or γ₂ = 0. On such a circle, γⱼ = cos θ and
γ₃ = sin θ with j the other axis, (4.1) reads

    sin(2θ - ν) = κ,  ν = atan2(Ω₃, Ωⱼ),  κ = (2aⱼa₃K₃/(a₃ - aⱼ) - Ω₃)/√(Ωⱼ² + Ω₃²),

with four solutions where |κ| < 1. ν₁, κ₁ of the paper belong to γ₁ = 0 (j = 2), ν₂, κ₂ to γ₂ = 0.
"""

import numpy as np

from robotball.errors import InputError
from robotball.parameters import Parameters
from robotball.rotations import Array


def nu(parameters: Parameters, j: int) -> float:
    """ν [rad] of the circle on which γⱼ and γ₃ are not zero; j is 0 or 1."""
    return float(np.arctan2(parameters.Omega[2], parameters.Omega[j]))


def kappa(parameters: Parameters, j: int) -> float:
    """κ of that circle."""
    a, a3 = parameters.A[j], parameters.A[2]
    level = 2 * a * a3 * parameters.K[2] / (a3 - a) - parameters.Omega[2]
    return float(level / np.hypot(parameters.Omega[j], parameters.Omega[2]))


def closed_form_points(parameters: Parameters) -> list[Array]:
    """All fixed points γ (3,) of (4.1); Γ₅ and Γ₆ first, two that coincide twice.

    Raises InputError unless the ball is a rubber one with K = (0, 0, K₃), K₃ other than zero, and
    three different aⱼ, so that no curve is filled, and where Ωⱼ = Ω₃ = 0 for a j of 1, 2.
    """
    Omega, K = parameters.Omega, parameters.K
    if parameters.rolling != "rubber" or K[0] != 0 or K[1] != 0 or K[2] == 0:
        raise InputError("the closed form needs a rubber ball with K = (0, 0, K3), not zero")
    if len(set(parameters.A)) < 3 or (Omega[2] == 0 and 0 in Omega[:2]):
        raise InputError("the closed form needs three moments of inertia and a nonzero Omega_j")
    points = [np.array([0.0, 0.0, sign]) for sign in (1.0, -1.0)]
    for j in (1, 0):
        if abs(kappa(parameters, j)) <= 1:
            arc = np.arcsin(kappa(parameters, j))
            for solution in (arc, np.pi - arc):
                theta = (nu(parameters, j) + solution) / 2
                gamma = np.zeros(3)
                gamma[j], gamma[2] = np.cos(theta), np.sin(theta)
                points += [gamma, -gamma]
    return points

"""Balls of the paper's figures as parameters of the equations, and their initial states."""

import numpy as np
import pytest

from robotball.dynamics.sections import section_starts
from robotball.robot.formulas import Parameters, Rolling, Vector
from robotball.rotations import Array


def ball(
    A: Vector, Omega: Vector, K: Vector, rolling: Rolling = "rubber", d: float = 0.9
) -> Parameters:
    """Return a ball with this diagonal A [1/(kg m²)]; only the classical model uses d [kg m²]."""
    I = (1 / A[0] - d, 1 / A[1] - d, 1 / A[2] - d)
    return Parameters(rolling, I, d, 1.0, Omega, K)


def from_rest(K3: float) -> Parameters:
    return ball((0.5, 0.4, 0.3), (4.0, 2.0, 1.0), (0.0, 0.0, K3))


REGULAR = ball((0.7, 0.6, 0.8), (0.0, 0.0, 2.0), (2.0, 2.0, 0.0))  # Figs 11a, 12, 13
CHAOTIC = ball((0.8, 0.6, 0.7), (0.0, 0.0, 2.0), (2.0, 3.0, 0.0))  # Figs 11b, 14
CLASSICAL = ball((0.8, 0.6, 0.7), (0.0, 0.0, 2.0), (2.0, 3.0, 0.0), "classical")  # with c = 3
F = 25.0  # M² of all figures [(kg m²/s)²]
# A ball of each model with its c.
BALLS = [pytest.param(CHAOTIC, 0.0, id="rubber"), pytest.param(CLASSICAL, 3.0, id="classical")]


def spread_starts(
    seed: int, n: int, c: float = 0.0, g: float = 0.0, most: float = 4.0
) -> tuple[Array, Array]:
    """Return attitudes (n, 4) and momenta (n, 3) over the section's annulus up to |L| = most."""
    rng = np.random.default_rng(seed)
    return section_starts(rng.uniform(-most, most, n), rng.uniform(0, 6.28, n), F, g, c)


def proposition_2(parameters: Parameters) -> tuple[float, float, float]:
    """Return A₁, A₂ [1/s], B of Proposition 2, by which Γ₅, Γ₆ are saddles or weak foci.

    A₁A₂ < 0: saddles; else weak foci, stable iff B/A₁ < 0, with B without the paper's factor K₃.
    """
    (a1, a2, a3), (Omega1, Omega2, Omega3) = parameters.A, parameters.Omega
    A1 = a1 * a3 * parameters.K[2] + (a1 - a3) * Omega3
    A2 = a2 * a3 * parameters.K[2] + (a2 - a3) * Omega3
    return A1, A2, Omega1 * Omega2 * ((a2 - a3) ** 2 * A1**2 - (a1 - a3) ** 2 * A2**2)

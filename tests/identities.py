"""Identities of the equations that only tests need."""

from robotball import equations as eq
from robotball.equations import Scalar, Vector


def energy_rate(omega: Vector, Omega: Vector, K: Vector, A: Vector) -> Scalar:
    """dE/dt = -(Ω, (A⁻¹ω + K)×ω) for constant Ω and K [W]."""
    momentum = (omega[0] / A[0], omega[1] / A[1], omega[2] / A[2])
    return -eq.dot(Omega, eq.cross(eq.add(momentum, K), omega))

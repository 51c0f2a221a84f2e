"""The numbers that the reduced equations know of a ball: all that is left of its bodies."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from robotball import equations as eq
from robotball.bodies import Ball
from robotball.equations import Scalar, Vector
from robotball.errors import LARGEST, InputError
from robotball.rotations import Array

Rolling = Literal["rubber", "classical"]
ROLLING_MODELS: tuple[str, ...] = get_args(Rolling)


@dataclass(frozen=True)
class Parameters:
    """I, d, Ω, K and a of (3.2)/(3.3), in the principal axes of the ball's inertia; SI units.

    rolling: "rubber" (no slip, no spin) or "classical" (no slip). I (3) kg m², d kg m²,
    Omega (3) rad/s, K (3) kg m²/s, a m; as plain tuples of floats.
    """

    rolling: Rolling
    I: Vector
    d: float
    a: float
    Omega: Vector
    K: Vector

    @property
    def A(self) -> Vector:
        """1/(I + d), 1/(kg m²)."""
        return (1 / (self.I[0] + self.d), 1 / (self.I[1] + self.d), 1 / (self.I[2] + self.d))

    @property
    def k(self) -> Vector:
        """The gyrostatic momentum K + dΩ of (A.3), kg m²/s."""
        return eq.add(self.K, eq.scale(self.d, self.Omega))

    def angular_velocity(self, M: Vector, gamma: Vector) -> Vector:
        """ω(M, γ) of (3.2) or (3.3), rad/s; M and γ as tuples of floats or of columns."""
        if self.rolling == "rubber":
            return eq.rubber_angular_velocity(M, gamma, self.Omega, self.K, self.A)
        return eq.classical_angular_velocity(M, gamma, self.Omega, self.K, self.A, self.I, self.d)

    def divergence(self, gamma: Vector) -> Scalar:
        """The rate at which phase volume grows, 1/s; its time mean is the sum of the exponents."""
        if self.rolling == "rubber":
            return eq.rubber_divergence(gamma, self.Omega, self.A)
        return eq.classical_divergence(gamma, self.Omega, self.A, self.I, self.d)

    def momentum(self, omega: Vector, gamma: Vector) -> Vector:
        """M(ω, γ): γ×L of (3.1) in the rubber model, L of section 3.2 in the classical one."""
        L = eq.contact_angular_momentum(omega, gamma, self.Omega, self.K, self.I, self.d)
        return eq.cross(gamma, L) if self.rolling == "rubber" else L


def parameters_of(ball: Ball, rolling: Rolling, rates: Sequence[float]) -> Parameters:
    """The numbers of a ball whose hinges, the frame's and the rotors', turn at `rates` [rad/s]."""
    moments, axes = ball.principal
    Omega = rates[0] * ball.shell.axis
    k = ball.gyrostatic_inertia @ rates
    return Parameters(
        rolling=rolling,
        I=as_vector(moments),
        d=ball.d,
        a=ball.radius,
        Omega=as_vector(axes.T @ Omega),
        K=as_vector(axes.T @ (k - ball.d * Omega)),
    )


def speed_bound(parameters: Parameters, size: Array) -> Array:
    """What |ω| (n,) cannot exceed where |M| = size (n,), by (3.2) or (3.3) term by term [rad/s]."""
    A, I = np.array(parameters.A), np.array(parameters.I)
    Omega, K = math.hypot(*parameters.Omega), math.hypot(*parameters.K)
    with np.errstate(over="ignore", invalid="ignore"):
        if parameters.rolling == "rubber":
            Z = (Omega + A.max() * K) / A.min()
            return A.max() * (size * A.max() / A.min() + K + Z)
        Z = (A.max() * (size + K) + Omega) * parameters.d / (I * A).min()
        return A.max() * (size + K + Z)


def check_speed(parameters: Parameters, size: Array) -> Array:
    """The speed bounds (n,); raises InputError for any faster than numbers can follow."""
    bounds = speed_bound(parameters, size)
    fastest = float(bounds.max())
    if not fastest <= LARGEST:
        raise InputError(
            f"the ball may turn at {fastest:.3g} rad/s, of at most {LARGEST:g}: its momentum "
            f"{float(size.max()):.3g} or K {math.hypot(*parameters.K):.3g} kg m²/s is too large "
            f"for moments I + d from {1 / max(parameters.A):.3g} kg m² on"
        )
    return bounds


def as_vector(v: Array) -> Vector:
    """An array (3,) as the plain tuple that equations.py computes with."""
    x, y, z = np.asarray(v, dtype=float).tolist()
    return (x, y, z)

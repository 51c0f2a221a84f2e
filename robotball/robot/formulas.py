"""The paper's equations of motion, in plain arithmetic on 3-tuples.

The formulas use only ``+ - * /`` on scalars, so the same functions run on floats, NumPy columns,
sympy and mpmath numbers, heyoka expressions and inside numba. The equation numbers refer to
"Different Models of Rolling for a Robot Ball on a Plane as a Generalization of the Chaplygin Ball
Problem", with its misprints corrected.

Axes and symbols: vectors are 3-tuples along the principal axes of the ball's inertia, which rotate
with the frame. ``A`` and ``I`` are 3-tuples: the diagonals of A = (I + d E)^-1 [1/(kg m^2)] and of
the inertia [kg m^2]. ``d`` is m a^2 [kg m^2], ``Omega`` the frame's angular velocity relative to
the shell [rad/s], ``K`` is k - d Omega [kg m^2/s], and ``gamma`` is the unit vertical.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np

from robotball.errors import LARGEST, InputError
from robotball.robot.ball import Ball
from robotball.rotations import Array, Quaternion, unit_space_axes

# A scalar may be of any type with + - * /; numba, sympy and heyoka have no common protocol.
Scalar = Any
Vector = tuple[Scalar, Scalar, Scalar]
Rolling = Literal["rubber", "classical"]
ROLLING_MODELS: tuple[str, ...] = get_args(Rolling)


def dot(u: Vector, v: Vector) -> Scalar:
    """Return (u, v)."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


def cross(u: Vector, v: Vector) -> Vector:
    """Return u × v."""
    return (
        u[1] * v[2] - u[2] * v[1],
        u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0],
    )


def add(u: Vector, v: Vector) -> Vector:
    """Return u + v."""
    return (u[0] + v[0], u[1] + v[1], u[2] + v[2])


def subtract(u: Vector, v: Vector) -> Vector:
    """Return u - v."""
    return (u[0] - v[0], u[1] - v[1], u[2] - v[2])


def scale(s: Scalar, v: Vector) -> Vector:
    """Return s v."""
    return (s * v[0], s * v[1], s * v[2])


def diagonal(D: Vector, v: Vector) -> Vector:
    """Return diag(D) v."""
    return (D[0] * v[0], D[1] * v[1], D[2] * v[2])


# The reduced equations ---------------------------------------------------------------------


def rubber_angular_velocity(
    M: Vector, gamma: Vector, Omega: Vector, K: Vector, A: Vector
) -> Vector:
    """Return ω(M, γ) for rolling without slipping and spinning, (3.2) [rad/s].

    ω = A( (M×Aγ + (Ω + AK, γ)γ)/(Aγ,γ) - K ). M must satisfy (M, γ) = 0.
    """
    A_gamma = diagonal(A, gamma)
    # Divide once for three coordinates, because division is the slowest operation here.
    per_A_gamma_gamma = 1 / dot(A_gamma, gamma)
    Omega_AK = add(Omega, diagonal(A, K))
    turning = add(cross(M, A_gamma), scale(dot(Omega_AK, gamma), gamma))
    return diagonal(A, subtract(scale(per_A_gamma_gamma, turning), K))


def _classical_angular_velocity(
    M: Vector, gamma: Vector, Omega: Vector, K: Vector, A: Vector, I: Vector, d: Scalar
) -> Vector:
    """Return ω(M, γ) for rolling without slipping, (3.3) [rad/s].

    ω = A( M - K + Zγ ),  Z = (A(M - K) - Ω, γ) / (1/d - (Aγ,γ)).
    """
    M_K = subtract(M, K)
    A_gamma = diagonal(A, gamma)
    # For a unit γ, 1/d - (Aγ,γ) = Σ I_i a_i γ_i² / d. The left side loses digits when I << d.
    I_A_gamma_gamma = dot(diagonal(I, A_gamma), gamma)
    Z = d * (dot(M_K, A_gamma) - dot(Omega, gamma)) / I_A_gamma_gamma
    return diagonal(A, add(M_K, scale(Z, gamma)))


def rubber_divergence(gamma: Vector, Omega: Vector, A: Vector) -> Scalar:
    """Return -(Aγ, γ×Ω)/(Aγ,γ), whose time mean is the sum of (3.2)'s exponents [1/s]."""
    A_gamma = diagonal(A, gamma)
    per_A_gamma_gamma = 1 / dot(A_gamma, gamma)
    return per_A_gamma_gamma * dot(A_gamma, cross(Omega, gamma))


def _classical_divergence(gamma: Vector, Omega: Vector, A: Vector, I: Vector, d: Scalar) -> Scalar:
    """Return (Aγ, γ×Ω)/(1/d - (Aγ,γ)), whose time mean is the sum of (3.3)'s exponents [1/s]."""
    A_gamma = diagonal(A, gamma)
    return d * dot(A_gamma, cross(gamma, Omega)) / dot(diagonal(I, A_gamma), gamma)


# Kinematics --------------------------------------------------------------------------------


def attitude_rate(q: Quaternion, omega: Vector) -> Quaternion:
    """Return dq/dt = q∘(0, ω)/2 of a quaternion (w, x, y, z), frame to world; ω in frame axes."""
    w, x, y, z = q
    p, r, s = scale(0.5, omega)
    return (
        -x * p - y * r - z * s,
        w * p + y * s - z * r,
        w * r + z * p - x * s,
        w * s + x * r - y * p,
    )


def space_axes(q: Quaternion) -> tuple[Vector, Vector, Vector]:
    """Return α, β, γ, the world axes in frame axes, of a quaternion of any length."""
    w, x, y, z = q
    alpha, beta, gamma = unit_space_axes(q)
    per_square = 1 / (w * w + x * x + y * y + z * z)
    return scale(per_square, alpha), scale(per_square, beta), scale(per_square, gamma)


def seen_from_frame(v: Vector, axes: tuple[Vector, Vector, Vector]) -> Vector:
    """Return a world vector in frame axes: v_X α + v_Y β + v_Z γ, with the space axes α, β, γ."""
    alpha, beta, gamma = axes
    return add(add(scale(v[0], alpha), scale(v[1], beta)), scale(v[2], gamma))


def turntable_velocity(spin: Scalar, point: tuple[Scalar, Scalar]) -> tuple[Scalar, Scalar]:
    """Return the velocity of a turning plane at the point r: spin e_z×r along X and Y."""
    return -spin * point[1], spin * point[0]


def contact_velocity(
    alpha: Vector, beta: Vector, omega: Vector, Omega: Vector, a: Scalar
) -> tuple[Scalar, Scalar]:
    """Return the contact point's (dX/dt, dY/dt) = (a(β, ω-Ω), -a(α, ω-Ω)) on the plane [m/s]."""
    shell = subtract(omega, Omega)
    return a * dot(beta, shell), -a * dot(alpha, shell)


# Momentum and energy -----------------------------------------------------------------------


def contact_angular_momentum(
    omega: Vector, gamma: Vector, Omega: Vector, K: Vector, I: Vector, d: Scalar
) -> Vector:
    """Return L = Ĩω + K + d(Ω,γ)γ about the contact point, Ĩ = I + d(E - γ⊗γ) [kg m²/s]."""
    horizontal = subtract(omega, scale(dot(omega, gamma), gamma))
    I_tilde_omega = add(diagonal(I, omega), scale(d, horizontal))
    return add(add(I_tilde_omega, K), scale(d * dot(Omega, gamma), gamma))


def energy(
    omega: Vector, gamma: Vector, Omega: Vector, A: Vector, d: Scalar, spinning: bool
) -> Scalar:
    """Return (ω,A⁻¹ω)/2 - (Ω,A⁻¹ω), minus d(γ,ω-Ω)²/2 if the ball may spin (classical) [J]."""
    momentum = (omega[0] / A[0], omega[1] / A[1], omega[2] / A[2])
    spin = dot(gamma, subtract(omega, Omega)) if spinning else 0
    return dot(omega, momentum) / 2 - dot(Omega, momentum) - d * spin * spin / 2


# The full equations, an independent second form ----------------------------------------------


def full_angular_acceleration(
    omega: Vector,
    gamma: Vector,
    Omega: Vector,
    Omega_rate: Vector,
    k: Vector,
    k_rate: Vector,
    I: Vector,
    d: Scalar,
    spin_free: bool,
) -> tuple[Vector, Scalar]:
    """Return dω/dt [rad/s²] and the spin torque λ₀ [N m] of the unreduced system (2.4)-(2.5).

    Ĩ dω/dt = (Iω + k)×ω - dk/dt + d(E - γ⊗γ)(dΩ/dt + ω×Ω) + λ₀γ. With `spin_free`, the constraint
    (ω - Ω, γ) = 0 of the rubber model determines λ₀; otherwise λ₀ = 0. `k` is (A.3), without the
    term -dΩ of K.
    """
    A = (1 / (I[0] + d), 1 / (I[1] + d), 1 / (I[2] + d))
    A_gamma = diagonal(A, gamma)
    I_A_gamma_gamma = dot(diagonal(I, A_gamma), gamma)

    def inverse_I_tilde(v: Vector) -> Vector:
        # Sherman-Morrison on A⁻¹ - dγ⊗γ, with 1 - d(Aγ,γ) = (IAγ,γ).
        A_v = diagonal(A, v)
        return add(A_v, scale(d * dot(A_v, gamma) / I_A_gamma_gamma, A_gamma))

    carried = add(Omega_rate, cross(omega, Omega))
    horizontal = subtract(carried, scale(dot(carried, gamma), gamma))
    gyroscopic = cross(add(diagonal(I, omega), k), omega)
    torque = add(subtract(gyroscopic, k_rate), scale(d, horizontal))
    free = inverse_I_tilde(torque)
    if not spin_free:
        return free, 0
    # d/dt (ω - Ω, γ) = 0 reads (dω/dt, γ) = (dΩ/dt + ω×Ω, γ).
    per_spin_torque = inverse_I_tilde(gamma)
    lambda_0 = (dot(carried, gamma) - dot(free, gamma)) / dot(per_spin_torque, gamma)
    return add(free, scale(lambda_0, per_spin_torque)), lambda_0


@dataclass(frozen=True)
class Parameters:
    """The parameters of (3.2) and (3.3); vectors are in the principal axes of the ball's inertia.

    Attributes
    ----------
    rolling : {"rubber", "classical"}
        The rubber model has no slip and no spin, the classical model has no slip.
    I : 3 floats, kg m²
    d : float, kg m²
    a : float, m
    Omega : 3 floats, rad/s
    K : 3 floats, kg m²/s
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
        return add(self.K, scale(self.d, self.Omega))

    def angular_velocity(self, M: Vector, gamma: Vector) -> Vector:
        """Return ω(M, γ) of (3.2) or (3.3) [rad/s]. M and γ are tuples of floats or of columns."""
        if self.rolling == "rubber":
            return rubber_angular_velocity(M, gamma, self.Omega, self.K, self.A)
        return _classical_angular_velocity(M, gamma, self.Omega, self.K, self.A, self.I, self.d)

    def divergence(self, gamma: Vector) -> Scalar:
        """Return the growth of phase volume [1/s]; its time mean is the sum of the exponents."""
        if self.rolling == "rubber":
            return rubber_divergence(gamma, self.Omega, self.A)
        return _classical_divergence(gamma, self.Omega, self.A, self.I, self.d)

    def momentum(self, omega: Vector, gamma: Vector) -> Vector:
        """Return M(ω, γ): γ×L of (3.1) for the rubber model, L of section 3.2 for the classical."""
        L = contact_angular_momentum(omega, gamma, self.Omega, self.K, self.I, self.d)
        return cross(gamma, L) if self.rolling == "rubber" else L


def parameters_of(ball: Ball, rolling: Rolling, rates: Sequence[float]) -> Parameters:
    """Return the parameters of a ball with hinge rates [rad/s], the frame's rate first."""
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
    """Return upper bounds (n,) on |ω| for |M| = size (n,), from (3.2) or (3.3) [rad/s]."""
    A, I = np.array(parameters.A), np.array(parameters.I)
    Omega, K = math.hypot(*parameters.Omega), math.hypot(*parameters.K)
    # An overflow gives an infinite bound, which `check_speed` refuses.
    with np.errstate(over="ignore", invalid="ignore"):
        if parameters.rolling == "rubber":
            Z = (Omega + A.max() * K) / A.min()
            return A.max() * (size * A.max() / A.min() + K + Z)
        Z = (A.max() * (size + K) + Omega) * parameters.d / (I * A).min()
        return A.max() * (size + K + Z)


def check_speed(parameters: Parameters, size: Array) -> Array:
    """Return `speed_bound` (n,). Raises InputError if a bound exceeds `LARGEST`."""
    bounds = speed_bound(parameters, size)
    fastest = float(bounds.max())
    if not fastest <= LARGEST:
        raise InputError(
            f"the ball may turn at {fastest:.3g} rad/s, more than the limit of {LARGEST:g} rad/s: "
            f"its momentum {float(size.max()):.3g} or K {math.hypot(*parameters.K):.3g} kg m²/s is "
            f"too large for its least moment I + d = {1 / max(parameters.A):.3g} kg m²"
        )
    return bounds


def as_vector(v: Array) -> Vector:
    """Return an array (3,) as the tuple of floats that the formulas take."""
    x, y, z = np.asarray(v, dtype=float).tolist()
    return (x, y, z)

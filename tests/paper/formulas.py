"""The paper's formulas, implemented a second time with matrices, and tools shared by the tests.

Nothing here uses robotball.robot.formulas: the tests compare its formulas and motions with these.
A vector is (3,), a matrix (3, 3), in frame axes; SI units. Misprints are corrected; E1 to
E30 are the numbers of docs/errata.md.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.integrate import solve_ivp

from robotball import load_scene
from robotball.robot.formulas import Parameters
from robotball.rotations import Array, on_circle, tangents

Field = Callable[[Array], Array]
Errors = Iterator[ArrayLike]
E = np.eye(3)


def worst(errors: Iterable[ArrayLike]) -> float:
    """Return the largest absolute error; NaN if one is NaN."""
    return float(np.max([np.abs(error).max() for error in errors]))


def count(wrong: Iterable[ArrayLike]) -> int:
    """Return the number of wrong cases."""
    return sum(int(np.asarray(case).sum()) for case in wrong)


@dataclass(frozen=True)
class Numbers:
    """The constants of a ball's equations: I and A (3, 3), d, a; Ω, K and their rates (3,)."""

    I: Array
    d: float
    Omega: Array
    K: Array
    a: float = 1.0
    Omega_rate: Array = field(default_factory=lambda: np.zeros(3))
    k_rate: Array = field(default_factory=lambda: np.zeros(3))
    A: Array = field(init=False)

    def __post_init__(self) -> None:
        # A matrix inverse: robotball computes 1/(I + d) by components.
        object.__setattr__(self, "A", np.linalg.inv(self.I + self.d * E))

    @property
    def k(self) -> Array:
        """K + dΩ, by (3.1)."""
        return self.K + self.d * self.Omega

    @property
    def moments(self) -> Array:
        """a₁, a₂, a₃ (3,) of a diagonal A."""
        return np.diag(self.A)


def numbers(p: Parameters) -> Numbers:
    """Return the numbers of a scene's parameters, in principal axes."""
    return Numbers(np.diag(p.I), p.d, np.array(p.Omega), np.array(p.K), p.a)


def ball(n: Numbers, classical: bool = False) -> Any:
    """Return robotball's parameters of the ball, in principal axes."""
    I, Omega, K = (tuple(v.tolist()) for v in (np.diag(n.I), n.Omega, n.K))
    return Parameters("classical" if classical else "rubber", I, n.d, n.a, Omega, K)


def with_A(
    A: tuple[float, float, float], Omega: Array, K: Array, d: float = 0.5, a: float = 1.0
) -> Numbers:
    """Return a ball with a diagonal A; only the classical model depends on d."""
    return Numbers(np.diag(1 / np.array(A) - d), d, np.array(Omega), np.array(K), a)


def cross(u: Array, v: Array) -> Array:
    """Return u × v, faster than NumPy; real or complex."""
    return np.array(
        [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
    )


def unit(v: Array) -> Array:
    """Return v normalised."""
    return v / np.linalg.norm(v)


def hat(w: Array) -> Array:
    """Return ŵ (3, 3) of section 2, with ŵα = α×w."""
    return np.array([[0.0, w[2], -w[1]], [-w[2], 0.0, w[0]], [w[1], -w[0], 0.0]])


def turned_about(axis: Array, angle: float) -> Array:
    """Return the rotation (3, 3) about a unit vector."""
    cosine, side = np.cos(angle), hat(axis).T
    return cosine * E + np.sin(angle) * side + (1 - cosine) * np.outer(axis, axis)


# The equations -----------------------------------------------------------------------------


def contact_inertia(n: Numbers, gamma: Array) -> Array:
    """Return Ĩ = I + ma²(γ²E - γ⊗γ), after (2.4)."""
    return n.I + n.d * (gamma @ gamma * E - np.outer(gamma, gamma))


def drive_torque(n: Numbers, omega: Array, gamma: Array) -> Array:
    """Return W of (2.5)."""
    turning = n.d * (omega @ gamma) * cross(gamma, n.Omega)
    return turning + n.d * cross(gamma, cross(n.Omega_rate, gamma)) - n.k_rate


def gyroscopic_torque(n: Numbers, omega: Array, gamma: Array) -> Array:
    """Return (Ĩω + k)×ω + ma²(ω - Ω, γ)γ×ω of (2.4)."""
    carried = cross(contact_inertia(n, gamma) @ omega + n.k, omega)
    return carried + n.d * ((omega - n.Omega) @ gamma) * cross(gamma, omega)


def full_rates(n: Numbers, omega: Array, gamma: Array, spun: float = 1.0) -> tuple[Array, float]:
    """Return dω/dt of (2.4), with λ₀ of (2.5) times `spun`, and that λ₀."""
    # (2.5) is correct as printed; E3 is a sign in the line before it.
    torque = gyroscopic_torque(n, omega, gamma) + drive_torque(n, omega, gamma)
    sides = np.stack([torque, gamma], axis=1)
    per_torque, per_gamma = np.linalg.solve(contact_inertia(n, gamma), sides).T
    drive = n.Omega @ cross(gamma, omega) + n.Omega_rate @ gamma
    lambda_0 = float((-per_gamma @ torque + drive) / (per_gamma @ gamma))
    return per_torque + spun * lambda_0 * per_gamma, lambda_0


def rubber_velocity(n: Numbers, M: Array, gamma: Array) -> Array:
    """Return ω of (3.2), for M and γ (3,) or (3, n)."""
    A_gamma = n.A @ gamma
    along = (A_gamma * gamma).sum(axis=0)
    Z = (n.Omega + n.A @ n.K) @ gamma / along
    return n.A @ ((cross(M, A_gamma) / along + Z * gamma).T - n.K).T


def classical_velocity(n: Numbers, M: Array, gamma: Array) -> Array:
    """Return ω of (3.3), for M and γ (3,) or (3, n)."""
    free = n.A @ (M.T - n.K).T
    Z = ((free.T - n.Omega).T * gamma).sum(axis=0) / (1 / n.d - (n.A @ gamma * gamma).sum(axis=0))
    return free + n.A @ (Z * gamma)


def from_rest(n: Numbers) -> Field:
    """Return the function dγ/dt of (4.1) of γ (3,) or (3, n)."""

    def rate(gamma: Array) -> Array:
        Z = (n.Omega + n.A @ n.K) @ gamma / (n.A @ gamma * gamma).sum(axis=0)
        return cross(gamma, n.A @ ((Z * gamma).T - n.K).T)

    return rate


Velocity = Callable[[Numbers, Array, Array], Array]


def reduced(velocity: Velocity, n: Numbers) -> Field:
    """Return the function d/dt (M, γ) of (3.2) or (3.3) of (M, γ) (6,) or (6, n)."""

    def rate(state: Array) -> Array:
        M, gamma = state[:3], state[3:]
        omega = velocity(n, M, gamma)
        return np.concatenate([cross(M, omega), cross(gamma, omega)])

    return rate


def velocity_of(classical: bool) -> Velocity:
    """Return ω(M, γ) of a rolling model: (3.3) of the classical one, (3.2) of rubber."""
    return classical_velocity if classical else rubber_velocity


def unreduced(n: Numbers, rubber: bool) -> Field:
    """Return the function d/dt (ω, γ) of (2.4), with λ₀ of (2.5) if `rubber`, of (ω, γ) (6,)."""
    spun = float(rubber)

    def rate(x: Array) -> Array:
        omega, gamma = x[:3], x[3:]
        return np.concatenate([full_rates(n, omega, gamma, spun)[0], cross(gamma, omega)])

    return rate


def integral_gradients(M: Array, gamma: Array) -> Array:
    """Return the gradients (3, 6) by (M, γ) of F₀ = γ²/2, F₁ = (M, γ) and F₂ = M²/2."""
    zero = np.zeros(3)
    return np.array([np.append(zero, gamma), np.append(gamma, M), np.append(M, zero)])


def divergence(n: Numbers, M: Array, gamma: Array, classical: bool, power: float) -> float:
    """Return Σ ∂(ρ dx/dt)/∂x / ρ [1/s] of the reduced equations at the state x = (M, γ).

    The density ρ is a power of (Aγ,γ), or of 1/d - (Aγ,γ) in the classical model. Remark 5 has the
    power -1/2.
    """

    def weight(x: Array) -> Array:
        A_gamma_gamma = (n.A @ x[3:] * x[3:]).sum(axis=0)
        return np.asarray((1 / n.d - A_gamma_gamma if classical else A_gamma_gamma) ** power)

    rate = reduced(velocity_of(classical), n)
    state = np.concatenate([M, gamma])
    return float(np.trace(jacobian(lambda x: weight(x) * rate(x), state)) / weight(state))


# Numerical methods --------------------------------------------------------------------------


def followed(field: Field, start: Array, times: Array, rtol: float = 1e-12) -> Array:
    """Integrate an autonomous system with scipy; states (n, k) at the times (n,)."""
    span = (float(times[0]), float(times[-1]))
    solution = solve_ivp(
        lambda _, x: field(x), span, start, "DOP853", times, rtol=rtol, atol=rtol / 10
    )
    return np.asarray(solution.y.T)


def returns(field: Field, start: Array, normal: Array, duration: float, rtol: float) -> Array:
    """Find the states (m, k) at which (x - start, normal) increases through 0, with scipy."""

    def ahead(_: float, x: Array) -> float:
        return float((x - start) @ normal)

    # Increasing only: half a turn later the motion crosses the plane the other way.
    ahead.direction = 1.0  # type: ignore[attr-defined]
    span = (0.0, duration)
    solution = solve_ivp(
        lambda _, x: field(x), span, start, "DOP853", events=ahead, rtol=rtol, atol=rtol / 100
    )
    assert solution.t_events is not None
    assert solution.y_events is not None
    # The start lies on the plane and may be reported as a crossing.
    return np.asarray(solution.y_events[0][solution.t_events[0] > 1e-3]).reshape(-1, len(start))


def jacobian(field: Field, at: Array) -> Array:
    """Return ∂field/∂x, (k, k) at x (k,) or (n, k, k) at x (k, n), by complex steps."""
    # A complex step has no cancellation, so the derivative is accurate to rounding.
    k, tiny = len(at), 1e-30
    beside = at.reshape(k, -1, 1) + 1j * tiny * np.eye(k)[:, None]
    slopes = np.imag(field(beside.reshape(k, -1))).reshape(beside.shape) / tiny
    matrices: Array = slopes.transpose(1, 0, 2)
    return matrices if at.ndim > 1 else matrices[0]


def sigma(n: Numbers, angle: Array | float) -> Array:
    """Return points (..., 3) of Σ¹, the circle (Ω,γ) = 0, at angles (...,) [rad]."""
    return on_circle(tangents(unit(n.Omega)), np.asarray(angle))


def eigenvalues(field: Field, gamma: Array) -> Array:
    """Return the eigenvalues (2,) of a field on the sphere at its zero γ, by real part."""
    basis = tangents(gamma)
    # The third eigenvalue belongs to the length of γ, which the field keeps.
    linear = basis @ jacobian(field, gamma) @ basis.T
    return np.asarray(np.sort_complex(np.linalg.eigvals(linear)))


def spread_points(count: int) -> Array:
    """Return points (count, 3) spread evenly over the unit sphere, along Fibonacci's spiral."""
    # Equal steps of z have equal areas; the golden angle keeps neighbours apart.
    i = np.arange(count) + 0.5
    z, angle = 1 - 2 * i / count, np.pi * (3 - np.sqrt(5)) * i
    across = np.sqrt(1 - z * z)
    return np.stack([across * np.cos(angle), across * np.sin(angle), z], axis=1)


def zeros(field: Field, starts: int = 400) -> list[Array]:
    """Find the isolated zeros (3,) of a field on the sphere, with Newton's method from many starts.

    If the zeros fill a curve, some of its points are found. The field takes γ (3, n). The search
    does not use the paper's formulas for the points.
    """
    gamma = spread_points(starts).T
    for _ in range(30):
        flat = E - np.einsum("in,jn->nij", gamma, gamma)
        linear = flat @ jacobian(field, gamma) @ flat
        # The matrix is singular along γ, and along a curve of zeros. The shortest solution is
        # tangent to the sphere and normal to the curve.
        across = flat @ field(gamma).T[:, :, None]
        step = (np.linalg.pinv(linear, rcond=1e-13) @ across)[:, :, 0].T
        # The linearization holds only for short steps.
        gamma = gamma - step * np.minimum(1.0, 0.3 / np.linalg.norm(step, axis=0).clip(1e-300))
        gamma /= np.linalg.norm(gamma, axis=0)
    isolated: list[Array] = []
    for at in gamma.T[np.linalg.norm(field(gamma), axis=0) < 1e-12]:
        if all(np.linalg.norm(at - other) > 1e-6 for other in isolated):
            isolated.append(at)
    return isolated


# Random states -----------------------------------------------------------------------------


@dataclass(frozen=True)
class _State:
    """A random ball with accelerating drives, and a state of it."""

    n: Numbers
    omega: Array
    gamma: Array
    M: Array

    def momentum(self, classical: bool) -> Array:
        """Return M: any vector in the classical model, horizontal in the rubber model."""
        return self.M if classical else level(self.M, self.gamma)


def states(seed: int, count: int = 100) -> Iterator[_State]:
    """Yield random states with the inertia of a body and (M, γ) ≠ 0."""
    random = np.random.default_rng(seed)
    for _ in range(count):
        Omega, K, Omega_rate, k_rate, omega, M, gamma = random.normal(size=(7, 3))
        # Moments between 0.5 and 1 satisfy the triangle inequality.
        I = np.diag(random.uniform(0.5, 1.0, 3))
        n = Numbers(I, random.uniform(0.2, 2.0), Omega, K, 1.0, Omega_rate, k_rate)
        yield _State(n, omega, unit(gamma), M)


def still(n: Numbers) -> Numbers:
    """Return the ball with constant rates."""
    return replace(n, Omega_rate=np.zeros(3), k_rate=np.zeros(3))


def level(v: Array, gamma: Array) -> Array:
    """Return the horizontal part of v."""
    return v - (v @ gamma) * gamma


paper_scene = cache(load_scene)

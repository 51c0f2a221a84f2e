"""Linear part and first Lyapunov value of the flow of γ and M at an equilibrium.

On a level of γ², M² and (M, γ) the flow has two coordinates from rest (M = 0), otherwise three. The
equations are analytic, so derivatives are computed from complex arguments, exact to rounding: first
ones with a tiny imaginary step, higher ones with Cauchy's integral over circles.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robotball.robot import formulas as eq
from robotball.robot.formulas import Parameters
from robotball.rotations import Array, tangents

_Numbers = NDArray[Any]
Flow = Callable[[_Numbers], _Numbers]
"""Rates of coordinates (n, ...), possibly complex; zero at the equilibrium, the origin."""
_STEP = 1e-30j  # its square vanishes
# Aliasing falls as _RADIUS^_COUNT; rounding of a third derivative grows as _RADIUS^-3. With these
# values both are about 1e-12 of the rates.
_COUNT, _RADIUS = 32, 0.05


def flow_near(parameters: Parameters, gamma: Array, M: Array | None = None) -> Flow:
    """Return the flow near γ (3,) and M (3,) in frame axes, or near γ with M = 0 if M is None.

    With M = 0 the coordinates are those of the tangent plane at γ, along `tangents`, projected from
    the centre. Otherwise they are tan(θ/2) n for a rotation by θ about n, in frame axes.
    """
    return _rest_flow(parameters, gamma) if M is None else _turning_flow(parameters, gamma, M)


def _rest_flow(parameters: Parameters, gamma: Array) -> Flow:
    basis = tangents(gamma)

    def flow(x: _Numbers) -> _Numbers:
        point = tuple(np.moveaxis(np.tensordot(x, basis, (0, 0)) + gamma, -1, 0))
        omega = parameters.angular_velocity((0.0, 0.0, 0.0), point)
        rate = np.stack(eq.cross(point, omega))
        # The second term removes the radial component.
        return np.asarray(np.tensordot(basis, rate, 1) - x * np.tensordot(gamma, rate, 1))

    return flow


def _turning_flow(parameters: Parameters, gamma: Array, M: Array) -> Flow:
    def flow(x: _Numbers) -> _Numbers:
        turn = (1.0, x[0], x[1], x[2])
        axes = eq.space_axes(turn)
        moved = [eq.seen_from_frame(tuple(v), axes) for v in (M, gamma)]
        rate = eq.attitude_rate(turn, parameters.angular_velocity(*moved))
        return np.stack(rate[1:]) - x * rate[0]

    return flow


def linear_part(flow: Flow, size: int) -> Array:
    """Return the Jacobian (n, n) of a flow with n = `size` coordinates [1/s]."""
    return np.stack([flow(_STEP * e).imag / _STEP.imag for e in np.eye(size)], axis=1)


def lyapunov_value(flow: Flow, size: int) -> float:
    """Return the first Lyapunov value l₁ for eigenvalues ±iν, averaged over a period [1/s].

    dr/dt = l₁r³ for the motion r Re(q exp(iφ)) in the flow's coordinates, with the eigenvector q,
    |q|² = 1. If l₁ < 0 the motion settles, and a cycle born here attracts. Other coordinates change
    the value, but not its sign. Kuznetsov, Elements of Applied Bifurcation Theory, chapter 5,
    formula for n dimensions.
    """
    linear = linear_part(flow, size)
    values, vectors = np.linalg.eig(linear)
    i = int(np.argmax(values.imag))
    q, nu = vectors[:, i], values[i].imag
    taylor = _taylor(flow, q, q.conj())
    shift = np.linalg.solve(linear, taylor[:, 1, 1])
    double = np.linalg.solve(2j * nu * np.eye(size) - linear, 2 * taylor[:, 2, 0])
    cubic = 2 * taylor[:, 2, 1] - 2 * _taylor(flow, q, shift)[:, 1, 1]
    cubic += _taylor(flow, q.conj(), double)[:, 1, 1]
    # Equals Re c₁/4 of dz/dt = iνz + c₁z|z|², because r = 2|z|.
    return float((np.linalg.inv(vectors)[i] @ cubic).real / 8)


def _taylor(flow: Flow, u: _Numbers, v: _Numbers) -> _Numbers:
    """Return the coefficients (n, 4, 4) of z^i w^j of a flow at zu + wv; u, v (n,) complex."""
    sizes = [float(np.linalg.norm(vector)) or 1.0 for vector in (u, v)]
    circle = _RADIUS * np.exp(2j * np.pi * np.arange(_COUNT) / _COUNT)
    plane = np.multiply.outer(u / sizes[0], circle)[:, :, None]
    plane = plane + np.multiply.outer(v / sizes[1], circle)[:, None]
    orders = np.arange(4)
    powers = np.multiply.outer(*((_RADIUS / size) ** orders for size in sizes))
    return np.fft.fft2(flow(plane))[:, :4, :4] / _COUNT**2 / powers

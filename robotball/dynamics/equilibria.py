"""Fixed points of motions from rest, section 4: dγ/dt = γ×ω(0, γ) (4.1).

With M = 0 the rubber model is a flow on the sphere of γ. The reflection γ → -γ preserves it and
reverses the direction of the contact point's path.

*Isolated fixed points, from a resultant.* (Aγ,γ) dγ/dt is a cubic form in γ. Two of its components
are solved as polynomials in two unknowns: the roots are eigenvalues of their Sylvester matrix (Cox,
Little, O'Shea, Using Algebraic Geometry, chapter 3), and Newton's method refines each root.

*The circle* Σ¹ of fixed points if K = 0, section 4.1. Then dγ/dt = (Ω,γ) γ×Aγ/(Aγ,γ) vanishes on
the circle (Ω,γ) = 0. The eigenvalue along the circle is 0, the other eigenvalue is -(Aγ,
γ×Ω)/(Aγ,γ). Quarters of the circle alternately attract (Σ_s) and repel (Σ_u).

*Closed form*, sections 4.1 and 4.2, for K = (0, 0, K₃). Besides Γ₅,₆ = (0, 0, ±1), fixed points
have γ₁ = 0 (called Δ) or γ₂ = 0 (called Θ). With γⱼ = sin φ and γ₃ = cos φ, (4.1) becomes

    sin(2φ + ν) = κ,  ν = atan2(Ω₃, Ωⱼ),  κ = (2aⱼa₃K₃/(a₃ - aⱼ) - Ω₃)/√(Ωⱼ² + Ω₃²),

with four solutions if |κ| < 1. The paper's ν₁, κ₁ belong to Δ (j = 2), ν₂, κ₂ to Θ (j = 1).

*Linear part and first Lyapunov value* of the flow of γ and M at an equilibrium, also for M ≠ 0. At
constant γ², M² and (M, γ) the flow has two coordinates if M = 0, otherwise three. The equations are
analytic, so derivatives are computed from complex arguments, exact to rounding: first derivatives
with a tiny imaginary step, higher derivatives with Cauchy's integral over circles.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eig

from robotball.engines.equations import scene_of
from robotball.errors import InputError
from robotball.robot import formulas as eq
from robotball.robot.ball import Value
from robotball.robot.formulas import Parameters, Vector, as_vector
from robotball.robot.scene import Scene
from robotball.rotations import (
    Array,
    ComplexArray,
    from_matrix,
    on_circle,
    rotation_matrix,
    tangents,
)

_REST = (0.0, 0.0, 0.0)
# An arbitrary rotation, so that no fixed point is at infinity of the chart.
_GENERIC = rotation_matrix(np.array([0.51, 0.29, -0.63, 0.503]))
_EIGENVALUE_ROUNDING = 1e-9  # of an eigenvalue, relative to the rates of the flow
_SAME_SOLUTION = 1e-7  # distance below which two solutions are the same
_ROUNDING = 1e-14  # relative to the terms of a sum: a smaller result is zero
_EQUAL = 1e-12  # relative difference below which two moments are equal
_SAME = 1e-6  # distance of unit vectors below which a point has the name of a closed-form point

_Numbers = NDArray[Any]
Flow = Callable[[_Numbers], _Numbers]
"""Rates of coordinates (n, ...), possibly complex; zero at the equilibrium, the origin."""
_STEP = 1e-30j  # its square vanishes
# Aliasing falls as _RADIUS^_COUNT; rounding of a third derivative grows as _RADIUS^-3. With these
# values both are about 1e-12 of the rates.
_COUNT, _RADIUS = 32, 0.05


@dataclass(frozen=True)
class FixedPoint(Value):
    """A fixed point of (4.1): γ (3,), the eigenvalues (2,) [1/s] and the type that they imply.

    kind: "saddle", "stable node", "unstable node", "stable focus" or "unstable focus". If the
    eigenvalues are imaginary, the first Lyapunov value decides between "slow stable focus", "slow
    unstable focus" and "centre". If an eigenvalue is zero, kind is "degenerate".
    """

    gamma: Array
    eigenvalues: ComplexArray
    kind: str


@dataclass(frozen=True)
class ContactPath:
    """Path of the contact point at a fixed point: a circle, or a line if turning is 0.

    speed [m/s]; turning: rate about the upward vertical [rad/s], positive for a left turn.
    """

    speed: float
    turning: float

    @property
    def radius(self) -> float:
        """Radius of the circle [m]: infinite for a line, 0 if the ball spins on the spot."""
        return self.speed / abs(self.turning) if self.turning else float("inf")


def flow(parameters: Parameters, gamma: Vector) -> Vector:
    """Return dγ/dt of (4.1) [1/s]; the components of γ may be floats, arrays or complex."""
    return eq.cross(gamma, parameters.angular_velocity(_REST, gamma))


def equilibria(scene: Scene | str | Path) -> list[FixedPoint]:
    """Find the fixed points of a rubber ball's motion from rest.

    At a fixed point the vertical γ stays in the frame, and the contact point describes a circle or
    a line. The scene must be balanced, with constant rates; its start does not matter.

    Parameters
    ----------
    scene : Scene, str or Path
        The scene, a name of the catalog, or the path of a TOML, MJCF or URDF file.

    Returns
    -------
    list of FixedPoint
        The isolated fixed points, each with its γ in principal axes, its eigenvalues and its type.

    Raises
    ------
    InputError
        If the scene is not balanced, if its rates change, if its rolling model is classical, if
        fixed points fill a curve, or if `load_scene` raises it.

    Examples
    --------
    >>> import robotball as rb
    >>> points = rb.equilibria("fig06")
    >>> len(points), sorted({point.kind for point in points})
    (10, ['saddle', 'slow stable focus', 'stable focus', 'unstable node'])
    """
    return fixed_points(scene_of(scene).parameters)


def fixed_points(parameters: Parameters) -> list[FixedPoint]:
    """Return all isolated fixed points of (4.1); `fixed_circle` returns the circle if K = 0.

    Including complex lines, the cubic forms vanish on seven lines through the origin. Newton's
    method refines the roots of the resultant, and the sum of the indices on the sphere checks that
    none is missing. If K = 0, (4.4) gives the fixed points. Raises InputError for a classical ball,
    if fixed points fill a curve, and if the check fails.
    """
    _check_rubber(parameters)
    parameters = _without_rounding(parameters)
    if not np.any([parameters.Omega, parameters.K]):
        raise InputError("no isolated fixed points: the ball rests at every gamma if Omega = K = 0")
    if not np.any(parameters.K):
        isolated = closed_form_points(parameters).values()
        return [fixed_point_at(parameters, gamma) for gamma in isolated]
    if _fills_curve(parameters):
        raise InputError(
            "fixed points fill a curve, as two moments are equal and K is along the third axis: "
            "make the moments differ"
        )
    points: list[FixedPoint] = []
    # If complex fixed points fill a curve, the resultant is singular, and ±AK are the real points.
    # Surplus candidates are harmless: Newton's method rejects them or repeats a point.
    for candidate in (np.array(eq.diagonal(parameters.A, parameters.K)), *_candidates(parameters)):
        gamma = _polished(parameters, candidate)
        if gamma is not None:
            for solution in (gamma, -gamma):
                if all(np.abs(solution - known.gamma).max() > _SAME_SOLUTION for known in points):
                    points.append(fixed_point_at(parameters, solution))
    total = index_sum(points)
    if total != 2:
        # By the Poincaré–Hopf theorem, a point is missing or degenerate.
        raise InputError(
            f"found {len(points)} fixed points whose indices add up to {total}, not 2: some are "
            "degenerate; change the moments of inertia, K or Omega a little"
        )
    return points


def _check_rubber(parameters: Parameters) -> None:
    if parameters.rolling != "rubber":
        raise InputError("equation (4.1), with M = 0, holds only in the rubber model")


def _fills_curve(parameters: Parameters) -> bool:
    """Return whether fixed points of (4.1) with K ≠ 0 fill a curve; in doubt return True.

    This is possible only if two moments are equal, a₁ = a₂, and AK = (0, 0, k). Off that axis dγ/dt
    vanishes on the cone (a₃ - a₁)γ₃(Ω + AK, γ) = k(Aγ,γ), which has no real points if the form is
    definite.
    """
    A, AK = np.array(parameters.A), np.array(eq.diagonal(parameters.A, parameters.K))
    axis = np.eye(3)[np.argmax(np.abs(AK))]
    one, other = A[axis == 0]
    if abs(one - other) > _EIGENVALUE_ROUNDING * A.max() or (
        np.abs(AK[axis == 0]).max() > _EIGENVALUE_ROUNDING * np.abs(AK).max()
    ):
        return False
    product = np.outer((A @ axis - one) * axis, parameters.Omega + AK)
    values = np.linalg.eigvalsh((product + product.T) / 2 - AK @ axis * np.diag(A))
    return bool(max(values[0], -values[2]) <= _EIGENVALUE_ROUNDING * np.abs(values).max())


def index_sum(points: Sequence[FixedPoint]) -> int:
    """Return the sum of the indices: -1 for a saddle, 0 if degenerate, otherwise 1."""
    indices = {"saddle": -1, "degenerate": 0}
    return sum(indices.get(point.kind, 1) for point in points)


def contact_path(parameters: Parameters, gamma: Array) -> ContactPath:
    """Return the contact point's path at the fixed point γ (3,) of (4.1).

    At a fixed point ω = sγ with s = (Ω, γ) by (2.2). By (2.1) the velocity aγ×Ω is constant in
    frame axes, which rotate about the vertical at the rate s. Raises InputError for a classical
    ball and if γ is not a fixed point.
    """
    vertical = as_vector(gamma)
    _check_rubber(parameters)
    if np.abs(flow(parameters, vertical)).max() > _EIGENVALUE_ROUNDING * rate_scale(parameters):
        raise InputError("gamma is not a fixed point: use one of fixed_points()")
    across = eq.cross(vertical, parameters.Omega)
    return ContactPath(
        speed=float(parameters.a * np.linalg.norm(across)),
        turning=float(eq.dot(parameters.Omega, vertical)),
    )


def _candidates(parameters: Parameters) -> list[Array]:
    """Return approximations γ (3,) of every fixed point up to sign, and possibly others."""

    def cubic_forms(gamma: Array) -> Array:
        # gamma is in the generic axes; (Aγ,γ) removes the denominator of (3.2).
        principal = as_vector(_GENERIC @ gamma)
        weight = eq.dot(eq.diagonal(parameters.A, principal), principal)
        return weight * (np.array(flow(parameters, principal)) @ _GENERIC)

    # Coefficients are fitted to values, so that (3.2) is implemented only in `robot.formulas`.
    monomials = list(combinations_with_replacement(range(3), 3))
    # Three times as many as coefficients, with a fixed seed for reproducible results.
    samples = np.random.default_rng(0).normal(size=(30, 3))
    table = np.array([[s[i] * s[j] * s[k] for i, j, k in monomials] for s in samples])
    values = np.array([cubic_forms(s) for s in samples])[:, :2]
    coefficients = np.linalg.lstsq(table, values, rcond=None)[0]
    # In the chart γ = (x, y, 1): powers[form, i, j] of x^i y^j. The third form then vanishes too.
    powers = np.zeros((2, 4, 4))
    for monomial, pair in zip(monomials, coefficients, strict=True):
        powers[:, monomial.count(0), monomial.count(1)] = pair
    sylvester = np.zeros((4, 6, 6))  # by powers of x; rows times (y⁵, …, 1)
    for form in range(2):
        for shift in range(3):
            sylvester[:, 3 * form + shift, shift : shift + 4] = powers[form, :, ::-1]
    # Σ x^k S_k v = 0 as an eigenvalue problem in (v, xv, x²v).
    left, right = np.zeros((18, 18)), np.eye(18)
    left[:12, 6:] = np.eye(12)
    left[12:] = -np.concatenate(sylvester[:3], axis=1)
    right[12:, 12:] = sylvester[3]
    roots, vectors = eig(left, right)
    candidates = []
    for x, v in zip(roots, vectors[:6].T, strict=True):
        # v is proportional to (y⁵, …, y, 1): y is the ratio of neighbours, most accurate for the
        # largest denominator.
        last = int(np.argmax(np.abs(v[1:])))
        # Rounding may split a real double root into a complex pair near the real axis.
        if np.isfinite(x) and abs(x.imag) < 0.01 * (1 + abs(x)) and abs(v[last + 1]) > 0:
            candidates.append(_GENERIC @ np.array([x.real, (v[last] / v[last + 1]).real, 1.0]))
    return candidates


def _polished(parameters: Parameters, gamma: Array) -> Array | None:
    """Refine γ to a fixed point (3,) by Newton's method; None if it does not converge."""
    gamma = gamma / np.linalg.norm(gamma)
    scale = rate_scale(parameters)
    for _ in range(40):
        basis = tangents(gamma)
        rate = basis @ np.array(flow(parameters, as_vector(gamma)))
        # Minimum-norm solution, because the Jacobian is singular where two points coincide.
        step = np.linalg.lstsq(jacobian(parameters, gamma), rate, rcond=1e-13)[0]
        length = float(np.linalg.norm(step))
        # Steps over 0.3 rad are beyond the linear range and may lead to another point.
        gamma = gamma - basis.T @ step * min(1.0, 0.3 / max(length, 1e-300))
        gamma = gamma / np.linalg.norm(gamma)
        if length < 1e-14:
            break
    rate = np.array(flow(parameters, as_vector(gamma)))
    return gamma if np.abs(rate).max() < 1e-13 * scale else None


def fixed_point_at(parameters: Parameters, gamma: Array) -> FixedPoint:
    """Return the fixed point γ (3,) with its eigenvalues and type."""
    values = np.asarray(np.sort_complex(np.linalg.eigvals(jacobian(parameters, gamma))))
    return FixedPoint(gamma, values, _kind_of(parameters, gamma, values))


def _kind_of(parameters: Parameters, gamma: Array, eigenvalues: ComplexArray) -> str:
    # Below this, rounding would decide the sign, and the type would depend on the machine.
    zero = _EIGENVALUE_ROUNDING * rate_scale(parameters)
    if np.abs(eigenvalues).min() < zero:
        return "degenerate"
    first, second = eigenvalues.real
    if eigenvalues[0].imag == 0:
        if first * second < 0:
            return "saddle"
        return "stable node" if first < 0 else "unstable node"
    if abs(first) >= zero:
        return "stable focus" if first < 0 else "unstable focus"
    # The linear part rotates without growth, so the cubic terms decide.
    value = lyapunov_value(flow_near(parameters, gamma), 2)
    if abs(value) < zero:
        return "centre"
    return "slow stable focus" if value < 0 else "slow unstable focus"


def jacobian(parameters: Parameters, gamma: Array) -> Array:
    """Return the Jacobian (2, 2) of (4.1) on the sphere at γ (3,), along `tangents` [1/s]."""
    return linear_part(flow_near(parameters, gamma), 2)


def rate_scale(parameters: Parameters) -> float:
    """Return the magnitude of the rates of (4.1) [1/s]."""
    turned = eq.diagonal(parameters.A, parameters.K)
    return float(np.linalg.norm(parameters.Omega) + np.linalg.norm(turned))


def attitude_at(gamma: Array) -> Array:
    """Return attitudes (..., 4) with the verticals γ (..., 3) and an arbitrary heading."""
    return from_matrix(np.concatenate([tangents(gamma), gamma[..., None, :]], axis=-2))


@dataclass(frozen=True)
class FixedCircle(Value):
    """Circle of fixed points γ = cos ψ axes[0] + sin ψ axes[1]; points with sin 2ψ > 0 attract.

    axes (2, 3): unit vectors at which Σ_s and Σ_u meet. With Ω they form a right-handed orthogonal
    system.
    """

    parameters: Parameters
    axes: Array

    @property
    def index(self) -> int:
        """Contribution of the circle to the sum of indices, which is 2 on the sphere."""
        return 2 - index_sum(fixed_points(self.parameters))

    def at(self, angles: Array) -> Array:
        """Return γ (n, 3) at angles ψ (n,) [rad]."""
        return on_circle(self.axes, angles)

    def rate(self, gamma: Array) -> Array:
        """Return the transverse eigenvalue (n,) at γ (n, 3) on the circle [1/s]."""
        p = self.parameters
        return np.asarray(eq.rubber_divergence(tuple(gamma.T), p.Omega, p.A))


def fixed_circle(parameters: Parameters) -> FixedCircle | None:
    """Return the circle of fixed points of a rubber ball with K = 0 and Ω ≠ 0, else None."""
    parameters = _without_rounding(parameters)
    if parameters.rolling != "rubber" or np.any(parameters.K) or not np.any(parameters.Omega):
        return None
    along = np.array(parameters.Omega) / np.linalg.norm(parameters.Omega)
    plane = tangents(along)
    # (Aγ, γ×Ω) = |Ω| (A₁₁ - A₂₂)/2 sin 2ψ in axes that diagonalise A there, the larger first.
    weights, vectors = np.linalg.eigh(plane * parameters.A @ plane.T)
    larger = vectors[:, np.argmax(weights)] @ plane
    axes = np.stack([larger, np.cross(along, larger)])
    return FixedCircle(parameters, axes)


def _without_rounding(parameters: Parameters) -> Parameters:
    """Return the ball with components of Ω and K = k - dΩ that are rounding set to zero."""

    def exact(v: Vector, size: float) -> Vector:
        return as_vector(np.where(np.abs(v) <= _ROUNDING * size, 0.0, v))

    turning = float(np.linalg.norm(parameters.Omega))
    size = float(np.linalg.norm(parameters.K)) + parameters.d * turning
    return replace(parameters, Omega=exact(parameters.Omega, turning), K=exact(parameters.K, size))


def kappa(parameters: Parameters, j: int) -> float:
    """Return κ for the great circle with only γⱼ and γ₃ nonzero; j is 0 or 1."""
    a, a3 = parameters.A[j], parameters.A[2]
    level = 2 * a * a3 * parameters.K[2] / (a3 - a) - parameters.Omega[2]
    return float(level / np.hypot(parameters.Omega[j], parameters.Omega[2]))


def closed_form_points(parameters: Parameters) -> dict[str, Array]:
    """Return the isolated fixed points γ (3,) of (4.1) by their names in the paper.

    If K = 0: Γ₁ … Γ₆ of (4.4), without the points on the circle (Ω, γ) = 0 of fixed points.
    Otherwise Γ₅, Γ₆ and the existing points among δ₁ … δ₄, θ₁ … θ₄; double points are listed twice.

    Raises InputError unless the ball is a rubber ball with K = (0, 0, K₃) and three different aⱼ
    (with equal ones, fixed points may fill a curve), and if K₃ ≠ 0 but Ω₃ = 0 and Ω₁ or Ω₂ = 0.
    """
    parameters = _without_rounding(parameters)
    Omega, K, A = parameters.Omega, parameters.K, np.sort(parameters.A)
    if parameters.rolling != "rubber" or K[0] != 0 or K[1] != 0:
        raise InputError("the closed form needs a rubber ball with K = (0, 0, K3)")
    if np.diff(A).min() <= _EQUAL * A[2]:
        raise InputError("the closed form needs three different moments of inertia")
    if K[2] == 0:
        return _principal_points(Omega)
    if Omega[2] == 0 and 0 in Omega[:2]:
        raise InputError("the closed form needs Omega_3, or both Omega_1 and Omega_2, nonzero")
    points = {"Γ₅": np.array([0.0, 0.0, 1.0]), "Γ₆": np.array([0.0, 0.0, -1.0])}
    for letter, j in (("δ", 1), ("θ", 0)):
        if abs(kappa(parameters, j)) > 1:
            continue
        arc, shift = np.arcsin(kappa(parameters, j)), np.arctan2(Omega[2], Omega[j])
        # sin(2φ + ν) = κ: 2φ + ν is arc or π - arc, up to 2π, so φ up to π.
        first, second = (arc - shift) / 2, -(arc + shift) / 2
        angles = (first, first + np.pi, second + np.pi / 2, second + 3 * np.pi / 2)
        for number, angle in zip("₁₂₃₄", angles, strict=True):
            gamma = np.zeros(3)
            gamma[j], gamma[2] = np.sin(angle), np.cos(angle)
            points[letter + number] = gamma
    return points


def _principal_points(Omega: Vector) -> dict[str, Array]:
    """Return Γ₁ … Γ₆ of (4.4), the principal axes, without those orthogonal to Ω."""
    signed = [sign * axis for axis in np.eye(3) for sign in (1.0, -1.0)]
    return {
        f"Γ{number}": gamma
        for number, gamma in zip("₁₂₃₄₅₆", signed, strict=True)
        if gamma @ Omega != 0
    }


def name_of(parameters: Parameters, gamma: Array) -> str:
    """Return the paper's name of the fixed point γ (3,), or "" if it has none."""
    try:
        points = closed_form_points(parameters)
    except InputError:
        return ""
    # _SAME is far above the error of Newton's method and far below the distance of two points.
    near = (name for name, point in points.items() if np.abs(point - gamma).max() < _SAME)
    return next(near, "")


def flow_near(parameters: Parameters, gamma: Array, M: Array | None = None) -> Flow:
    """Return the flow near γ (3,) and M (3,) in frame axes, or near γ with M = 0 if M is None.

    With M = 0 the coordinates are those of the tangent plane at γ, along `tangents`, projected from
    the centre. Otherwise the coordinates are tan(θ/2) n for a rotation by θ about n, in frame axes.
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

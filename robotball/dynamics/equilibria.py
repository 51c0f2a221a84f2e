"""Fixed points of the motion from rest, section 4: dγ/dt = γ×ω(0, γ) (4.1).

With M = 0 the rubber model is a flow on the sphere of γ, which γ → -γ leaves unchanged but for the
direction of the contact point's path. In order: all isolated fixed points, by a resultant; their
types; the circle of fixed points; the isolated ones in closed form.

*By a resultant.* (Aγ,γ) dγ/dt is a cubic form in γ. Two of its components are solved as polynomials
in two unknowns, by the eigenvalues of their Sylvester matrix (Cox, Little, O'Shea, Using Algebraic
Geometry, chapter 3), and each zero is made exact by Newton's method.

*The circle* Σ¹ where K = 0, section 4.1. There dγ/dt = (Ω,γ) γ×Aγ/(Aγ,γ), which is zero on the
whole circle (Ω,γ) = 0. Along it one eigenvalue is 0; the other is -(Aγ, γ×Ω)/(Aγ,γ), so that a
quarter of the circle attracts, Σ_s, and the next one repels, Σ_u.

*In closed form*, sections 4.1 and 4.2, for K = (0, 0, K₃). Beside Γ₅,₆ = (0, 0, ±1) a fixed point
then has γ₁ = 0, one of Δ, or γ₂ = 0, one of Θ. There, with γⱼ = sin φ and γ₃ = cos φ, (4.1) reads

    sin(2φ + ν) = κ,  ν = atan2(Ω₃, Ωⱼ),  κ = (2aⱼa₃K₃/(a₃ - aⱼ) - Ω₃)/√(Ωⱼ² + Ω₃²),

with four solutions where |κ| < 1. ν₁, κ₁ of the paper belong to Δ (j = 2), ν₂, κ₂ to Θ (j = 1).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement
from pathlib import Path

import numpy as np
from scipy.linalg import eig

from robotball.dynamics.normal_forms import flow_near, linear_part, lyapunov_value
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
# A rotation with nothing special about it: no fixed point falls at infinity of its chart.
_GENERIC = rotation_matrix(np.array([0.51, 0.29, -0.63, 0.503]))
_EIGENVALUE_ROUNDING = 1e-9  # of an eigenvalue, relative to the rates of the flow
_SAME_SOLUTION = 1e-7  # how near two solutions are one
_MOST_SAMPLES = 100_000  # of a line beside the circle
_ROUNDING = 1e-14  # of what a number was computed from: one that is smaller is zero
_EQUAL = 1e-12  # of a moment: one that differs by less is the same
_SAME = 1e-6  # of a unit vector: what is that near a point of a formula is that point


@dataclass(frozen=True)
class FixedPoint(Value):
    """A fixed point of (4.1): γ (3,), the eigenvalues (2,) there [1/s] and the type by them.

    kind: "saddle", "stable node", "unstable node", "stable focus", "unstable focus"; where the
    eigenvalues are imaginary "slow stable focus", "slow unstable focus" or "centre", by the first
    Lyapunov value; "degenerate" where an eigenvalue is zero.
    """

    gamma: Array
    eigenvalues: ComplexArray
    kind: str


@dataclass(frozen=True)
class ContactPath:
    """The contact point's path while γ stays: a circle, or a line where turning is 0.

    speed m/s; turning rad/s, about the upward vertical: positive where the path bends to the left.
    """

    speed: float
    turning: float

    @property
    def radius(self) -> float:
        """The circle's radius [m]: infinite for a line, 0 where the ball spins on the spot."""
        return self.speed / abs(self.turning) if self.turning else float("inf")


def flow(parameters: Parameters, gamma: Vector) -> Vector:
    """Return dγ/dt of (4.1) [1/s]. γ may be of any arithmetic."""
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
    """Return all isolated fixed points of (4.1); `fixed_circle` has those that K = 0 adds.

    (Aγ,γ) dγ/dt is a cubic form in γ whose zeros are, complex ones included, seven lines through
    the centre: found as the eigenvalues of a resultant, made exact by Newton's method, and checked
    by their indices, whose sum on a sphere is 2. With K = 0 they are (4.4). Raises InputError for a
    classical ball and a curve of fixed points, and where the check fails.
    """
    _check_rubber(parameters)
    parameters = _without_rounding(parameters)
    if not np.any([parameters.Omega, parameters.K]):
        raise InputError("with Omega = 0 and K = 0 the ball rests at every gamma")
    if not np.any(parameters.K):
        isolated = closed_form_points(parameters).values()
        return [fixed_point_at(parameters, gamma) for gamma in isolated]
    if _fills_curve(parameters):
        raise InputError(
            "fixed points fill a curve: two moments are equal, with K along the third axis; make "
            "the moments differ"
        )
    points: list[FixedPoint] = []
    # Where complex fixed points fill a curve, the resultant is singular; ±AK are the real ones.
    # A candidate too many costs nothing: Newton's method refuses or repeats it.
    for candidate in (np.array(eq.diagonal(parameters.A, parameters.K)), *_candidates(parameters)):
        gamma = _polished(parameters, candidate)
        if gamma is not None:
            for each in (gamma, -gamma):
                if all(np.abs(each - known.gamma).max() > _SAME_SOLUTION for known in points):
                    points.append(fixed_point_at(parameters, each))
    total = index_sum(points)
    if total != 2:
        # By Poincaré and Hopf: a fixed point that was missed, or is not simple, shows here.
        raise InputError(
            f"{len(points)} fixed points found, whose indices add up to {total}, not to 2: some "
            "are degenerate"
        )
    return points


def _check_rubber(parameters: Parameters) -> None:
    if parameters.rolling != "rubber":
        raise InputError("(4.1) is the rubber model's: M = 0 has no classical counterpart")


def _fills_curve(parameters: Parameters) -> bool:
    """Return whether fixed points of (4.1) with K ≠ 0 fill a curve; in doubt they do.

    It takes two equal moments, a₁ = a₂, and AK = (0, 0, k): outside that axis dγ/dt is zero on the
    cone (a₃ - a₁)γ₃(Ω + AK, γ) = k(Aγ,γ), whose points are complex where the form is definite.
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
    """Return the sum of the indices: -1 for a saddle, 1 for others that are not degenerate."""
    indices = {"saddle": -1, "degenerate": 0}
    return sum(indices.get(point.kind, 1) for point in points)


def contact_path(parameters: Parameters, gamma: Array) -> ContactPath:
    """Return the contact point's path at the fixed point γ (3,) of (4.1).

    There ω = sγ, and s = (Ω, γ) by (2.2): by (2.1) the velocity aγ×Ω is constant in frame axes,
    which turn about the vertical at s. Raises InputError for a classical ball and where γ is no
    fixed point.
    """
    vertical = as_vector(gamma)
    _check_rubber(parameters)
    if np.abs(flow(parameters, vertical)).max() > _EIGENVALUE_ROUNDING * rate_scale(parameters):
        raise InputError("the contact point runs on a circle only where gamma is a fixed point")
    across = eq.cross(vertical, parameters.Omega)
    return ContactPath(
        speed=float(parameters.a * np.linalg.norm(across)),
        turning=float(eq.dot(parameters.Omega, vertical)),
    )


def _candidates(parameters: Parameters) -> list[Array]:
    """Return a γ (3,) near every fixed point up to sign, and more."""

    def cubic_forms(gamma: Array) -> Array:
        # γ in the generic axes; (Aγ,γ) clears the denominator of (3.2).
        own = as_vector(_GENERIC @ gamma)
        weight = eq.dot(eq.diagonal(parameters.A, own), own)
        return weight * (np.array(flow(parameters, own)) @ _GENERIC)

    # Coefficients by least squares from values, so that (3.2) is written in `equations` alone.
    monomials = list(combinations_with_replacement(range(3), 3))
    # Thrice as many as coefficients, and the same at every run, as is all that follows from them.
    samples = np.random.default_rng(0).normal(size=(30, 3))
    table = np.array([[s[i] * s[j] * s[k] for i, j, k in monomials] for s in samples])
    values = np.array([cubic_forms(s) for s in samples])[:, :2]
    coefficients = np.linalg.lstsq(table, values, rcond=None)[0]
    # In the chart γ = (x, y, 1): powers[form, i, j] of x^i y^j. The third form then is zero too.
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
    found = []
    for x, v in zip(roots, vectors[:6].T, strict=True):
        # v is (y⁵, …, y, 1) times a factor: y is the ratio of neighbours, the largest for digits.
        last = int(np.argmax(np.abs(v[1:])))
        # A double root may come out as a complex pair, a little off the real axis.
        if np.isfinite(x) and abs(x.imag) < 0.01 * (1 + abs(x)) and abs(v[last + 1]) > 0:
            found.append(_GENERIC @ np.array([x.real, (v[last] / v[last + 1]).real, 1.0]))
    return found


def _polished(parameters: Parameters, gamma: Array) -> Array | None:
    """Return the fixed point (3,) that Newton's method reaches from γ, if it does."""
    gamma = gamma / np.linalg.norm(gamma)
    scale = rate_scale(parameters)
    for _ in range(40):
        basis = tangents(gamma)
        rate = basis @ np.array(flow(parameters, as_vector(gamma)))
        # The least solution where the Jacobian is singular, as between two points that coincide.
        step = np.linalg.lstsq(jacobian(parameters, gamma), rate, rcond=1e-13)[0]
        length = float(np.linalg.norm(step))
        # A step by more than 0.3 rad is beyond what is linear, and may lead to another point.
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
    """Return the type of the fixed point γ (3,) with these eigenvalues (2,)."""
    # Rounding decides the sign of less; its type is then another one at every machine.
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
    # The linear part turns without growth, so that the cubic terms decide.
    value = lyapunov_value(flow_near(parameters, gamma), 2)
    if abs(value) < zero:
        return "centre"
    return "slow stable focus" if value < 0 else "slow unstable focus"


def jacobian(parameters: Parameters, gamma: Array) -> Array:
    """Return the linear part (2, 2) of (4.1) on the sphere at γ (3,), along `tangents` [1/s]."""
    return linear_part(flow_near(parameters, gamma), 2)


def rate_scale(parameters: Parameters) -> float:
    """Return the size of the rates of (4.1) [1/s]."""
    return float(
        np.linalg.norm(parameters.Omega) + np.linalg.norm(eq.diagonal(parameters.A, parameters.K))
    )


def attitude_at(gamma: Array) -> Array:
    """Return some attitudes (..., 4) with the verticals γ (..., 3)."""
    return from_matrix(np.concatenate([tangents(gamma), gamma[..., None, :]], axis=-2))


@dataclass(frozen=True)
class FixedCircle(Value):
    """Fixed points γ = cos ψ axes[0] + sin ψ axes[1], of which those with sin 2ψ > 0 attract: Σ_s.

    axes (2, 3): unit vectors across Ω, right-handed with it, along which Σ_s and Σ_u meet; index:
    what the circle as a whole adds to the sum of the indices on the sphere, which is 2.
    """

    parameters: Parameters
    axes: Array
    index: int

    def at(self, angles: Array) -> Array:
        """Return γ (n, 3) at angles ψ (n,) [rad]."""
        return on_circle(self.axes, angles)

    def rate(self, gamma: Array) -> Array:
        """Return the eigenvalue (n,) across the circle at γ (n, 3) on it [1/s]."""
        p = self.parameters
        return np.asarray(eq.rubber_divergence(tuple(gamma.T), p.Omega, p.A))


def fixed_circle(parameters: Parameters) -> FixedCircle | None:
    """Return the circle of fixed points of a rubber ball with K = 0, Ω ≠ 0; None for others."""
    parameters = _without_rounding(parameters)
    if parameters.rolling != "rubber" or np.any(parameters.K) or not np.any(parameters.Omega):
        return None
    along = np.array(parameters.Omega) / np.linalg.norm(parameters.Omega)
    plane = tangents(along)
    # (Aγ, γ×Ω) is |Ω| (A₁₁ - A₂₂)/2 sin 2ψ in axes that make A diagonal there, the larger first.
    weights, vectors = np.linalg.eigh(plane * parameters.A @ plane.T)
    larger = vectors[:, np.argmax(weights)] @ plane
    axes = np.stack([larger, np.cross(along, larger)])
    return FixedCircle(parameters, axes, _index_of(parameters, axes))


def _index_of(parameters: Parameters, axes: Array) -> int:
    """Return the turns of (4.1) along a line just below the circle, less those just above.

    Between the lines and the circle there is no other fixed point.
    """
    along = np.cross(*axes)
    # Principal axes are the other fixed points. The line must pass below the nearest of them, and
    # have samples as dense as it is near, for the flow turns round over that distance.
    heights = np.abs(along)[np.abs(along) > 1e-9]  # of the principal axes over the circle
    height = min(0.02, float(heights.min()) / 2)
    samples = min(_MOST_SAMPLES, int(40 / height))
    angle = np.linspace(0.0, 2 * np.pi, samples + 1)
    out, ahead = on_circle(axes, angle), on_circle(axes, angle + np.pi / 2)
    turns = []
    for sign in (-1.0, 1.0):
        gamma = np.sqrt(1 - height**2) * out + sign * height * along
        rate = np.stack(flow(parameters, tuple(gamma.T)), axis=1)
        direction = np.unwrap(np.arctan2(rate @ along, (rate * ahead).sum(axis=1)))
        turns.append(round(float(direction[-1] - direction[0]) / (2 * np.pi)))
    return turns[0] - turns[1]


def _without_rounding(parameters: Parameters) -> Parameters:
    """Return the ball with zero for what is rounding of Ω and of K = k - dΩ."""

    def exact(v: Vector, size: float) -> Vector:
        return as_vector(np.where(np.abs(v) <= _ROUNDING * size, 0.0, v))

    turning = float(np.linalg.norm(parameters.Omega))
    size = float(np.linalg.norm(parameters.K)) + parameters.d * turning
    return replace(parameters, Omega=exact(parameters.Omega, turning), K=exact(parameters.K, size))


def kappa(parameters: Parameters, j: int) -> float:
    """Return κ of the circle on which γⱼ and γ₃ are not zero; j is 0 or 1."""
    a, a3 = parameters.A[j], parameters.A[2]
    level = 2 * a * a3 * parameters.K[2] / (a3 - a) - parameters.Omega[2]
    return float(level / np.hypot(parameters.Omega[j], parameters.Omega[2]))


def closed_form_points(parameters: Parameters) -> dict[str, Array]:
    """Return isolated fixed points γ (3,) of (4.1) by the paper's names; doubles twice.

    Γ₁ … Γ₆ of (4.4) where K = 0, without those that lie on the circle (Ω, γ) = 0 of fixed points;
    else Γ₅, Γ₆, δ₁ … δ₄, θ₁ … θ₄, as far as they exist.

    Raises InputError unless the ball is a rubber one with K = (0, 0, K₃) and three different aⱼ,
    so that no other curve is filled, and where K₃ ≠ 0 but Ωⱼ = Ω₃ = 0 for a j of 1, 2.
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
        raise InputError("the closed form needs Omega_3, or both Omega_1 and Omega_2, not zero")
    points = {"Γ₅": np.array([0.0, 0.0, 1.0]), "Γ₆": np.array([0.0, 0.0, -1.0])}
    for letter, j in (("δ", 1), ("θ", 0)):
        if abs(kappa(parameters, j)) > 1:
            continue
        arc, shift = np.arcsin(kappa(parameters, j)), np.arctan2(Omega[2], Omega[j])
        # sin(2φ + ν) = κ: 2φ + ν is arc or π - arc, and φ is known up to π.
        first, second = (arc - shift) / 2, -(arc + shift) / 2
        angles = (first, first + np.pi, second + np.pi / 2, second + 3 * np.pi / 2)
        for number, angle in zip("₁₂₃₄", angles, strict=True):
            gamma = np.zeros(3)
            gamma[j], gamma[2] = np.sin(angle), np.cos(angle)
            points[letter + number] = gamma
    return points


def _principal_points(Omega: Vector) -> dict[str, Array]:
    """Return Γ₁ … Γ₆ of (4.4), the principal axes, but for those across Ω."""
    signed = [sign * axis for axis in np.eye(3) for sign in (1.0, -1.0)]
    return {
        f"Γ{number}": gamma
        for number, gamma in zip("₁₂₃₄₅₆", signed, strict=True)
        if gamma @ Omega != 0
    }


def name_of(parameters: Parameters, gamma: Array) -> str:
    """Return the paper's name of the fixed point γ (3,), or nothing where it has none."""
    try:
        points = closed_form_points(parameters)
    except InputError:
        return ""
    # _SAME is far more than Newton's method leaves, and two points of a ball are far more apart.
    near = (name for name, point in points.items() if np.abs(point - gamma).max() < _SAME)
    return next(near, "")

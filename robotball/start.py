"""Where a motion starts: the attitude and the momentum, from the forms the paper uses."""

import math
from dataclasses import dataclass

import numpy as np

from robotball.errors import InputError
from robotball.rotations import Array, from_matrix, normalised
from robotball.value import Value

# How far a given unit vector, right angle or horizontal momentum may be off: a caption's six
# digits pass, a wrong number does not. What passes is then made exact.
CAPTION = 1e-5
# How far a momentum may be off by rounding alone, relative to the terms that it is the sum of.
ROUNDING = 1e-12


@dataclass(frozen=True)
class Start(Value):
    """The attitude (4,), frame to world, and the momentum M (3,) in world axes [kg m²/s].

    hinge_angles, hinge_rates (h,): of every hinge, in the order of `Scene.hinges` [rad, rad/s];
    None is 0 for the angles, and for the rates what is commanded, or 0 where no rate is. The rate
    of a hinge that keeps the commanded one is not asked for here.
    """

    attitude: Array
    momentum: Array
    hinge_angles: Array | None = None
    hinge_rates: Array | None = None


def section_state(L: float, l: float, g: float, f: float, c: float = 0.0) -> tuple[Array, Array]:
    """γ (3,) and M (3,) in principal axes of the section coordinates (5.5).

    L [kg m²/s] and l [rad] place M, whose square is f [(kg m²/s)²]; g [rad] turns γ about it;
    c = (M, γ) [kg m²/s]. Raises InputError unless f > 0, L² <= f and c² < f.
    """
    if not f > 0:
        raise InputError(f"f = M² must be positive, not {f:g}")
    G = np.sqrt(f)
    if not abs(L) <= G:
        raise InputError(f"|L| = {abs(L):g} must not exceed sqrt(f) = {G:g}")
    if not abs(c) < G:
        raise InputError(f"|c| = {abs(c):g} must be smaller than sqrt(f) = {G:g}")
    across = np.sqrt(1 - (L / G) ** 2)
    M = G * np.array([across * np.sin(l), across * np.cos(l), L / G])
    node = np.array([np.cos(l), -np.sin(l), 0.0])
    level = np.array([L / G * np.sin(l), L / G * np.cos(l), -across])
    gamma = np.sin(g) * node + np.cos(g) * level
    return c / f * M + np.sqrt(1 - c * c / f) * gamma, M


def along_momentum(gamma: Array, M: Array) -> Start:
    """The start whose world axes are those of section 3.3: OX against the horizontal part of M.

    α = -(M - cγ)/√(f - c²), β = M×γ/√(f - c²), with gamma (3,) a unit vector and M (3,), both in
    frame axes. Raises InputError where M is vertical or zero, for then α and β must be given.
    """
    c = M @ gamma
    horizontal = M - c * gamma
    size = np.linalg.norm(horizontal)
    if not size > 1e-12 * np.linalg.norm(M):
        raise InputError("M has no horizontal part to lay OX along; give alpha or a quaternion too")
    return Start(
        attitude=attitude_of_axes(gamma, -horizontal / size), momentum=np.array([-size, 0.0, c])
    )


def attitude_of_axes(gamma: Array, alpha: Array) -> Array:
    """The quaternion (4,) of γ (3,) and α (3,): Z and X of space, unit vectors in frame axes.

    Raises InputError unless they are orthogonal.
    """
    cosine = float(gamma @ alpha)
    if not abs(cosine) <= CAPTION:
        raise InputError(f"gamma and alpha are not orthogonal: (gamma, alpha) = {cosine:.6g}")
    alpha = alpha - cosine * gamma
    alpha = alpha / np.linalg.norm(alpha)
    return from_matrix(np.stack([alpha, np.cross(gamma, alpha), gamma]))


def unit(name: str, v: Array) -> Array:
    """`v` (n,) at length one exactly; raises InputError if it is not a unit vector already."""
    length = math.hypot(*v.tolist())  # overflows nowhere
    if not abs(length - 1) <= CAPTION:
        raise InputError(f"{name} is not of unit length: |{name}| = {length:.6g}")
    return normalised(v)


def horizontal(M: Array, scale: float) -> Array:
    """A rubber start's M (3,), world axes, without its vertical part, which (3.1) makes zero.

    scale: the size of the terms whose sum M is; where they cancel, M is their rounding [kg m²/s].
    Raises InputError where the vertical part is more than a caption's rounding.
    """
    size, vertical = math.hypot(*M.tolist()), float(M[2])
    if not abs(vertical) <= max(CAPTION * size, ROUNDING * scale):
        raise InputError(
            f"M is not horizontal, as the rubber model's is by (3.1): (M, gamma) = {vertical:.6g} "
            f"of |M| = {size:.6g} kg m²/s"
        )
    return M * [1.0, 1.0, 0.0]


def check_no_spin(shell: Array, gamma: Array) -> None:
    """Raises InputError unless the shell's ω - Ω (3,) has no part along γ, as (2.2) demands."""
    spin = float(shell @ gamma)
    if not abs(spin) <= CAPTION * float(np.linalg.norm(shell)):
        raise InputError(
            f"angular_velocity spins the shell on the spot, which the rubber model forbids (2.2): "
            f"(ω - Ω, γ) = {spin:.6g} rad/s"
        )

"""Arrays of a user's numbers; rotations as quaternions (w, x, y, z); unit vectors; uneven times."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from robotball.errors import InputError

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Mask = NDArray[np.bool_]
Z: Array = np.array([0.0, 0.0, 1.0])


def as_floats(what: str, value: object, shape: tuple[int, ...] | None = None) -> Array:
    """Return a copy of numbers that a user gave as an array.

    Raises InputError unless they are numbers of the shape; None allows any.
    """
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        array = None
    if array is None or shape not in (None, array.shape):
        of_shape = f" of shape {shape}" if shape else ""
        raise InputError(f"{what} must be numbers{of_shape}, not {value!r}")
    return array


def multiply(p: Array, q: Array) -> Array:
    """Return the unit quaternion p∘q (..., 4): first the rotation q, then p."""
    return (_rotation(p) * _rotation(q)).as_quat(scalar_first=True)


def conjugate(q: Array) -> Array:
    """Return the inverse rotations of unit quaternions (..., 4)."""
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def turned(q: Array, turn: Array) -> Array:
    """Return unit quaternions q (..., 4) after turns (..., 3) [rad] about axes of the frame."""
    return (_rotation(q) * Rotation.from_rotvec(turn)).as_quat(scalar_first=True)


def turn_between(p: Array, q: Array) -> Array:
    """Return turns (..., 3) [rad] about axes of the frame from unit quaternions p to q (..., 4)."""
    return (_rotation(p).inv() * _rotation(q)).as_rotvec()


def angle_between(p: Array, q: Array) -> Array:
    """Return the angles (...) [rad] of the turns from unit quaternions p to q (..., 4)."""
    return np.linalg.norm(turn_between(p, q), axis=-1)


def rotation_matrix(q: Array) -> Array:
    """Return matrices (..., 3, 3) of quaternions (..., 4); the rows of one are α, β, γ."""
    return _rotation(q).as_matrix()


def from_matrix(R: Array) -> Array:
    """Return the unit quaternions (..., 4), w >= 0, of rotation matrices (..., 3, 3)."""
    # Canonical: q and -q are one rotation, and equal rotations are to have equal numbers.
    return Rotation.from_matrix(R).as_quat(canonical=True, scalar_first=True)


def perpendicular(axis: Array) -> Array:
    """Return a unit vector orthogonal to each of `axis` (..., 3)."""
    # The coordinate axis that is least along `axis` keeps the cross product far from zero.
    helper = np.eye(3)[np.argmin(np.abs(axis), axis=-1)]
    side = np.cross(axis, helper)
    return side / np.linalg.norm(side, axis=-1, keepdims=True)


def tangents(axis: Array) -> Array:
    """Return two unit vectors (..., 2, 3) across `axis` (..., 3), right-handed with it."""
    first = perpendicular(axis)
    return np.stack([first, np.cross(axis, first)], axis=-2)


def on_circle(axes: Array, angles: Array) -> Array:
    """Return cos ψ e + sin ψ f (..., 3) of unit vectors e, f (2, 3), at angles ψ (...) [rad]."""
    return np.stack([np.cos(angles), np.sin(angles)], axis=-1) @ axes


def z_along(axis: Array) -> Array:
    """Return a quaternion that turns z onto `axis` (3,)."""
    return from_matrix(np.stack([*tangents(axis), axis], axis=1))


def normalised(v: Array) -> Array:
    """Return `v` (n,) at length one."""
    # A unit vector is kept to the last bit: dividing by 1 - 1e-16 would move a start that is read
    # from a file again and again.
    length = np.linalg.norm(v)
    return v if abs(length - 1) <= 1e-15 else v / length


def direction(name: str, v: Array) -> Array:
    """Return a unit vector (3,) along `v` (3,). Raises InputError where it has no direction."""
    length = float(np.linalg.norm(v))
    if not (np.isfinite(length) and length > 0):
        raise InputError(f"{name} must have a length and a direction, unlike {v.tolist()}")
    return normalised(v)


def _rotation(q: Array) -> Rotation:
    return Rotation.from_quat(q, scalar_first=True)


_GOLDEN = (5**0.5 - 1) / 2


def uneven(end: float, gap: float) -> Array:
    """Return increasing times (n,) from 0 to `end` [s], at most `gap` apart, of no period."""
    count = np.ceil(1.5 * end / gap)
    k = np.arange(count + 1)
    # The parts of k² times an irrational number repeat with no period (Weyl).
    return np.asarray(end * (k + 0.5 * (k * k * _GOLDEN % 1) * (k < count)) / count)


def continuous(attitude: Array) -> Array:
    """Return quaternions (n, 4) without jumps of the sign, as q and -q are one attitude."""
    cosines = (attitude[1:] * attitude[:-1]).sum(axis=1)
    signs = np.cumprod(np.concatenate([[1.0], np.where(cosines < 0, -1.0, 1.0)]))
    return attitude * signs[:, None]

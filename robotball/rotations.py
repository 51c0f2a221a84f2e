"""Quaternions (w, x, y, z), unit vectors, and arrays of numbers given by the user."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from robotball.errors import InputError

# A component may be a number, a column, or any other type with + - *.
Quaternion = tuple[Any, Any, Any, Any]
_Vector = tuple[Any, Any, Any]
Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
Mask = NDArray[np.bool_]
Z: Array = np.array([0.0, 0.0, 1.0])
_GOLDEN = (5**0.5 - 1) / 2  # golden ratio, 1/φ


def as_floats(name: str, value: object, shape: tuple[int, ...] | None = None) -> Array:
    """Return a copy of the user's `value` as a float array.

    Raises InputError unless it is numeric and has the given shape; None allows any shape.
    """
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"{name} must be numbers, not {value!r}") from None
    if shape not in (None, array.shape):
        raise InputError(f"{name} must have shape {shape}; {value!r} has shape {array.shape}")
    return array


def quaternion_product(p: Quaternion, q: Quaternion) -> Quaternion:
    """Return p∘q of quaternions (w, x, y, z): first the rotation q, then p."""
    return (
        p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
        p[0] * q[1] + q[0] * p[1] + (p[2] * q[3] - p[3] * q[2]),
        p[0] * q[2] + q[0] * p[2] + (p[3] * q[1] - p[1] * q[3]),
        p[0] * q[3] + q[0] * p[3] + (p[1] * q[2] - p[2] * q[1]),
    )


def unit_space_axes(q: Quaternion) -> tuple[_Vector, _Vector, _Vector]:
    """Return α, β, γ of a quaternion, multiplied by the square of the quaternion's length."""
    w, x, y, z = q
    ww, xx, yy, zz = w * w, x * x, y * y, z * z
    return (
        (ww + xx - yy - zz, 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), ww + yy - xx - zz, 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), ww + zz - xx - yy),
    )


def multiply(p: Array, q: Array) -> Array:
    """Return the unit quaternion p∘q (..., 4): rotate by q first, then by p."""
    return _unit(np.stack(quaternion_product(_components(p), _components(q)), axis=-1))


def conjugate(q: Array) -> Array:
    """Return the inverse rotations of unit quaternions (..., 4)."""
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def turned(q: Array, turn: Array) -> Array:
    """Return q (..., 4) after further rotations by vectors `turn` (..., 3) in frame axes [rad]."""
    half = np.linalg.norm(turn, axis=-1, keepdims=True) / 2
    rotation = np.concatenate([np.cos(half), np.sinc(half / np.pi) / 2 * turn], axis=-1)
    return multiply(q, rotation)


def turn_between(p: Array, q: Array) -> Array:
    """Return the rotation vectors (..., 3) in frame axes that take p to q (..., 4) [rad]."""
    turn = multiply(conjugate(p), q)
    turn = np.where(turn[..., :1] < 0, -turn, turn)  # not more than half a revolution
    half = np.arctan2(np.linalg.norm(turn[..., 1:], axis=-1, keepdims=True), turn[..., :1])
    return 2 * turn[..., 1:] / np.sinc(half / np.pi)


def angle_between(p: Array, q: Array) -> Array:
    """Return the rotation angles (...) between unit quaternions p and q (..., 4) [rad]."""
    return np.linalg.norm(turn_between(p, q), axis=-1)


def rotation_matrix(q: Array) -> Array:
    """Return the rotation matrices (..., 3, 3) of quaternions (..., 4); their rows are α, β, γ."""
    rows = [np.stack(row, axis=-1) for row in unit_space_axes(_components(q))]
    return np.stack(rows, axis=-2)


def from_matrix(R: Array) -> Array:
    """Return the unit quaternions (..., 4), w >= 0, of rotation matrices (..., 3, 3)."""
    # The rows of 4 q qᵀ are multiples of q. The longest row loses no digits.
    diagonal = np.diagonal(R, axis1=-2, axis2=-1)
    trace = diagonal.sum(axis=-1, keepdims=True)
    rows = np.empty((*R.shape[:-2], 4, 4))
    rows[..., 1:, 1:] = R + R.swapaxes(-1, -2)
    rows[..., 0, 1:] = np.stack([R[..., k - 1, k - 2] - R[..., k - 2, k - 1] for k in range(3)], -1)
    rows[..., 1:, 0] = rows[..., 0, 1:]
    squares = np.concatenate([1 + trace, 1 - trace + 2 * diagonal], axis=-1)
    rows[..., range(4), range(4)] = squares
    longest = squares.argmax(axis=-1)[..., None, None]
    q = _unit(np.take_along_axis(rows, longest, axis=-2)[..., 0, :])
    # q and -q are the same rotation. w >= 0 makes equal rotations have equal numbers.
    first = np.take_along_axis(q, (q != 0).argmax(axis=-1)[..., None], axis=-1)
    return np.where(first < 0, -q, q)


def perpendicular(axis: Array) -> Array:
    """Return a unit vector orthogonal to each `axis` (..., 3)."""
    # The coordinate axis with the smallest component keeps the cross product away from zero.
    helper = np.eye(3)[np.argmin(np.abs(axis), axis=-1)]
    side = np.cross(axis, helper)
    return side / np.linalg.norm(side, axis=-1, keepdims=True)


def tangents(axis: Array) -> Array:
    """Return two unit vectors (..., 2, 3) orthogonal to `axis` (..., 3), right-handed with it."""
    first = perpendicular(axis)
    return np.stack([first, np.cross(axis, first)], axis=-2)


def on_circle(axes: Array, angles: Array) -> Array:
    """Return cos ψ e + sin ψ f (..., 3) for `axes` e, f (2, 3) and angles ψ (...) [rad]."""
    return np.stack([np.cos(angles), np.sin(angles)], axis=-1) @ axes


def z_along(axis: Array) -> Array:
    """Return a unit quaternion (4,) that rotates z onto the unit vector `axis` (3,)."""
    return from_matrix(np.stack([*tangents(axis), axis], axis=1))


def normalised(v: Array) -> Array:
    """Return `v` (n,) scaled to unit length."""
    # A vector that has unit length within rounding is returned unchanged. Otherwise an initial
    # state would change by one bit each time that it is written to a file and read again.
    length = np.linalg.norm(v)
    return v if abs(length - 1) <= 1e-15 else v / length


def direction(name: str, v: Array) -> Array:
    """Return the unit vector (3,) along `v` (3,). Raises InputError if `v` is zero or infinite."""
    length = float(np.linalg.norm(v))
    if not (np.isfinite(length) and length > 0):
        raise InputError(f"{name} must be finite and not zero; it is {v.tolist()}")
    return normalised(v)


def _unit(q: Array) -> Array:
    w, x, y, z = np.moveaxis(q, -1, 0)
    return q / np.sqrt(x * x + y * y + z * z + w * w)[..., None]


def _components(q: Array) -> Quaternion:
    return tuple(np.moveaxis(_unit(q), -1, 0))


def uneven(end: float, gap: float) -> Array:
    """Return increasing times (n,) at uneven intervals of at most `gap`, from 0 to `end` [s]."""
    count = np.ceil(1.5 * end / gap)
    k = np.arange(count + 1)
    # The fractional parts of k² times an irrational number never repeat (Weyl).
    return np.asarray(end * (k + 0.5 * (k * k * _GOLDEN % 1) * (k < count)) / count)


def continuous(attitude: Array) -> Array:
    """Return quaternions (n, 4) with signs changed so that neighbours do not jump.

    q and -q are the same rotation.
    """
    cosines = (attitude[1:] * attitude[:-1]).sum(axis=1)
    signs = np.cumprod(np.concatenate([[1.0], np.where(cosines < 0, -1.0, 1.0)]))
    return attitude * signs[:, None]


def symmetric(xx: float, yy: float, zz: float, xy: float, xz: float, yz: float) -> Array:
    """Return a symmetric matrix (3, 3)."""
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])

"""Quaternions (w, x, y, z), as in MuJoCo, by scipy's rotations."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def multiply(p: Array, q: Array) -> Array:
    """The unit quaternion p∘q (..., 4): first the rotation q, then p."""
    return (_rotation(p) * _rotation(q)).as_quat(scalar_first=True)


def conjugate(q: Array) -> Array:
    """The inverse rotations of unit quaternions (..., 4)."""
    return q * np.array([1.0, -1.0, -1.0, -1.0])


def rotation_matrix(q: Array) -> Array:
    """Matrices (..., 3, 3) of quaternions (..., 4); the rows of one are α, β, γ."""
    return _rotation(q).as_matrix()


def from_matrix(R: Array) -> Array:
    """The unit quaternions (..., 4), w >= 0, of rotation matrices (..., 3, 3)."""
    return Rotation.from_matrix(R).as_quat(canonical=True, scalar_first=True)


def perpendicular(axis: Array) -> Array:
    """Some unit vectors (..., 3) orthogonal to `axis` (..., 3)."""
    helper = np.eye(3)[np.argmin(np.abs(axis), axis=-1)]
    side = np.cross(axis, helper)
    return side / np.linalg.norm(side, axis=-1, keepdims=True)


def z_along(axis: Array) -> Array:
    """A quaternion that turns z onto `axis`."""
    side = perpendicular(axis)
    return from_matrix(np.stack([side, np.cross(axis, side), axis], axis=1))


def normalised(v: Array) -> Array:
    """`v` (n,) at length one; as it is, to the last bit, where it has that but for rounding."""
    length = np.linalg.norm(v)
    return v if abs(length - 1) <= 1e-15 else v / length


def _rotation(q: Array) -> Rotation:
    return Rotation.from_quat(q, scalar_first=True)

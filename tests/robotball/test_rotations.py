"""Quaternions: scipy's rotations and the axes of robot/formulas.py agree with them."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from robotball.robot import formulas as eq
from robotball.rotations import (
    Array,
    angle_between,
    conjugate,
    from_matrix,
    multiply,
    quaternion_product,
    rotation_matrix,
    turn_between,
    turned,
    z_along,
)
from tests.vectors import gap, units

ROUNDING = 3e-15  # of a few products of numbers of size one; measured at most 7.8e-16


quaternions = units(4)
ANGLES = st.floats(0.0, 3.1)


@given(p=quaternions, q=quaternions)
def test_a_product_of_quaternions_is_the_product_of_rotations(p: Array, q: Array) -> None:
    """R(p∘q) = R(p)R(q), first q, then p; and R(q*) = R(q)ᵀ. For single ones and stacks."""
    product = multiply(p, q)
    assert gap(rotation_matrix(product), rotation_matrix(p) @ rotation_matrix(q)) < ROUNDING
    assert gap(quaternion_product(tuple(p), tuple(q)), product) < ROUNDING
    assert gap(rotation_matrix(conjugate(q)), rotation_matrix(q).T) < ROUNDING
    stack = multiply(np.stack([p, q]), np.stack([q, p]))
    np.testing.assert_array_equal(stack, [product, multiply(q, p)])


@given(p=quaternions, q=quaternions, length=st.floats(0.1, 10.0), turn=units(), angle=ANGLES)
def test_rotations_are_those_of_scipy(
    p: Array, q: Array, length: float, turn: Array, angle: float
) -> None:
    """Products, matrices and rotation vectors, of quaternions of any length, and of stacks."""
    stack, other = length * np.stack([p, q, p]), np.stack([q, p, p])
    left, right = (Rotation.from_quat(each, scalar_first=True) for each in (stack, other))
    vectors = angle * np.stack([turn, -turn, 1e-9 * turn])
    turns, between = Rotation.from_rotvec(vectors), (left.inv() * right).magnitude()
    assert gap(multiply(stack, other), (left * right).as_quat(scalar_first=True)) < ROUNDING
    assert gap(turned(stack, vectors), (left * turns).as_quat(scalar_first=True)) < ROUNDING
    assert gap(rotation_matrix(stack), left.as_matrix()) < ROUNDING
    assert gap(angle_between(stack, other), between) < ROUNDING
    assert gap(turn_between(stack, turned(stack, vectors)), vectors) < 2 * ROUNDING
    back = Rotation.from_matrix(left.as_matrix()).as_quat(canonical=True, scalar_first=True)
    assert gap(from_matrix(left.as_matrix()), back) < ROUNDING


@given(q=quaternions)
def test_from_matrix_inverts_rotation_matrix(q: Array) -> None:
    """It returns q or -q, the one with w >= 0, also for half turns."""
    back = from_matrix(rotation_matrix(q))
    assert back[0] >= 0
    assert min(gap(back, q), gap(back, -q)) < ROUNDING


@given(q=quaternions, length=st.floats(0.1, 10.0))
def test_rows_of_the_matrix_are_the_space_axes(q: Array, length: float) -> None:
    """α, β, γ of robot/formulas.py, for any quaternion length, are the rows of scipy's matrix."""
    w, x, y, z = (length * q).tolist()
    axes, R = eq.space_axes((w, x, y, z)), rotation_matrix(q)
    assert gap(axes, R) < ROUNDING
    assert gap(eq.seen_from_frame((0.3, -0.2, 0.9), axes), [0.3, -0.2, 0.9] @ R) < ROUNDING


@given(axis=units(), angle=st.floats(0.0, 3.1))
def test_z_along_rotates_z_onto_the_axis(axis: Array, angle: float) -> None:
    """A rotation about the axis leaves it there, and has the angle of the rotation."""
    laid = z_along(axis)
    assert gap(rotation_matrix(laid)[:, 2], axis) < ROUNDING
    turn = np.array([np.cos(angle / 2), *(np.sin(angle / 2) * axis)])
    turned = multiply(turn, laid)
    assert gap(rotation_matrix(turned)[:, 2], axis) < ROUNDING
    for sign in (1, -1):
        assert gap(angle_between(laid, sign * turned), angle) < ROUNDING

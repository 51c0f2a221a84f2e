"""Quaternions: scipy's rotations and the formulas of equations.py agree, whatever the rotation."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from robotball import equations as eq
from robotball.equations import as_vector
from robotball.rotations import (
    Array,
    conjugate,
    from_matrix,
    multiply,
    perpendicular,
    rotation_matrix,
)

ROUNDING = 3e-15  # of a few products of numbers of size one; measured at most 7.8e-16

components = st.floats(-1.0, 1.0)


def gap(a: ArrayLike, b: ArrayLike) -> float:
    """The largest difference of two arrays' entries."""
    return float(np.abs(np.asarray(a) - np.asarray(b)).max())


@st.composite
def unit_vectors(draw: st.DrawFn, size: int) -> Array:
    v = np.array(draw(st.tuples(*[components] * size)))
    length = np.linalg.norm(v)
    return v / length if length > 1e-3 else np.eye(size)[0]


quaternions = unit_vectors(4)


@given(p=quaternions, q=quaternions)
def test_product_of_quaternions_is_that_of_their_rotations(p: Array, q: Array) -> None:
    """R(p∘q) = R(p)R(q): first q, then p."""
    product = rotation_matrix(multiply(p, q))
    assert gap(product, rotation_matrix(p) @ rotation_matrix(q)) < ROUNDING


@given(q=quaternions)
def test_conjugate_turns_back(q: Array) -> None:
    """R(q*) = R(q)ᵀ, and q∘q* is no rotation at all."""
    assert gap(rotation_matrix(conjugate(q)), rotation_matrix(q).T) < ROUNDING
    assert gap(multiply(q, conjugate(q)), [1, 0, 0, 0]) < ROUNDING


@given(q=quaternions)
def test_matrix_gives_its_quaternion_back(q: Array) -> None:
    """from_matrix(R(q)) is q or -q, the one with w >= 0, also for half turns."""
    back = from_matrix(rotation_matrix(q))
    assert back[0] >= 0
    assert min(gap(back, q), gap(back, -q)) < ROUNDING


@given(q=quaternions, length=st.floats(0.1, 10.0))
def test_rows_of_the_matrix_are_the_space_axes(q: Array, length: float) -> None:
    """α, β, γ of equations.py, for a quaternion of any length, are the rows of scipy's matrix."""
    w, x, y, z = (length * q).tolist()
    assert gap(eq.space_axes((w, x, y, z)), rotation_matrix(q)) < ROUNDING


@given(axis=unit_vectors(3))
def test_perpendicular_is_a_unit_vector_at_a_right_angle(axis: Array) -> None:
    """(axis, perpendicular) = 0 and its length is 1, for every axis."""
    side = perpendicular(axis)
    assert abs(side @ axis) < ROUNDING
    assert abs(np.linalg.norm(side) - 1) < ROUNDING


def test_functions_take_stacks_of_rotations() -> None:
    """Arrays (..., 4) and (..., 3, 3) go through as single rotations do."""
    q = np.random.default_rng(0).normal(size=(7, 4))
    q /= np.linalg.norm(q, axis=1, keepdims=True)
    p = q[::-1]
    np.testing.assert_array_equal(
        multiply(p, q), [multiply(a, b) for a, b in zip(p, q, strict=True)]
    )
    np.testing.assert_array_equal(rotation_matrix(q), [rotation_matrix(a) for a in q])
    np.testing.assert_array_equal(from_matrix(rotation_matrix(q)).shape, (7, 4))
    assert as_vector(rotation_matrix(q)[0, 2]) == tuple(rotation_matrix(q[0])[2])

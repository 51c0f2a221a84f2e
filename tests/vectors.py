"""Helpers for vectors: differences and random unit vectors."""

import numpy as np
from hypothesis import assume
from hypothesis import strategies as st
from numpy.typing import ArrayLike

from robotball.rotations import Array

X, Y, Z = np.eye(3)


def gap(a: ArrayLike, b: ArrayLike) -> float:
    """Return the largest difference between entries of two arrays."""
    return float(np.abs(np.asarray(a) - np.asarray(b)).max())


@st.composite
def units(draw: st.DrawFn, size: int = 3) -> Array:
    """Draw unit vectors (size,), often along an axis."""
    v = np.array(draw(st.tuples(*[st.floats(-1.0, 1.0)] * size)))
    length = np.linalg.norm(v)
    assume(length > 1e-3)
    return v / length

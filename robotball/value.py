"""Records with arrays in them, compared by what they hold."""

from dataclasses import fields
from typing import Any

import numpy as np


class Value:
    """A dataclass of this kind equals another of its type whose fields all have the same values.

    Arrays are the same where each number is, nan with nan; fields with compare=False do not count.
    As any record with an array in it, it has no hash.
    """

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        # In the class itself, so that its dataclass makes no other.
        cls.__eq__ = _equal  # type: ignore[method-assign]


def _equal(one: Any, other: Any) -> Any:
    if type(one) is not type(other):
        return NotImplemented
    return all(
        same(getattr(one, each.name), getattr(other, each.name))
        for each in fields(one)
        if each.compare
    )


def same(one: Any, other: Any) -> bool:
    """Whether two values are equal; arrays, and those in tuples, number by number."""
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        if np.shape(one) != np.shape(other):
            return False
        one, other = np.asarray(one), np.asarray(other)
        return np.array_equal(one, other, equal_nan=one.dtype.kind in "fc")
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    try:
        return bool(one == other)
    except ValueError:  # of a user's own record with an array in it
        return one is other

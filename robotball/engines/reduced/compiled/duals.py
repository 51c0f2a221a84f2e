"""Dual numbers: a value with its derivative, carried through plain arithmetic.

Run on them, the functions of equations.py give directional derivatives exact to round-off, so
no derivative is written out by hand. The parts may be floats, NumPy columns or symbols.
"""

from dataclasses import dataclass
from typing import Any

from robotball.equations import Vector


@dataclass(frozen=True)
class Dual:
    """value + ε slope, with ε² = 0."""

    value: Any
    slope: Any
    __array_ufunc__ = None  # leaves array ∘ Dual to the methods below

    def __add__(self, other: Any) -> "Dual":
        other = dual(other)
        return Dual(self.value + other.value, self.slope + other.slope)

    __radd__ = __add__

    def __sub__(self, other: Any) -> "Dual":
        other = dual(other)
        return Dual(self.value - other.value, self.slope - other.slope)

    def __rsub__(self, other: Any) -> "Dual":
        return dual(other) - self

    def __neg__(self) -> "Dual":
        return Dual(-self.value, -self.slope)

    def __mul__(self, other: Any) -> "Dual":
        other = dual(other)
        return Dual(self.value * other.value, self.slope * other.value + self.value * other.slope)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> "Dual":
        other = dual(other)
        per_other = 1 / other.value
        ratio = self.value * per_other
        return Dual(ratio, (self.slope - ratio * other.slope) * per_other)

    def __rtruediv__(self, other: Any) -> "Dual":
        return dual(other) / self


def dual(x: Any) -> Dual:
    """`x`, or the constant x as a dual number."""
    return x if isinstance(x, Dual) else Dual(x, 0.0)


def along(v: Vector, direction: Vector) -> Vector:
    """The vector v that moves in a direction."""
    return (Dual(v[0], direction[0]), Dual(v[1], direction[1]), Dual(v[2], direction[2]))


def slopes(v: Vector) -> Vector:
    """The derivatives of a vector of dual numbers."""
    return (dual(v[0]).slope, dual(v[1]).slope, dual(v[2]).slope)

"""Plain functions of arithmetic run on other numbers: dual numbers, and symbols on a tape.

Dual numbers carry a value with its derivative. Run on them, the functions of equations.py give
directional derivatives exact to round-off, so no derivative is written out by hand.

Symbols trace a function into straight-line code. A loop over lanes becomes vector instructions only
if its body is flat: no calls, no inner loops. A compiled right-hand side that is called from the
loop stays scalar, four times slower. So the functions are run once on symbols that note every
operation, and the notes are the body of the loop: the formulas still stand in one place only.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from robotball.equations import Vector


@dataclass(frozen=True)
class Dual:
    """value + ε slope, with ε² = 0; the parts may be floats, NumPy columns or symbols."""

    value: Any
    slope: Any
    # NumPy would try array ∘ Dual element by element; this leaves it to the methods below.
    __array_ufunc__ = None

    def __add__(self, other: Any) -> "Dual":
        other = _dual(other)
        return Dual(self.value + other.value, self.slope + other.slope)

    __radd__ = __add__

    def __sub__(self, other: Any) -> "Dual":
        other = _dual(other)
        return Dual(self.value - other.value, self.slope - other.slope)

    def __rsub__(self, other: Any) -> "Dual":
        return _dual(other) - self

    def __neg__(self) -> "Dual":
        return Dual(-self.value, -self.slope)

    def __mul__(self, other: Any) -> "Dual":
        other = _dual(other)
        return Dual(self.value * other.value, self.slope * other.value + self.value * other.slope)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> "Dual":
        other = _dual(other)
        # One division in place of two: it takes a processor several times as long as a product.
        per_other = 1 / other.value
        ratio = self.value * per_other
        return Dual(ratio, (self.slope - ratio * other.slope) * per_other)

    def __rtruediv__(self, other: Any) -> "Dual":
        return _dual(other) / self


def _dual(x: Any) -> Dual:
    """Return `x`, or the constant x as a dual number."""
    return x if isinstance(x, Dual) else Dual(x, 0.0)


def along(v: Vector, direction: Vector) -> Vector:
    """Return the vector v as one that moves in a direction."""
    return (Dual(v[0], direction[0]), Dual(v[1], direction[1]), Dual(v[2], direction[2]))


def slopes(v: Vector) -> Vector:
    """Return the derivatives of a vector of dual numbers."""
    return (_dual(v[0]).slope, _dual(v[1]).slope, _dual(v[2]).slope)


# Doubles in an AVX-512 register; on narrower machines they take several registers.
LANES = 8
# Doubles in an AVX register: where one orbit alone is waited for, the narrower step is done sooner.
FEW = 4


class Tape:
    """The operations noted so far, each distinct one once: common parts are computed once."""

    def __init__(self, lanes: int) -> None:
        self.lanes = lanes
        self.names: dict[str, str] = {}

    def at(self, row: int) -> str:
        """Return the lane's element of a row of the workspace, in generated code."""
        return f"w[{row * self.lanes} + i]"

    def read(self, row: int) -> "Symbol":
        """Return the symbol of the lane's element of a row."""
        return self.input(self.at(row))

    def input(self, expression: str) -> "Symbol":
        """Return the symbol of a value that the generated code finds by `expression`."""
        return Symbol(self, self.names.setdefault(expression, f"t{len(self.names)}"))

    @property
    def lines(self) -> list[str]:
        """One assignment an operation, in an order in which they can run."""
        return [f"{name} = {expression}" for expression, name in self.names.items()]


class Symbol:
    """A number yet unknown, on a tape. Sums with 0 and products with 0 and 1 are not noted."""

    __slots__ = ("name", "tape")

    def __init__(self, tape: Tape, name: str) -> None:
        self.tape = tape
        self.name = name

    def __add__(self, other: Any) -> Any:
        return self if _is_number(other, 0) else self._note("+", other, either_way=True)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        return self if _is_number(other, 0) else self._note("-", other)

    def __rsub__(self, other: float) -> "Symbol":
        return -self if other == 0 else self.tape.input(f"{text(other)} - {self.name}")

    def __neg__(self) -> "Symbol":
        return self.tape.input(f"-{self.name}")

    def __mul__(self, other: Any) -> Any:
        if _is_number(other, 0):
            return 0.0
        return self if _is_number(other, 1) else self._note("*", other, either_way=True)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        # Exact, and a product is the quicker.
        return self * 0.5 if _is_number(other, 2) else self._note("/", other)

    def __rtruediv__(self, other: float) -> "Symbol":
        return self.tape.input(f"{text(other)} / {self.name}")

    def sqrt(self) -> "Symbol":
        """Return the square root, which equations.py does without but a unit vector needs."""
        return self.tape.input(f"sqrt({self.name})")

    def at_most(self, other: "Symbol | float") -> "Symbol":
        """Return whether this <= other, for `choose`; false where either is not a number."""
        return self.tape.input(f"{self.name} <= {text(other)}")

    def at_least(self, other: "Symbol | float") -> "Symbol":
        """Return whether this >= other, for `choose`; false where either is not a number."""
        return self.tape.input(f"{self.name} >= {text(other)}")

    def below(self, other: "Symbol | float") -> "Symbol":
        """Return whether this < other, for `choose`; false where either is not a number."""
        return self.tape.input(f"{self.name} < {text(other)}")

    def __and__(self, other: "Symbol") -> "Symbol":
        return self.tape.input(f"{self.name} & {other.name}")

    def choose(self, yes: "Symbol | float", no: "Symbol | float") -> "Symbol":
        """Return `yes` where this condition holds, `no` elsewhere."""
        return self.tape.input(f"{text(yes)} if {self.name} else {text(no)}")

    def _note(self, operator: str, other: Any, either_way: bool = False) -> Any:
        if not isinstance(other, Symbol | float | int):
            # The other operand may be a dual number of symbols, which knows what to do.
            return NotImplemented
        # Sorted, a + b and b + a are noted as one operation.
        operands = [self.name, text(other)]
        return self.tape.input(f" {operator} ".join(sorted(operands) if either_way else operands))


def _is_number(operand: Any, value: float) -> bool:
    """Return whether the operand is known already, and is `value`."""
    return isinstance(operand, float | int) and operand == value


def text(operand: "Symbol | float") -> str:
    """Return the operand in generated code; floats to their last bit."""
    return operand.name if isinstance(operand, Symbol) else repr(float(operand))


def lane_function(name: str, tape: Tape, results: Mapping[int, "Symbol | float"]) -> str:
    """Return the source of a function of a workspace (rows·lanes,) that runs a tape in every lane.

    It needs `wide_vectors`, of no arguments, and `sqrt` in its module, where Python runs it.
    results: the value to write to each row, after all is computed.
    """
    # The compiler can see that lanes are independent because the workspace is flat, with rows that
    # stand a known number of lanes apart.
    body = [*tape.lines, *(f"{tape.at(row)} = {text(value)}" for row, value in results.items())]
    head = (f"def {name}(w):", "    wide_vectors()", f"    for i in range({tape.lanes}):")
    return "\n".join((*head, *(f"        {line}" for line in body)))


def least(a: "Symbol", b: "Symbol | float") -> "Symbol":
    """Return the smaller of two numbers; b where a is not a number."""
    return a.at_most(b).choose(a, b)

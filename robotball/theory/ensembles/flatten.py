"""Dual numbers and symbols, on which plain arithmetic functions can be evaluated.

Dual numbers carry a value and its derivative. With them the functions of formulas.py give
directional derivatives to round-off.

Symbols trace a function into straight-line code of vectors with a number for each lane: functions
are evaluated once on symbols that record every operation. A loop over lanes that calls a compiled
right-hand side would stay scalar, four times slower, and one with the record in its body compiles
twice as long.
"""

from dataclasses import dataclass
from typing import Any

import numba
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from robotball.robot.formulas import Vector


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
        # One division in place of two, because a division takes several times as long as a product.
        per_other = 1 / other.value
        ratio = self.value * per_other
        return Dual(ratio, (self.slope - ratio * other.slope) * per_other)

    def __rtruediv__(self, other: Any) -> "Dual":
        return _dual(other) / self


def _dual(x: Any) -> Dual:
    """Return `x`, or the constant x as a dual number."""
    return x if isinstance(x, Dual) else Dual(x, 0.0)


def along(v: Vector, direction: Vector) -> Vector:
    """Return the vector v with a direction as its derivative."""
    return (Dual(v[0], direction[0]), Dual(v[1], direction[1]), Dual(v[2], direction[2]))


def slopes(v: Vector) -> Vector:
    """Return the derivatives of a vector of dual numbers."""
    return (_dual(v[0]).slope, _dual(v[1]).slope, _dual(v[2]).slope)


LANES = 8  # doubles in an AVX-512 register; other machines need several registers
FEW = 4  # doubles in an AVX register; the narrower step is faster for a single orbit


class Tape:
    """Recorded operations, each distinct one once.

    Attributes
    ----------
    notes : dict
        Maps (operation, *operands) to the name of the result. Operands are names and numbers.
    results : dict
        Maps a row of the workspace to the name or number that is written to it at the end.
    """

    def __init__(self) -> None:
        self.notes: dict[tuple[str, ...], str] = {}
        self.results: dict[int, str] = {}

    def note(self, operation: str, *operands: Any) -> "Symbol":
        """Return the symbol of an operation's result."""
        note = operation, *map(str, operands)
        return Symbol(self, self.notes.setdefault(note, f"t{len(self.notes)}"))

    def read(self, row: int) -> "Symbol":
        """Return the symbol of the lane's element of a row of the workspace."""
        return self.note("load", row)

    def write(self, row: int, value: "Symbol | float") -> None:
        """Write a value to the lane's element of a row at the end."""
        self.results[row] = str(value)


class Symbol:
    """An unknown number on a tape. Sums with 0 and products with 0 and 1 are not recorded."""

    __slots__ = ("name", "tape")

    def __init__(self, tape: Tape, name: str) -> None:
        self.tape = tape
        self.name = name

    def __str__(self) -> str:
        return self.name

    def __add__(self, other: Any) -> Any:
        return self if _is_number(other, 0) else self._note("fadd", other, either_way=True)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        return self if _is_number(other, 0) else self._note("fsub", other)

    def __rsub__(self, other: float) -> "Symbol":
        return -self if other == 0 else self.tape.note("fsub", other, self)

    def __neg__(self) -> "Symbol":
        # Negation as in numba: LLVM would reorder sums with fneg.
        return self.tape.note("fsub", -0.0, self)

    def __mul__(self, other: Any) -> Any:
        if _is_number(other, 0):
            return 0.0
        return self if _is_number(other, 1) else self._note("fmul", other, either_way=True)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        # Exact, and a product is faster.
        return self * 0.5 if _is_number(other, 2) else self._note("fdiv", other)

    def __rtruediv__(self, other: float) -> "Symbol":
        return self.tape.note("fdiv", other, self)

    def sqrt(self) -> "Symbol":
        """Return the square root."""
        return self.tape.note("sqrt", self)

    # Conditions for `choose`; false if either side is NaN.

    def __le__(self, other: "Symbol | float") -> "Symbol":
        return self.tape.note("<=", self, other)

    def __ge__(self, other: "Symbol | float") -> "Symbol":
        return self.tape.note(">=", self, other)

    def __lt__(self, other: "Symbol | float") -> "Symbol":
        return self.tape.note("<", self, other)

    def __and__(self, other: "Symbol") -> "Symbol":
        return self.tape.note("and_", self, other)

    def choose(self, yes: "Symbol | float", no: "Symbol | float") -> "Symbol":
        """Return `yes` if this condition holds, else `no`."""
        return self.tape.note("select", self, yes, no)

    def _note(self, operation: str, other: Any, either_way: bool = False) -> Any:
        if not isinstance(other, Symbol | float | int):
            # A dual number of symbols handles the operation.
            return NotImplemented
        # Sorted, so that a + b and b + a are one operation.
        operands = [self, other]
        return self.tape.note(operation, *sorted(operands, key=str) if either_way else operands)


def _is_number(operand: Any, value: float) -> bool:
    """Return whether the operand is a number equal to `value`."""
    return isinstance(operand, float | int) and operand == value


def least(a: "Symbol", b: "Symbol | float") -> "Symbol":
    """Return the smaller of two numbers, or b if a is NaN."""
    return (a <= b).choose(a, b)


_WIDEST = '"prefer-vector-width"="512"'


_tapes: dict[str, Tape] = {}
"""Maps the name of a lane function to its tape."""


def _all_lanes(_: Any, workspace: Any, lanes: Any, name: Any) -> Any:
    """Run the named tape in all lanes of a workspace; `lanes` and `name` are literals."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        # LLVM uses half of the vector width on some processors, which is a third slower here.
        # numba's setting would affect the whole process, this attribute only one function.
        # llvmlite's check of names refuses attributes with a value, so it is added to the set. If
        # the user sets the features of the processor, these determine the width.
        if numba.config.CPU_FEATURES is None:
            set.add(builder.function.attributes, _WIDEST)
        tape, count = _tapes[name.literal_value], lanes.literal_value
        numbers = ir.VectorType(ir.DoubleType(), count)
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        rows = builder.bitcast(array.data, numbers.as_pointer())
        values: dict[str, Any] = {}

        def at(row: int) -> Any:
            return builder.gep(rows, [context.get_constant(types.int64, row)])

        def value(operand: str) -> Any:
            known = values.get(operand)
            return numbers([float(operand)] * count) if known is None else known

        for (operation, *operands), result in tape.notes.items():
            if operation == "load":
                values[result] = builder.load(at(int(operands[0])), align=8)
                continue
            arguments_of = [value(operand) for operand in operands]
            if operation == "sqrt":
                root = builder.module.declare_intrinsic(
                    f"llvm.sqrt.v{count}f64", fnty=ir.FunctionType(numbers, [numbers])
                )
                values[result] = builder.call(root, arguments_of)
            elif operation in ("<=", ">=", "<"):
                values[result] = builder.fcmp_ordered(operation, *arguments_of)
            else:
                values[result] = getattr(builder, operation)(*arguments_of)
        for row, result in tape.results.items():
            builder.store(value(result), at(row), align=8)
        return context.get_dummy_value()

    return types.void(workspace, lanes, name), generate


_run_in_all_lanes: Any = intrinsic(prefer_literal=True)(_all_lanes)


def lane_function(name: str, tape: Tape, lanes: int) -> Any:
    """Return a function of a workspace (rows·lanes,), for numba, that runs a tape in every lane.

    The name must be unique in the process, because numba links compiled and loaded code with it.
    The operations go directly to LLVM, because numba would need seconds to infer the types of
    thousands of names.
    """

    # The closure has the name of the tape, because numba's cache compares the values in a closure,
    # and a tape or an intrinsic differs in every process.
    def in_every_lane(w: Any) -> None:
        _run_in_all_lanes(w, lanes, name)

    # Two threads may trace the same tape at once.
    if vars(_tapes.setdefault(name, tape)) != vars(tape):
        raise ValueError(f"the lane function {name} runs another tape: choose another name")
    in_every_lane.__name__ = in_every_lane.__qualname__ = name
    return in_every_lane

"""Dual numbers, and code for many lanes, from plain arithmetic functions.

Dual numbers carry a value and its derivative. With them the functions of formulas.py give
directional derivatives to round-off.

A lane function evaluates a step with symbols, which are vectors with a number for each lane. A loop
over lanes that calls a compiled right-hand side would stay scalar and be four times slower. A loop
with all operations in its body would take twice as long to compile.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partialmethod
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


class Symbol:
    """A vector with a number for each lane; the numbers become known when the code is executed.

    Products with 0 are left out, because LLVM keeps them for infinite numbers.
    """

    __slots__ = ("builder", "value")

    def __init__(self, builder: ir.IRBuilder, value: Any) -> None:
        self.builder, self.value = builder, value

    def _write(self, operation: str, other: Any, swapped: bool = False) -> Any:
        if not isinstance(other, Symbol | float | int):
            # A dual number of symbols handles the operation.
            return NotImplemented
        pair = [self.value, _value(other, self.value.type)]
        value = getattr(self.builder, operation)(*(pair[::-1] if swapped else pair))
        return Symbol(self.builder, value)

    __add__ = __radd__ = partialmethod(_write, "fadd")
    __sub__, __rsub__ = partialmethod(_write, "fsub"), partialmethod(_write, "fsub", swapped=True)
    __truediv__ = partialmethod(_write, "fdiv")
    __rtruediv__ = partialmethod(_write, "fdiv", swapped=True)

    def __mul__(self, other: Any) -> Any:
        is_zero = isinstance(other, float | int) and other == 0
        return 0.0 if is_zero else self._write("fmul", other)

    __rmul__ = __mul__

    def __neg__(self) -> Any:
        # Negation as in numba: LLVM would reorder sums with fneg.
        return -0.0 - self

    def sqrt(self) -> "Symbol":
        """Return the square root."""
        kind = self.value.type
        root = self.builder.module.declare_intrinsic(
            f"llvm.sqrt.v{kind.count}f64", fnty=ir.FunctionType(kind, [kind])
        )
        return Symbol(self.builder, self.builder.call(root, [self.value]))

    # Conditions for `choose`; false if either side is NaN.

    def _compare(self, operation: str, other: "Symbol | float") -> "Symbol":
        other = _value(other, self.value.type)
        return Symbol(self.builder, self.builder.fcmp_ordered(operation, self.value, other))

    __le__, __ge__ = partialmethod(_compare, "<="), partialmethod(_compare, ">=")
    __lt__ = partialmethod(_compare, "<")

    def __and__(self, other: "Symbol") -> "Symbol":
        return Symbol(self.builder, self.builder.and_(self.value, other.value))

    def choose(self, yes: "Symbol | float", no: "Symbol | float") -> "Symbol":
        """Return `yes` in the lanes in which this condition holds, else `no`."""
        kind = ir.VectorType(ir.DoubleType(), self.value.type.count)
        chosen = self.builder.select(self.value, _value(yes, kind), _value(no, kind))
        return Symbol(self.builder, chosen)


def _value(number: Symbol | float, kind: Any) -> Any:
    """Return LLVM's value of a symbol, or of a number as a constant of a type."""
    return number.value if isinstance(number, Symbol) else kind([float(number)] * kind.count)


def least(a: Symbol, b: Symbol | float) -> Symbol:
    """Return the smaller of two numbers, or b if a is NaN."""
    return (a <= b).choose(a, b)


_WIDEST = '"prefer-vector-width"="512"'


_steps: dict[str, tuple[Any, ...]] = {}
"""Maps the name of a lane function to its step, with further arguments of it."""


def _all_lanes(_: Any, workspace: Any, lanes: Any, name: Any) -> Any:
    """Run the named step in all lanes of a workspace; `lanes` and `name` are literals."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        # LLVM uses half of the vector width on some processors, which is a third slower here.
        # numba's setting would affect the whole process, this attribute only one function.
        # llvmlite's check of names refuses attributes with a value, so it is added to the set. If
        # the user sets the features of the processor, these determine the width.
        if numba.config.CPU_FEATURES is None:
            set.add(builder.function.attributes, _WIDEST)
        vector = ir.VectorType(ir.DoubleType(), lanes.literal_value)
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        rows = builder.bitcast(array.data, vector.as_pointer())

        def at(row: int) -> Any:
            return builder.gep(rows, [context.get_constant(types.int64, row)])

        def read(row: int) -> Symbol:
            return Symbol(builder, builder.load(at(row), align=8))

        step, *more = _steps[name.literal_value]
        for row, result in step(read, *more).items():
            builder.store(result.value, at(row), align=8)
        return context.get_dummy_value()

    return types.void(workspace, lanes, name), generate


_run_in_all_lanes: Any = intrinsic(prefer_literal=True)(_all_lanes)


def lane_function(name: str, lanes: int, step: Callable[..., dict[int, Symbol]], *more: Any) -> Any:
    """Return a function of a workspace (rows·lanes,), for numba, that does a step in every lane.

    step(read, *more) -> the new symbols of rows; read(row) -> the symbol of a row. The name must be
    unique in the process, because numba links compiled and loaded code with it.
    """

    # The closure has the name of the step, because numba's cache compares the values in a closure,
    # and an intrinsic differs in every process.
    def in_every_lane(w: Any) -> None:
        _run_in_all_lanes(w, lanes, name)

    # Two threads may ask for the same step at once.
    if _steps.setdefault(name, (step, *more)) != (step, *more):
        raise ValueError(f"the lane function {name} does another step: choose another name")
    in_every_lane.__name__ = in_every_lane.__qualname__ = name
    return in_every_lane

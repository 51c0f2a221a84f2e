"""Compile formulas by evaluating them on symbols, whose operations become instructions of LLVM.

numba needs seconds to infer the types of hundreds of names and functions. Here a formula is called
once for each place in the code where its instructions stand. It must have no conditions, and no
loops over unknown numbers.
"""

from functools import wraps
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.registry import cpu_target
from numba.extending import lower_builtin, type_callable

from robotball.theory.compiled import Function

_DOUBLE = ir.DoubleType()


class Symbol:
    """A number that is not known yet, or a vector with a number for each lane.

    Sums with 0 and products with 0 and 1 are left out.
    """

    __slots__ = ("builder", "value")

    def __init__(self, builder: ir.IRBuilder, value: Any) -> None:
        self.builder, self.value = builder, value

    def __add__(self, other: Any) -> Any:
        return self if _is_number(other, 0) else self._write("add", self, other)

    __radd__ = __add__

    def __sub__(self, other: Any) -> Any:
        return self if _is_number(other, 0) else self._write("sub", self, other)

    def __rsub__(self, other: float) -> Any:
        return -self if other == 0 else self._write("sub", other, self)

    def __neg__(self) -> Any:
        # Negation as in numba: LLVM would reorder sums with fneg.
        return self._write("sub", -0.0, self)

    def __mul__(self, other: Any) -> Any:
        if _is_number(other, 0):
            return 0.0
        return self if _is_number(other, 1) else self._write("mul", self, other)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        # Exact, and a product is faster.
        return self * 0.5 if _is_number(other, 2) else self._write("div", self, other)

    def __rtruediv__(self, other: float) -> Any:
        return self._write("div", other, self)

    def _write(self, operation: str, a: Any, b: Any) -> Any:
        kind = self.value.type
        if not all(isinstance(x, Symbol | float | int) for x in (a, b)):
            # A dual number of symbols handles the operation.
            return NotImplemented
        write = getattr(
            self.builder, operation if isinstance(kind, ir.IntType) else f"f{operation}"
        )
        return Symbol(self.builder, write(_value(a, kind), _value(b, kind)))

    def sqrt(self) -> "Symbol":
        """Return the square root of a vector."""
        kind = self.value.type
        root = self.builder.module.declare_intrinsic(
            f"llvm.sqrt.v{kind.count}f64", fnty=ir.FunctionType(kind, [kind])
        )
        return Symbol(self.builder, self.builder.call(root, [self.value]))

    # Conditions for `choose`; false if either side is NaN.

    def __le__(self, other: "Symbol | float") -> "Symbol":
        return self._compare("<=", other)

    def __ge__(self, other: "Symbol | float") -> "Symbol":
        return self._compare(">=", other)

    def __lt__(self, other: "Symbol | float") -> "Symbol":
        return self._compare("<", other)

    def _compare(self, operation: str, other: "Symbol | float") -> "Symbol":
        other = _value(other, self.value.type)
        return Symbol(self.builder, self.builder.fcmp_ordered(operation, self.value, other))

    def __and__(self, other: "Symbol") -> "Symbol":
        return Symbol(self.builder, self.builder.and_(self.value, other.value))

    def choose(self, yes: "Symbol | float", no: "Symbol | float") -> "Symbol":
        """Return `yes` in the lanes in which this condition holds, else `no`."""
        kind = ir.VectorType(_DOUBLE, self.value.type.count)
        chosen = self.builder.select(self.value, _value(yes, kind), _value(no, kind))
        return Symbol(self.builder, chosen)


def _is_number(operand: Any, value: float) -> bool:
    """Return whether the operand is a number equal to `value`."""
    return isinstance(operand, float | int) and operand == value


def _value(number: Symbol | float, kind: Any) -> Any:
    """Return LLVM's value of a symbol, or of a known number as a constant of a type."""
    if isinstance(number, Symbol):
        return number.value
    return kind([float(number)] * kind.count if isinstance(kind, ir.VectorType) else number)


class _Table:
    """An array of numbers, or a row of one."""

    def __init__(self, builder: ir.IRBuilder, pointer: Any, lengths: Any) -> None:
        self.builder, self.pointer, self.lengths = builder, pointer, lengths

    def _at(self, index: Any) -> Any:
        index = _value(index, self.lengths[0].type)
        for length in self.lengths[1:]:
            index = self.builder.mul(index, length)
        return self.builder.gep(self.pointer, [index])

    def __getitem__(self, index: Any) -> Any:
        if len(self.lengths) > 1:
            return _Table(self.builder, self._at(index), self.lengths[1:])
        return Symbol(self.builder, self.builder.load(self._at(index)))

    def __setitem__(self, index: Any, number: Symbol | float) -> None:
        self.builder.store(_value(number, self.pointer.type.pointee), self._at(index))


def _argument(context: Any, builder: ir.IRBuilder, kind: Any, value: Any) -> Any:
    """Return an argument with symbols for its numbers."""
    if isinstance(kind, types.BaseTuple):
        values = cgutils.unpack_tuple(builder, value)
        parts = [_argument(context, builder, *pair) for pair in zip(kind, values, strict=True)]
        return getattr(kind, "instance_class", lambda *parts: parts)(*parts)
    if isinstance(kind, types.Array):
        array = context.make_array(kind)(context, builder, value)
        return _Table(builder, array.data, cgutils.unpack_tuple(builder, array.shape))
    return Symbol(builder, value)


def _type_of(result: Any) -> Any:
    if isinstance(result, tuple):
        return types.BaseTuple.from_types([_type_of(part) for part in result])
    return types.none if result is None else types.float64


def _packed(context: Any, builder: ir.IRBuilder, kind: Any, result: Any) -> Any:
    """Return LLVM's value of a result."""
    if isinstance(result, tuple):
        pairs = zip(kind, result, strict=True)
        parts = [_packed(context, builder, *pair) for pair in pairs]
        return context.make_tuple(builder, kind, parts)
    return context.get_dummy_value() if result is None else _value(result, _DOUBLE)


def traced(function: Function) -> Function:
    """Let compiled functions call a formula, whose instructions are written into each of them."""

    def evaluated(context: Any, builder: ir.IRBuilder, kinds: Any, values: Any) -> Any:
        pairs = zip(kinds, values, strict=True)
        return function(*(_argument(context, builder, *pair) for pair in pairs))

    def typer(_: Any) -> Any:
        def type_of(*kinds: Any) -> Any:
            # Evaluated once more only for the type, in a function that is not used.
            context, nothing = cpu_target.target_context, ir.FunctionType(ir.VoidType(), ())
            unused = ir.Function(ir.Module(), nothing, "unused").append_basic_block()
            values = [ir.Constant(context.get_value_type(kind), ir.Undefined) for kind in kinds]
            return _type_of(evaluated(context, ir.IRBuilder(unused), kinds, values))

        return wraps(function)(type_of)

    def generate(context: Any, builder: ir.IRBuilder, signature: Any, values: Any) -> Any:
        result = evaluated(context, builder, signature.args, values)
        return _packed(context, builder, signature.return_type, result)

    type_callable(function)(typer)
    lower_builtin(function, types.VarArg(types.Any))(generate)
    return function

"""Plain functions of arithmetic run on other numbers: dual numbers, and symbols on a tape.

Dual numbers carry a value with its derivative. Run on them, the functions of equations.py give
directional derivatives exact to round-off, so no derivative is written out by hand.

Symbols trace a function into straight-line code. A loop over lanes becomes vector instructions only
if its body is flat: no calls, no inner loops. A compiled right-hand side that is called from the
loop stays scalar, four times slower. So the functions are run once on symbols that note every
operation, and the notes are the body of the loop: the formulas still stand in one place only.
"""

from dataclasses import dataclass
from typing import Any

import numba
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
    """The operations noted so far, each distinct one once: common parts are computed once.

    notes: what is computed, the name of each result by its operation and operands, which are names
    and numbers; results: what is written to each row of the workspace after that.
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
        """Write a value to the lane's element of a row, after all is computed."""
        self.results[row] = str(value)


class Symbol:
    """A number yet unknown, on a tape. Sums with 0 and products with 0 and 1 are not noted."""

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
        # As numba negates: LLVM would add up sums with fneg in another order.
        return self.tape.note("fsub", -0.0, self)

    def __mul__(self, other: Any) -> Any:
        if _is_number(other, 0):
            return 0.0
        return self if _is_number(other, 1) else self._note("fmul", other, either_way=True)

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Any:
        # Exact, and a product is the quicker.
        return self * 0.5 if _is_number(other, 2) else self._note("fdiv", other)

    def __rtruediv__(self, other: float) -> "Symbol":
        return self.tape.note("fdiv", other, self)

    def sqrt(self) -> "Symbol":
        """Return the square root, which equations.py does without but a unit vector needs."""
        return self.tape.note("sqrt", self)

    # Conditions, for `choose`; false where either side is not a number.

    def __le__(self, other: "Symbol | float") -> "Symbol":
        return self.tape.note("<=", self, other)

    def __ge__(self, other: "Symbol | float") -> "Symbol":
        return self.tape.note(">=", self, other)

    def __lt__(self, other: "Symbol | float") -> "Symbol":
        return self.tape.note("<", self, other)

    def __and__(self, other: "Symbol") -> "Symbol":
        return self.tape.note("and_", self, other)

    def choose(self, yes: "Symbol | float", no: "Symbol | float") -> "Symbol":
        """Return `yes` where this condition holds, `no` elsewhere."""
        return self.tape.note("select", self, yes, no)

    def _note(self, operation: str, other: Any, either_way: bool = False) -> Any:
        if not isinstance(other, Symbol | float | int):
            # The other operand may be a dual number of symbols, which knows what to do.
            return NotImplemented
        # Sorted, a + b and b + a are noted as one operation.
        operands = [self, other]
        return self.tape.note(operation, *sorted(operands, key=str) if either_way else operands)


def _is_number(operand: Any, value: float) -> bool:
    """Return whether the operand is known already, and is `value`."""
    return isinstance(operand, float | int) and operand == value


def least(a: "Symbol", b: "Symbol | float") -> "Symbol":
    """Return the smaller of two numbers; b where a is not a number."""
    return (a <= b).choose(a, b)


def _wide(_: Any) -> Any:
    """Let the function that calls this have the widest vectors that the processor has."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        # LLVM holds some processors to half of their vectors' width, a third slower here. numba's
        # setting would be one of the whole process, while this attribute is of one function alone.
        # llvmlite's list of attributes has none with a value, so it is added past the check of its
        # name. A user who sets the features of the processor decides the width as well.
        if numba.config.CPU_FEATURES is None:
            set.add(builder.function.attributes, _WIDEST)
        return context.get_dummy_value()

    return types.void(), generate


_WIDEST = '"prefer-vector-width"="512"'
_wide_vectors: Any = intrinsic(_wide)


_tapes: dict[str, Tape] = {}
"""The tape of each lane function, by its name."""


def _one_lane(_: Any, workspace: Any, lane: Any, lanes: Any, name: Any) -> Any:
    """Run the tape of that name in one lane of a workspace; `lanes` and `name` are literals."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        workspace = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        tape = _tapes[name.literal_value]
        values: dict[str, Any] = {}

        def at(row: int) -> Any:
            begin = context.get_constant(types.int64, row * lanes.literal_value)
            return builder.gep(workspace, [builder.add(begin, arguments[1])])

        def value(operand: str) -> Any:
            known = values.get(operand)
            return context.get_constant(types.float64, float(operand)) if known is None else known

        for (operation, *operands), found in tape.notes.items():
            if operation == "load":
                values[found] = builder.load(at(int(operands[0])))
                continue
            given = [value(each) for each in operands]
            if operation == "sqrt":
                root = builder.module.declare_intrinsic("llvm.sqrt", [given[0].type])
                values[found] = builder.call(root, given)
            elif operation in ("<=", ">=", "<"):
                values[found] = builder.fcmp_ordered(operation, *given)
            else:
                values[found] = getattr(builder, operation)(*given)
        for row, result in tape.results.items():
            builder.store(value(result), at(row))
        return context.get_dummy_value()

    return types.void(workspace, lane, lanes, name), generate


_run_in_one_lane: Any = intrinsic(prefer_literal=True)(_one_lane)


def lane_function(name: str, tape: Tape, lanes: int) -> Any:
    """Return a function of a workspace (rows·lanes,), for numba, that runs a tape in every lane.

    The name must be unique in the process: numba links compiled and loaded code by it. The
    compiler can see that lanes are independent because the workspace is flat, with rows that stand
    a known number of lanes apart. The operations are handed to LLVM one by one, because numba
    would spend seconds on the types of thousands of names that are all floats.
    """

    # The closure holds the tape's name and not the tape or an intrinsic of its own, because numba's
    # cache compares the values that a closure holds, and an intrinsic differs in every process.
    def in_every_lane(w: Any) -> None:
        _wide_vectors()
        for i in range(lanes):
            _run_in_one_lane(w, i, lanes, name)

    # Two threads may trace the same tape at once.
    if vars(_tapes.setdefault(name, tape)) != vars(tape):
        raise ValueError(f"the lane function {name} runs another tape: choose another name")
    in_every_lane.__name__ = in_every_lane.__qualname__ = name
    return in_every_lane

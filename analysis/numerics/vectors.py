"""Vectors of doubles as values in Numba kernels: one number for each lane of the processor, with the operators of Python.

Numba vectorises only loops whose arrays cannot overlap, and seldom a loop over a few lanes. Here each operation is one
instruction for all lanes. An array in lanes is flat: number i of lane l is at ``LANES * i + l``.
"""

from __future__ import annotations

import operator
from collections.abc import Sequence
from typing import Any, ClassVar

from llvmlite import ir
from numba import float64, int64, types
from numba.core import cgutils
from numba.core.datamodel.models import PrimitiveModel
from numba.core.datamodel.registry import register_default
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin

from .lanes import constant, declare_function, repeat_number, vector, width

#: Number of doubles in a vector of the processor.
LANES = width()


class Lanes(types.Type):  # type: ignore[misc]
    """Numba type of a vector: one double in each lane."""

    def __init__(self) -> None:
        super().__init__(name=f"Lanes({LANES})")


LANE = Lanes()
_KIND = vector(LANES)


@register_default(Lanes)
class _Model(PrimitiveModel):  # type: ignore[misc]
    def __init__(self, models: Any, kind: Lanes) -> None:
        super().__init__(models, kind, _KIND)


def _to_vector(builder: Any, kind: Any, value: Any) -> Any:
    """Return a value of the Numba type ``kind`` as a vector; a number is repeated in all lanes."""
    return value if isinstance(kind, Lanes) else repeat_number(builder, value, LANES)


def _operator(function: Any, instruction: str) -> None:
    """Define an operator, by its LLVM instruction, for two vectors and for a vector and a number."""
    pairs = ((LANE, LANE), (float64, LANE), (LANE, float64))

    @infer_global(function)
    class _Types(ConcreteTemplate):  # type: ignore[misc]
        cases: ClassVar = [signature(LANE, *pair) for pair in pairs]

    def lower(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return getattr(builder, instruction)(*map(_to_vector, [builder] * 2, signature.args, arguments))

    for pair in pairs:
        lower_builtin(function, *pair)(lower)


_operator(operator.add, "fadd")
_operator(operator.sub, "fsub")
_operator(operator.mul, "fmul")
_operator(operator.truediv, "fdiv")


def _pointer(context: Any, builder: Any, kind: Any, array: Any, index: Any) -> Any:
    """Return a pointer to the vector number ``index`` of an array in lanes."""
    data = context.make_array(kind)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [builder.mul(index, ir.Constant(index.type, LANES))]), _KIND.as_pointer())


@intrinsic
def load(typing_context, array, index):
    """Return the entry ``index`` of each lane from an array in lanes."""

    def generate(context, builder, signature, arguments):
        return builder.load(_pointer(context, builder, signature.args[0], *arguments), align=8)

    return LANE(array, int64), generate


@intrinsic
def store(typing_context, array, index, value):
    """Write the entry ``index`` of each lane into an array in lanes."""

    def generate(context, builder, signature, arguments):
        value = _to_vector(builder, signature.args[2], arguments[2])
        builder.store(value, _pointer(context, builder, signature.args[0], *arguments[:2]), align=8)
        return context.get_dummy_value()

    return types.void(array, int64, value), generate


@intrinsic
def spread(typing_context, rows, index, value):
    """Write the value of lane l into row l of an array, shape (LANES, n), at the column ``index``.

    Use it for results that are read lane by lane: each lane then has one contiguous row. Reading every LANES-th number of an
    array in lanes is slower on some processors.
    """

    def generate(context, builder, signature, arguments):
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        length = builder.extract_value(array.shape, 1)
        for lane in range(LANES):
            row = builder.mul(length, ir.Constant(length.type, lane))
            number = (
                arguments[2] if LANES == 1 else builder.extract_element(arguments[2], ir.Constant(ir.IntType(32), lane))
            )
            builder.store(number, builder.gep(array.data, [builder.add(row, arguments[1])]))
        return context.get_dummy_value()

    return types.void(rows, int64, LANE), generate


def _call_intrinsic(name: str) -> Any:
    """Return a function that writes the call of an LLVM intrinsic; numbers among the arguments become vectors."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        values = [_to_vector(builder, *one) for one in zip(signature.args, arguments)]
        full = f"llvm.{name}.v{LANES}f64" if LANES > 1 else f"llvm.{name}.f64"
        return builder.call(declare_function(builder.module, full, _KIND, len(values)), values)

    return generate


@intrinsic
def multiply_add(typing_context, a, b, c):
    """Return a * b + c for vectors or numbers, rounded once."""
    return LANE(a, b, c), _call_intrinsic("fma")


@intrinsic
def absolute(typing_context, a):
    """Return the absolute value in each lane."""
    return LANE(LANE), _call_intrinsic("fabs")


@intrinsic
def square_root(typing_context, a):
    """Return the square root in each lane."""
    return LANE(LANE), _call_intrinsic("sqrt")


@intrinsic
def greater(typing_context, a, b):
    """Return the greater of two numbers in each lane; the second if one of them is NaN."""

    def generate(context, builder, signature, arguments):
        a, b = arguments
        return builder.select(builder.fcmp_ordered(">", a, b), a, b)

    return LANE(LANE, LANE), generate


# Weighted sums of rows

#: Weights of a sum of rows: each the index of a row and its weight.
Weights = Sequence[tuple[int, float]]


def nonzero_weights(weights: Sequence[float]) -> Weights:
    """Return the weights that are not zero, each with its index."""
    return [(row, weight) for row, weight in enumerate(weights) if weight != 0.0]


def weighted_rows(table: Sequence[Weights]) -> Any:
    """Return a compiled function f(n, x, rows, h, out): out = x + h (sum over ``table[n]`` of weight * rows[row]).

    ``x`` may be None for zero. Each sum is written out without a loop, in the order of the table, for two columns at a time.
    Between two sums an integrator calls a function that computes a row, one number after the other: two numbers are soon
    there, whereas a longer vector would wait for the last.
    """

    @intrinsic
    def combine(typing_context: Any, n: Any, x: Any, rows: Any, h: Any, out: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            number, begin, rows, h, out = (
                context.make_array(kind)(context, builder, value) if isinstance(kind, types.Array) else value
                for kind, value in zip(signature.args, arguments)
            )
            columns, length = builder.extract_value(out.shape, 0), builder.extract_value(rows.shape, 1)

            def write_columns(weights: Weights, lanes: int, first: Any, end: Any) -> None:
                kind = vector(lanes)

                def at(data: Any, place: Any) -> Any:
                    return builder.bitcast(builder.gep(data, [place]), kind.as_pointer())

                step = repeat_number(builder, h, lanes)
                with cgutils.for_range_slice(builder, first, end, length.type(lanes), length.type) as (column, _):
                    total = None
                    for row, weight in weights:
                        place = builder.add(builder.mul(length, length.type(row)), column)
                        term = builder.fmul(constant(kind, weight), builder.load(at(rows.data, place), align=8))
                        total = term if total is None else builder.fadd(total, term)
                    total = builder.fmul(step, total)
                    if signature.args[1] != types.none:
                        total = builder.fadd(builder.load(at(begin.data, column), align=8), total)
                    builder.store(total, at(out.data, column), align=8)

            even = builder.and_(columns, columns.type(-2))
            end = builder.append_basic_block()
            chosen = builder.switch(number, end)
            for i, weights in enumerate(table):
                if weights:
                    chosen.add_case(number.type(i), block := builder.append_basic_block())
                    with builder.goto_block(block):
                        write_columns(weights, 2, columns.type(0), even)
                        write_columns(weights, 1, even, columns)
                        builder.branch(end)
            builder.position_at_end(end)
            return context.get_dummy_value()

        return types.void(int64, x, rows, float64, out), generate

    return combine

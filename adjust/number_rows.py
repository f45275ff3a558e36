"""Four or six numbers side by side in an array, which compiled kernels work on together.

The compiler handles several numbers in one instruction where a loop over them is long. Rows of a few numbers,
with which normal equations are made, it takes one by one, because it does not know whether what it has stored
was about to be read. A kernel that says which numbers belong together takes half the time:

    total = six(sums, row, column)
    total = plus(total, factor, six(values, other_row, other_column))
    put(sums, row, column, total)

Every number is rounded after each operation, as outside of such rows. Where kernels are interpreted, they are
what they mean: parts of arrays.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic, models, register_model


class NumberRow(types.Type):
    """The type of a few numbers side by side."""

    def __init__(self, count: int) -> None:
        self.count = count
        super().__init__(name=f"NumberRow({count})")


@register_model(NumberRow)
class _Model(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: NumberRow) -> None:
        row = ir.VectorType(ir.DoubleType(), kind.count)
        super().__init__(manager, kind, row)  # type: ignore[no-untyped-call]


def _place(context: Any, builder: Any, signature: Any, values: Any, count: int) -> Any:
    """Pointer to so many numbers of a C-contiguous array from (row, column) on."""
    kind = signature.args[0]
    array = context.make_array(kind)(context, builder, values[0])
    index = [
        context.cast(builder, value, its, types.intp)
        for value, its in zip(values[1:3], signature.args[1:3], strict=True)
    ]
    first = cgutils.get_item_pointer(context, builder, kind, array, index)  # type: ignore[no-untyped-call]
    return builder.bitcast(first, ir.VectorType(ir.DoubleType(), count).as_pointer())


def _compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    found: Callable[..., Any] = intrinsic(function)
    return found


def _loader(count: int) -> Callable[..., Any]:
    def load(_: Any, array: Any, row: Any, column: Any) -> Any:
        def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            return builder.load(_place(context, builder, signature, values, count), align=8)

        return NumberRow(count)(array, row, column), code

    return _compiled(load)


def _store(_: Any, array: Any, row: Any, column: Any, numbers: Any) -> Any:
    def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        place = _place(context, builder, signature, values, numbers.count)
        builder.store(values[3], place, align=8)
        return context.get_dummy_value()

    return types.void(array, row, column, numbers), code


def _combination(operation: str) -> Callable[..., Any]:
    def combine(_: Any, total: Any, factor: Any, numbers: Any) -> Any:
        def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            row = ir.VectorType(ir.DoubleType(), numbers.count)
            nothing = ir.Constant(row, ir.Undefined)
            number = context.cast(builder, values[1], signature.args[1], types.float64)
            one = builder.insert_element(nothing, number, ir.Constant(ir.IntType(32), 0))
            everywhere = ir.Constant(ir.VectorType(ir.IntType(32), numbers.count), [0] * numbers.count)
            factors = builder.shuffle_vector(one, nothing, everywhere)
            return getattr(builder, operation)(values[0], builder.fmul(factors, values[2]))

        return total(total, factor, numbers), code

    return _compiled(combine)


def four(array: Any, row: int, column: int) -> Any:
    """The four numbers of a C-contiguous array (·, ·) from (row, column) on."""
    return array[row, column : column + 4]


def six(array: Any, row: int, column: int) -> Any:
    """The six numbers of a C-contiguous array (·, ·) from (row, column) on."""
    return array[row, column : column + 6]


def put(array: Any, row: int, column: int, numbers: Any) -> None:
    """Store numbers in a C-contiguous array (·, ·) from (row, column) on."""
    array[row, column : column + len(numbers)] = numbers


def plus(total: Any, factor: float, numbers: Any) -> Any:
    """Numbers and a factor times others."""
    return total + factor * numbers


def minus(total: Any, factor: float, numbers: Any) -> Any:
    """Numbers less a factor times others."""
    return total - factor * numbers


if not numba.config.DISABLE_JIT:  # type: ignore[attr-defined]
    four, six, put = _loader(4), _loader(6), _compiled(_store)
    plus, minus = _combination("fadd"), _combination("fsub")

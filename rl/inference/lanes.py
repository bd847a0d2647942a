"""Sixteen float32 numbers side by side, as one value of a kernel: they stay in registers from loop to loop.

The compiler keeps the elements of an array in memory, where a sum over many terms is read and written again
at each of them. Lanes are added and multiplied each by itself, in the order that the kernel states, so the
bits are those of the same sums one by one. Without compilation (`NUMBA_DISABLE_JIT=1`) they are arrays.
"""

from __future__ import annotations

import operator
from typing import Any, cast

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import config
from numba.extending import intrinsic, models, overload, register_model

from rl.inference.arrays import Array32

LANES = 16
_VECTOR = ir.VectorType(ir.FloatType(), LANES)


class _LanesType(types.Type):
    """Numba's name for the value."""

    def __init__(self) -> None:
        super().__init__(name="Lanes16")


_LANES_TYPE = _LanesType()
register_model(_LanesType)(lambda manager, kind: models.PrimitiveModel(manager, kind, _VECTOR))


def _place(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """Pointer to an element of a contiguous array; the index counts from its start and is not checked."""
    array = context.make_array(signature.args[0])(context, builder, arguments[0])
    return builder.gep(array.data, [arguments[1]])


def _spread(builder: Any, number: Any) -> Any:
    """A number on every lane."""
    alone = builder.insert_element(ir.Constant(_VECTOR, ir.Undefined), number, ir.IntType(32)(0))
    every = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(alone, ir.Constant(_VECTOR, ir.Undefined), every)


@intrinsic
def _load(typing_context, array, index):
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        place = _place(context, builder, signature, arguments)
        return builder.load(builder.bitcast(place, _VECTOR.as_pointer()), align=4)

    return _LANES_TYPE(array, types.intp), generate


@intrinsic
def _load_spread(typing_context, array, index):
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return _spread(builder, builder.load(_place(context, builder, signature, arguments), align=4))

    return _LANES_TYPE(array, types.intp), generate


@intrinsic
def _store_positive(typing_context, lanes, array, index):
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        lanes, *where = arguments
        place = _place(context, builder, signature.return_type(*signature.args[1:]), where)
        zero = ir.Constant(_VECTOR, [0.0] * LANES)
        rectified = builder.select(builder.fcmp_ordered(">", lanes, zero), lanes, zero)
        builder.store(rectified, builder.bitcast(place, _VECTOR.as_pointer()), align=4)
        return context.get_dummy_value()

    return types.void(lanes, array, types.intp), generate


def _generate_sum(typing_context: Any, first: Any, second: Any) -> Any:
    return first(first, second), lambda context, builder, signature, pair: builder.fadd(*pair)


def _generate_product(typing_context: Any, first: Any, second: Any) -> Any:
    return first(first, second), lambda context, builder, signature, pair: builder.fmul(*pair)


_add: Any = intrinsic(_generate_sum)
_multiply: Any = intrinsic(_generate_product)


@overload(operator.add)
def _overload_add(first: Any, second: Any) -> Any:
    def add(first: Any, second: Any) -> Any:
        return _add(first, second)

    return add if first is _LANES_TYPE and second is _LANES_TYPE else None


@overload(operator.mul)
def _overload_multiply(first: Any, second: Any) -> Any:
    def multiply(first: Any, second: Any) -> Any:
        return _multiply(first, second)

    return multiply if first is _LANES_TYPE and second is _LANES_TYPE else None


def _load_plainly(array: Array32, index: int) -> Array32:
    return array[index : index + LANES].copy()


def _spread_plainly(array: Array32, index: int) -> Array32:
    return np.full(LANES, array[index])


def _store_plainly(lanes: Array32, array: Array32, index: int) -> None:
    array[index : index + LANES] = np.maximum(lanes, np.float32(0.0))


_compiled = not cast("Any", config).DISABLE_JIT  # numba names its settings at run time

load_lanes: Any = _load if _compiled else _load_plainly
"""Sixteen elements of a flat array, from an index on: neither end is checked."""
spread_element: Any = _load_spread if _compiled else _spread_plainly
"""An element of a flat array on every lane."""
store_positive: Any = _store_positive if _compiled else _store_plainly
"""Write the lanes, negative ones as zero, to a flat array from an index on."""

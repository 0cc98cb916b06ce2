"""Vectors of eight double-precision numbers, for the innermost loops of kernels.

The compiler maps them to the vector registers of the processor (one of 512 bits, two of 256, four of 128). By itself it does
not vectorise a short loop of a length known only at run time. Each lane does its own IEEE arithmetic; nothing is reordered, so
that the results are those of a scalar loop.

Arrays are C-contiguous and indexed flat. ``load`` and ``store`` access all of ``[index, index + WIDTH)`` without a check.
"""

import operator
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import types
from numba.core.datamodel import models
from numba.extending import intrinsic, overload, register_model

from vibrolock.width import WIDTH

_VECTOR = ir.VectorType(ir.DoubleType(), WIDTH)
_UNDEFINED = ir.Constant(_VECTOR, ir.Undefined)
_INDEX = ir.IntType(32)
_ALIGNMENT = 8  # of a double: arrays need not be aligned further


class Lanes(types.Type):
    """Type of the eight numbers inside a kernel."""


_lanes = Lanes(name="Lanes")


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, of: Any) -> None:
        base: Any = super()
        base.__init__(manager, of, _VECTOR)


def _pointer(context: Any, builder: Any, array_type: Any, array: Any, index: Any) -> Any:
    data = context.make_array(array_type)(context, builder, array).data
    return builder.bitcast(builder.gep(data, [index]), _VECTOR.as_pointer())


def _load(typing: Any, array: Any, index: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        loaded = builder.load(_pointer(context, builder, signature.args[0], *arguments))
        loaded.align = _ALIGNMENT
        return loaded

    return _lanes(array, types.intp), generate


def _store(typing: Any, array: Any, index: Any, lanes: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        target = _pointer(context, builder, signature.args[0], arguments[0], arguments[1])
        builder.store(arguments[2], target).align = _ALIGNMENT
        return context.get_dummy_value()

    return types.none(array, types.intp, _lanes), generate


def _spread(typing: Any, value: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        first = builder.insert_element(_UNDEFINED, arguments[0], ir.Constant(_INDEX, 0))
        return builder.shuffle_vector(first, _UNDEFINED, ir.Constant(ir.VectorType(_INDEX, WIDTH), [0] * WIDTH))

    return _lanes(types.float64), generate


def _lane_by_lane(build: Callable[[Any, Any, Any], Any]) -> Any:
    def typed(typing: Any, a: Any, b: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return build(builder, *arguments)

        return _lanes(_lanes, _lanes), generate

    return intrinsic(typed)


def _differ(typing: Any, a: Any, b: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        unequal = builder.fcmp_unordered("!=", *arguments)
        mask = ir.IntType(WIDTH)
        return builder.icmp_unsigned("!=", builder.bitcast(unequal, mask), ir.Constant(mask, 0))

    return types.boolean(_lanes, _lanes), generate


differ: Any = intrinsic(_differ)
"""``differ(a, b)``: whether any lane differs, or is not a number."""
load: Any = intrinsic(_load)
"""``load(array, index)``: return the eight numbers from a flat index on."""
store: Any = intrinsic(_store)
"""``store(array, index, lanes)``: write eight numbers from a flat index on."""
spread: Any = intrinsic(_spread)
"""``spread(value)``: return one number on all lanes."""
least: Any = _lane_by_lane(lambda builder, a, b: builder.select(builder.fcmp_ordered("<", a, b), a, b))
"""``least(a, b)``: the smaller one, lane by lane; b where one is not a number."""
greatest: Any = _lane_by_lane(lambda builder, a, b: builder.select(builder.fcmp_ordered(">", a, b), a, b))
"""``greatest(a, b)``: the larger one, lane by lane; b where one is not a number."""


def _fused(typing: Any, a: Any, b: Any, c: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        prototype = ir.FunctionType(_VECTOR, [_VECTOR] * 3)
        name = f"llvm.fmuladd.v{WIDTH}f64"
        function = builder.module.globals.get(name) or ir.Function(builder.module, prototype, name)
        return builder.call(function, arguments)

    return _lanes(_lanes, _lanes, _lanes), generate


multiply_add: Any = intrinsic(_fused)
"""``multiply_add(a, b, c)``: a b + c, rounded once where the processor has an instruction for it, else twice."""


def _operator(symbol: Any, build: Callable[[Any, Any, Any], Any]) -> None:
    """Define an operator between two vectors of lanes."""
    compute = _lane_by_lane(build)

    def typed(a: Any, b: Any) -> Any:
        if not (isinstance(a, Lanes) and isinstance(b, Lanes)):
            return None

        def of_lanes(a: Any, b: Any) -> Any:
            return compute(a, b)

        return of_lanes

    overload(symbol, inline="always")(typed)


_operator(operator.add, lambda builder, a, b: builder.fadd(a, b))
_operator(operator.sub, lambda builder, a, b: builder.fsub(a, b))
_operator(operator.mul, lambda builder, a, b: builder.fmul(a, b))

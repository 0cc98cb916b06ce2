"""Arrays from addresses, inside kernels that count no references."""

from typing import Any

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

_types: Any = types


def _array_at(typing: Any, address: Any, shape: Any, dtype: Any) -> Any:
    array = _types.Array(dtype.dtype, shape.count if isinstance(shape, _types.BaseTuple) else 1, "C")

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        from numba.np.arrayobj import np_cfarray  # only compiling needs it

        make: Any = np_cfarray
        place = arguments[0]
        if isinstance(address, _types.Integer):
            place = builder.inttoptr(place, ir.IntType(8).as_pointer())
        return make(context, builder, array(_types.voidptr, shape), (place, arguments[1]))

    return array(address, shape, dtype), generate


array_at: Any = intrinsic(_array_at)
"""``array_at(address, shape, dtype)``: the C-contiguous array at an address or a pointer, valid as long as its owner lives."""

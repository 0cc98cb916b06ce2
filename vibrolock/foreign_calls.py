"""For kernels that the code of others calls, in a thread of its own and without Python: pointers, and a fence.

Importing this module loads numba.
"""

import ctypes
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from vibrolock.content_cache import c_function

POINTER, DOUBLE, INT = types.voidptr, types.float64, types.int32
UNSIGNED_LONG = types.uint64 if ctypes.sizeof(ctypes.c_ulong) == 8 else types.uint32
"""Types of C on this system."""


def _fence(_: Any) -> Any:
    """Let no write before this be seen after a write behind it, on any processor."""

    def generate(_context: Any, builder: Any, _signature: Any, _arguments: Any) -> Any:
        builder.fence("seq_cst")
        return ir.Constant(ir.IntType(64), 0)

    return types.int64(), generate


def _pointer(_: Any, address: Any) -> Any:
    """Return the pointer of an address, an integer."""

    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.inttoptr(arguments[0], ir.IntType(8).as_pointer())

    return types.voidptr(address), generate


fence: Any = intrinsic(_fence)
pointer: Any = intrinsic(_pointer)


def compiled_for_c(function: Callable[..., Any], result: Any, *arguments: Any) -> Any:
    """Return a function compiled for C, or its stored machine code; its ``address`` is valid as long as it lives."""
    return c_function(result(*arguments), error_model="numpy")(function)

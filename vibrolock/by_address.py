"""Calls of C functions by their address from compiled kernels: no function is an argument, so that nothing is compiled anew."""

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from vibrolock.compiled import kernel

__all__ = ["call_at", "call_each"]


def _call_at(typing: Any, address: Any, s: Any) -> Any:
    """Call a function ``double (*)(double)`` at an address, without Python."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        prototype = ir.FunctionType(ir.DoubleType(), [ir.DoubleType()])
        function = builder.inttoptr(arguments[0], prototype.as_pointer())
        return builder.call(function, [arguments[1]])

    return types.float64(types.int64, types.float64), generate


call_at: Any = intrinsic(_call_at)


@kernel
def call_each(address: int, s: np.ndarray, out: np.ndarray) -> None:
    """Write the function at ``address`` of each number of ``s`` (float[n]) to ``out``."""
    for k in range(s.size):
        out[k] = call_at(address, s[k])

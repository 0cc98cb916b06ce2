"""Calls of C functions by their address from compiled kernels: no function is an argument, so that nothing is compiled anew."""

from typing import Any

import numpy as np

from vibrolock.compiled import kernel


def _call_at(typing: Any, address: Any, s: Any) -> Any:
    """Call a function ``double (*)(double)`` at an address, without Python."""
    from llvmlite import ir
    from numba import types

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        prototype = ir.FunctionType(ir.DoubleType(), [ir.DoubleType()])
        function = builder.inttoptr(arguments[0], prototype.as_pointer())
        return builder.call(function, [arguments[1]])

    return types.float64(types.int64, types.float64), generate


class _OnUse:
    """An intrinsic that is made when numba asks for its type, as kernels are: declaring it loads no compiler."""

    def __init__(self, definition: Any) -> None:
        self._defn = definition
        self._made: Any = None

    @property
    def _numba_type_(self) -> Any:
        from numba.core.registry import cpu_target
        from numba.extending import intrinsic

        if self._made is None:
            self._made = intrinsic(self._defn)
            cpu_target.typing_context.refresh()
        return cpu_target.typing_context.resolve_value_type(self._made)


call_at: Any = _OnUse(_call_at)


@kernel
def call_each(address: int, s: np.ndarray, out: np.ndarray) -> None:
    """Write the function at ``address`` of each number of ``s`` (float[n]) to ``out``."""
    for k in range(s.size):
        out[k] = call_at(address, s[k])

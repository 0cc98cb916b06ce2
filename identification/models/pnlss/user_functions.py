"""Functions of the user in features: found by name, compiled, called by their address (decision 0087)."""

import ctypes
import importlib
import sys
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from identification.errors import IdentificationError
from vibrolock.arrays import Float
from vibrolock.by_address import call_each

_PROTOTYPE = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double)
_POINTER: Any = _PROTOTYPE.__base__ or object  # base class of every C function object
_FORM = "allowed is 'module:name', or 'module:name:slope' with the name of the derivative in the same module"


class UserFunction(NamedTuple):
    """A function g of the user, in memory; its addresses are valid in this process only."""

    address: int
    slope_address: int
    """Of the derivative; 0 if it is taken by finite differences."""
    held: tuple[Any, ...]
    """The function objects, whose machine code must not be freed."""

    def of(self, s: Float) -> Float:
        """Return g of an array."""
        given = np.array(s, dtype=np.float64).ravel()
        out = np.empty(given.size)
        call_each(self.address, given, out)
        return out.reshape(np.shape(s))


def is_users(name: str) -> bool:
    """Return whether a name is that of a user's function; whether it exists is found out where it is needed."""
    parts = name.split(":")
    return len(parts) in (2, 3) and all(part.replace(".", "_").isidentifier() for part in parts)


@lru_cache(maxsize=64)
def user_function(name: str) -> UserFunction:
    """Import and compile a function; raise `IdentificationError` if it is missing, or not one of a number to a number."""
    module, first, *more = name.split(":")
    found = [_compiled(name, _imported(name, module, attribute)) for attribute in (first, *more)]
    address, slope = found[0][0], found[1][0] if more else 0
    function = UserFunction(address, slope, tuple(held for _, held in found))
    _check(name, function)
    return function


def _imported(name: str, module: str, attribute: str) -> Any:
    if (here := str(Path.cwd())) not in sys.path:
        sys.path.append(here)  # an installed command does not look there by itself
    try:
        return getattr(importlib.import_module(module), attribute)
    except Exception as error:  # whatever the user's module raises
        raise IdentificationError(f"function '{name}': cannot be imported ({error}); {_FORM}") from None


def _compiled(name: str, found: Any) -> tuple[int, Any]:
    """Return the address of a C function ``double (double)``: the object itself, or compiled from a Python or numba one."""
    pointer = getattr(found, "ctypes", found)  # of a numba cfunc
    if not isinstance(pointer, _POINTER):
        import numba  # only on use: it takes long to load

        try:
            found = numba.cfunc("float64(float64)")(getattr(found, "py_func", found))
        except Exception as error:  # numba has many, and long ones
            first = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
            raise IdentificationError(
                f"function '{name}': cannot be compiled as a function of one number ({first})"
            ) from None
        pointer = found.ctypes
    if pointer.restype is not ctypes.c_double or tuple(pointer.argtypes or ()) != (ctypes.c_double,):
        raise IdentificationError(f"function '{name}': has another signature, allowed is float64(float64)")
    return int(ctypes.cast(pointer, ctypes.c_void_p).value or 0), found


def _check(name: str, function: UserFunction) -> None:
    """Refuse functions that are not finite near rest, and derivatives that are not theirs."""
    at = np.array([-1.3, -0.4, 0.0, 0.7, 1.9])
    values, step = function.of(at), 1e-6
    if not np.all(np.isfinite(values)):
        raise IdentificationError(f"function '{name}': is {values} at {at}, must be finite")
    if function.slope_address:
        given = function._replace(address=function.slope_address).of(at)
        expected = (function.of(at + step) - function.of(at - step)) / (2.0 * step)
        wrong = np.abs(given - expected) > 1e-4 * (1.0 + np.max(np.abs(expected)))
        if np.any(wrong):
            index = int(np.argmax(wrong))
            raise IdentificationError(
                f"function '{name}': its derivative is {given[index]:.6g} at {at[index]:g}, the function itself changes by "
                f"{expected[index]:.6g}"
            )

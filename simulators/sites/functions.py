"""Compiled functions of the user, given by name or as objects: lookup, check and storage."""

import ctypes
import importlib
import logging
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vibrolock.errors import InputError

_ARGUMENTS = (ctypes.c_double, ctypes.POINTER(ctypes.c_double))
_PROTOTYPE = ctypes.CFUNCTYPE(ctypes.c_double, *_ARGUMENTS)
_FUNCTION_POINTER: Any = _PROTOTYPE.__base__ or object  # base class of every C function object
_ALLOWED = "allowed is a numba cfunc or C function float64(float64, CPointer(float64))"

_LOG = logging.getLogger(__name__)

_kept: dict[int, Any] = {}
"""Function objects whose addresses are in use: their machine code must not be freed while a rig may call it."""


@dataclass(frozen=True)
class Loaded:
    """A function in memory; its address is valid in this process only."""

    address: int

    def __call__(self, z: float, parameters: tuple[float, ...]) -> float:
        """Return the force for one deflection or velocity."""
        return float(_PROTOTYPE(self.address)(z, (ctypes.c_double * len(parameters))(*parameters)))


def named(function: Any) -> str:
    """Return ``module:name`` of a function object; return a name unchanged."""
    if isinstance(function, str):
        return function
    made_from = getattr(function, "__wrapped__", function)
    name = getattr(made_from, "__qualname__", None) or getattr(made_from, "__name__", None) or repr(made_from)
    return f"{getattr(made_from, '__module__', None) or type(made_from).__module__}:{name}"


def portable(function: Any) -> Any:
    """Return the name of a function object if other processes can import it by this name; otherwise return it unchanged."""
    if isinstance(function, str):
        return function
    name = named(function)
    module, _, attribute = name.partition(":")
    found = getattr(sys.modules.get(module), attribute, None)
    return name if found is function and module != "__main__" else function


def loaded(function: Any) -> Loaded:
    """Return the function of a name or an object; raise `ValueError` if it is missing or has another signature."""
    what = f"function = {named(function)!r}"
    found = _imported(function) if isinstance(function, str) else function
    pointer: Any = getattr(found, "ctypes", found)  # of a numba cfunc
    if not isinstance(pointer, _FUNCTION_POINTER):
        raise InputError(f"is a {type(found).__name__}, {_ALLOWED}", field=what)
    if pointer.restype is not ctypes.c_double or tuple(pointer.argtypes or ()) != _ARGUMENTS:
        shown = ", ".join(one.__name__ for one in pointer.argtypes or ())
        raise InputError(f"is {getattr(pointer.restype, '__name__', None)}({shown}), {_ALLOWED}", field=what)
    address = int(ctypes.cast(pointer, ctypes.c_void_p).value or 0)
    _kept[address] = found
    return Loaded(address)


def _imported(name: str) -> Any:
    module, colon, attribute = name.partition(":")
    InputError.raise_if(not (colon and module and attribute), field="function", value=name, allowed="'module:name'")
    if (here := str(Path.cwd())) not in sys.path:
        sys.path.append(here)  # an installed command does not look there by itself
    known = module in sys.modules
    try:
        imported = importlib.import_module(module)
        function = getattr(imported, attribute)
    except (Exception, SystemExit) as error:  # the user's module may fail in any way, and may end itself
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise InputError(reason, field="function", value=name, allowed="a function that can be imported") from None
    if not known:
        _LOG.info("function %s imported from %s", name, _shown(getattr(imported, "__file__", None)))
    return function


def _shown(file: str | None) -> str:
    """Return the file of a module, relative to the working directory if it lies inside."""
    if file is None:
        return "no file"
    path, here = Path(file).absolute(), Path.cwd()
    return f"./{path.relative_to(here).as_posix()}" if path.is_relative_to(here) else str(path)

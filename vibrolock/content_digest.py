"""A digest of everything that determines the machine code of a kernel."""

import enum
import hashlib
import re
import types
from collections.abc import Iterator
from typing import Any

import numpy as np

_ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")


def content_digest(kernel: Any) -> str:
    """Return a digest of everything that determines a kernel's machine code, as hexadecimal text.

    It covers code and options of the kernel and of all kernels that it calls, and the constants that they name. The types of
    the arguments, the processor and numba's version are further keys of the cache. Comments and docstrings do not count.
    Module-level names are looked up when the digest is made, so that a kernel may call one that is defined below it.
    """
    known: str | None = getattr(kernel, "_content_digest", None)
    if known is None:
        digest = hashlib.sha256(b"3")  # under earlier ones code may lack the entry for Python, or text be machine code
        for part in _content(kernel, set()):
            digest.update(part.encode())
            digest.update(b"\0")
        known = kernel._content_digest = digest.hexdigest()
    return known


def _content(value: Any, seen: set[int]) -> Iterator[str]:
    """Yield texts for a value that a kernel names; they differ if the machine code may differ."""
    inner = getattr(value, "py_func", None) or getattr(value, "_defn", None)  # of a kernel; of a numba intrinsic
    if isinstance(value, types.FunctionType):
        inner = value
    if inner is not None:
        yield f"{inner.__module__}.{inner.__qualname__} {sorted(getattr(value, 'targetoptions', {}).items())}"
        if id(inner) in seen:
            return
        seen.add(id(inner))
        cells = [cell.cell_contents for cell in inner.__closure__ or ()]
        for part in (*cells, *(inner.__defaults__ or ())):
            yield from _content(part, seen)
        yield from _code(inner.__code__, inner.__globals__, seen, inner.__doc__)
    elif isinstance(value, np.ndarray):
        yield f"{value.dtype!r} {value.shape} {hashlib.sha256(value.tobytes()).hexdigest()}"
    elif isinstance(value, types.ModuleType):
        yield value.__name__
    elif isinstance(value, type) and issubclass(value, enum.Enum):
        yield f"{value.__qualname__} {[(one.name, one.value) for one in value]}"
    elif isinstance(value, type | types.BuiltinFunctionType):
        yield f"{value.__module__}.{value.__qualname__} {getattr(value, '_fields', '')}"
    else:
        yield _ADDRESS.sub("", f"{type(value).__qualname__} {value!r}")  # addresses differ between processes


def _code(code: types.CodeType, names: dict[str, Any], seen: set[int], doc: str | None) -> Iterator[str]:
    yield code.co_code.hex()
    yield f"{code.co_names} {code.co_varnames} {code.co_freevars}"
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _code(constant, names, seen, None)
        elif constant != doc or doc is None:
            yield repr(constant)
    for name in code.co_names:
        if name in names:
            yield name
            yield from _content(names[name], seen)

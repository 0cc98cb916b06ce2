"""Decorators for the compiled kernels of the distribution, and a cache of machine code by content.

A kernel is a module-level function. It takes and returns plain arrays, structured arrays and scalars, allocates nothing per
sample and never raises. It returns codes; its caller raises.

numba's own cache identifies a kernel by its file. It does not notice changes in other files, of a called kernel or of a
constant that is compiled in. Here machine code is found by a digest of everything that determines it (`content_digest`).

numba itself is loaded when a kernel is first called, so that a module may declare kernels at no cost to those who call none.
"""

import contextlib
import enum
import functools
import glob
import hashlib
import os
import re
import tempfile
import threading
import time
import types
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, ParamSpec, TypeAlias, TypeVar, cast

import numpy as np

P = ParamSpec("P")
R = TypeVar("R")

Record: TypeAlias = Any
"""One record of a structured array inside a kernel; numba knows the fields, the type checker does not."""

OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": False, "_nrt": False}
"""Options of numba: IEEE arithmetic only, so that runs repeat bit for bit. Kernels allocate nothing, so that arrays inside them
need no reference counts, which would cost a third of the time of a sample."""

_ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")
_UNUSED_AFTER_DAYS = 30
_DAY_S = 86400.0
_INDEX = re.compile(r".+-[0-9a-f]{24}\.py\d+\w*\.nbi")  # numba's name, with the kernel's digest


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a kernel with numba, cached on disk."""
    return _compiled(function, OPTIONS)


def unlocked_kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a kernel that lets other threads of Python run while it does."""
    return _compiled(function, {**OPTIONS, "nogil": True})


def inner_kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a kernel that is inlined into each kernel that calls it.

    Use it for kernels that run every sample and take bundles of arrays: passing a rig and its state costs as much time as the
    sensors.
    """
    return _compiled(function, {**OPTIONS, "forceinline": True})


def bound(kernel: Callable[P, R], *examples: P.args, **named: P.kwargs) -> Callable[P, R]:
    """Return a kernel's machine code for arguments of the types of ``examples``, loaded or compiled here; it is not run.

    A kernel finds out the types of its arguments at every call, which for bundles of arrays takes several microseconds, more
    than a sample. What is returned takes them as they come: call it by position with the same types only, down to the memory
    layout of arrays.
    """
    made = cast("_Kernel", kernel)._made()
    if made is cast("_Kernel", kernel).py_func:  # numba is told not to compile
        return kernel
    return cast("Callable[P, R]", made.compile(tuple(map(made.typeof_pyval, examples))))


def _compiled(function: Callable[P, R], options: dict[str, Any]) -> Callable[P, R]:
    return cast("Callable[P, R]", _Kernel(function, options))


class _Kernel:
    """A kernel as declared. What numba makes of it is made when it is first asked for.

    It is called like a function and named in other kernels; numba asks an object that it does not know for its type. For the
    second it is compiled without what only calls from Python need, which for bundles of arrays is most of a kernel.
    """

    _making = threading.RLock()

    def __init__(self, function: Callable[..., Any], options: dict[str, Any]) -> None:
        self.py_func = function
        self._options = options
        self._dispatcher: Any = None
        self._inner: Any = None
        functools.update_wrapper(self, function)

    def __call__(self, *arguments: Any, **named: Any) -> Any:
        return (self._dispatcher or self._made())(*arguments, **named)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self._made(), name)

    def __reduce__(self) -> str:
        return str(self.py_func.__qualname__)

    @property
    def _numba_type_(self) -> Any:
        from vibrolock.content_cache import inner_dispatcher

        with self._making:
            if self._inner is None:
                self._inner = inner_dispatcher(self.py_func, self._options)
            return self._inner._numba_type_

    def _made(self) -> Any:
        from vibrolock.content_cache import dispatcher

        with self._making:
            if self._dispatcher is None:
                self._dispatcher = dispatcher(self.py_func, self._options)
            return self._dispatcher


def content_digest(kernel: Any) -> str:
    """Return a digest of everything that determines a kernel's machine code, as hexadecimal text.

    It covers code and options of the kernel and of all kernels that it calls, and the constants that they name. The types of
    the arguments, the processor and numba's version are further keys of the cache. Comments and docstrings do not count.
    Module-level names are looked up when the digest is made, so that a kernel may call one that is defined below it.
    """
    known: str | None = getattr(kernel, "_content_digest", None)
    if known is None:
        digest = hashlib.sha256(b"2")  # machine code of digests without it may lack the entry for Python
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


_folder: Path | None = None


def kernel_cache_folder() -> Path:
    """Return the folder with the machine code of all kernels; create it if necessary.

    It lies below ``NUMBA_CACHE_DIR``, ``XDG_CACHE_HOME`` or ``~/.cache``, the first that can be written. Otherwise it is a
    temporary folder of this process alone, because machine code is loaded from it and no other user may place code there.
    """
    global _folder
    if _folder is None:
        _folder = _first_writable() or Path(tempfile.mkdtemp(prefix="vibrolock-"))
    return _folder


def _first_writable() -> Path | None:
    for parent in _possible_parents():
        folder = parent / "kernels"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            os.utime(folder)
        except OSError:
            continue
        _remove_unused(folder)
        return folder
    return None


def _possible_parents() -> Iterator[Path]:
    for variable in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        if os.environ.get(variable):
            yield Path(os.environ[variable]) / "vibrolock"
    with contextlib.suppress(RuntimeError):  # a user without a home
        yield Path.home() / ".cache" / "vibrolock"


def note_use(index: Path) -> None:
    """Note that the machine code of an index was used, so that it is kept for another month."""
    with contextlib.suppress(OSError):
        if index.stat().st_mtime < time.time() - _DAY_S:
            os.utime(index)


def _remove_unused(folder: Path) -> None:
    """Remove machine code that was not used for a month. The folder may be one with files of the user's beside it."""
    oldest = time.time() - _UNUSED_AFTER_DAYS * _DAY_S
    with contextlib.suppress(OSError):
        for index in folder.glob("*.nbi"):
            if _INDEX.fullmatch(index.name) and index.stat().st_mtime < oldest:
                for file in folder.glob(f"{glob.escape(index.stem)}.*"):
                    if file.suffix in (".nbi", ".nbc", ".lock"):
                        file.unlink(missing_ok=True)

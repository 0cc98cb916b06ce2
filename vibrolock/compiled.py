"""Decorators for the compiled kernels of the distribution, and a cache of machine code by content.

A kernel is a module-level function. It takes and returns plain arrays, structured arrays and scalars, allocates nothing per
sample and never raises. It returns codes; its caller raises.

numba's own cache identifies a kernel by its file. It does not notice changes in other files, of a called kernel or of a
constant that is compiled in. Here machine code is found by a digest of everything that determines it (`content_digest`).
"""

import contextlib
import enum
import hashlib
import os
import platform
import re
import shutil
import tempfile
import time
import types
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, ParamSpec, TypeAlias, TypeVar

import llvmlite.binding
import numba
import numpy as np
from numba.core.caching import CompileResultCacheImpl, FunctionCache

__all__ = ["Record", "content_digest", "inner_kernel", "kernel", "kernel_cache_folder"]

P = ParamSpec("P")
R = TypeVar("R")

Record: TypeAlias = Any
"""One record of a structured array inside a kernel; numba knows the fields, the type checker does not."""

OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": False, "_nrt": False}
"""Options of numba: IEEE arithmetic only, so that runs repeat bit for bit. Kernels allocate nothing, so that arrays inside them
need no reference counts, which would cost a third of the time of a sample."""

LEVEL_3 = ("avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe")
"""What x86-64-v3 adds to a processor."""

_ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")
_UNUSED_AFTER_DAYS = 30
_DAY_S = 86400.0


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a kernel with numba, cached on disk."""
    return _compiled(function, OPTIONS)


def inner_kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a kernel that is inlined into each kernel that calls it.

    Use it for kernels that run every sample and take bundles of arrays: passing a rig and its state costs as much time as the
    sensors.
    """
    return _compiled(function, {**OPTIONS, "forceinline": True})


def _compiled(function: Callable[P, R], options: dict[str, Any]) -> Callable[P, R]:
    dispatcher: Any = numba.njit(**options)(function)
    if numba.config.DISABLE_JIT:  # type: ignore[attr-defined]  # made at run time
        return function
    dispatcher._cache = _ContentCache(dispatcher)
    compiled: Callable[P, R] = dispatcher
    return compiled


def content_digest(kernel: Any) -> str:
    """Return a digest of everything that determines a kernel's machine code, as hexadecimal text.

    It covers code and options of the kernel and of all kernels that it calls, and the constants that they name. The types of
    the arguments, the processor and numba's version are further keys of the cache. Comments and docstrings do not count.
    Module-level names are looked up when the digest is made, so that a kernel may call one that is defined below it.
    """
    known: str | None = getattr(kernel, "_content_digest", None)
    if known is None:
        digest = hashlib.sha256()
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


class _ContentLocator:
    """Tells numba where a kernel's machine code is: in one folder, under the kernel's name and digest."""

    def __init__(self, digest: str) -> None:
        self._digest = digest
        self._py_file = ""  # numba names it in a warning

    @classmethod
    def from_function(cls, function: Any, _: str) -> "_ContentLocator":
        return cls(function._content_digest)

    def ensure_cache_path(self) -> None:
        Path(self.get_cache_path()).mkdir(parents=True, exist_ok=True)

    def get_cache_path(self) -> str:
        return str(kernel_cache_folder())

    def get_source_stamp(self) -> str:
        return self._digest

    def get_disambiguator(self) -> str:
        return self._digest[:24]


class _ContentImpl(CompileResultCacheImpl):
    _locator_classes: list[type[object]] = [_ContentLocator]  # noqa: RUF012


class _ContentCache(FunctionCache):
    """numba's cache of one kernel, opened at the kernel's first call, when all names that it uses are defined."""

    _impl_class = _ContentImpl

    def __init__(self, dispatcher: Any) -> None:
        self._dispatcher: Any = dispatcher
        self._opened = False

    def _open(self) -> None:
        if self._opened:
            return
        self._opened = True
        function = self._dispatcher.py_func
        function._content_digest = content_digest(self._dispatcher)
        super().__init__(function)  # type: ignore[no-untyped-call]
        _note_use(Path(self._cache_file._index_path))

    @property
    def cache_path(self) -> str:
        self._open()
        return str(super().cache_path)

    def flush(self) -> None:
        self._open()
        super().flush()  # type: ignore[no-untyped-call]

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        self._open()
        try:
            return super().load_overload(signature, target_context)  # type: ignore[no-untyped-call]
        except (ImportError, AttributeError):  # the index names a type of argument by a module that it has left since
            self.flush()
            return None


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
        _remove_unused(parent)
        return folder
    return None


def _possible_parents() -> Iterator[Path]:
    for variable in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        if os.environ.get(variable):
            yield Path(os.environ[variable]) / "vibrolock"
    with contextlib.suppress(RuntimeError):  # a user without a home
        yield Path.home() / ".cache" / "vibrolock"


def _note_use(index: Path) -> None:
    with contextlib.suppress(OSError):
        if index.stat().st_mtime < time.time() - _DAY_S:
            os.utime(index)


def _remove_unused(parent: Path) -> None:
    """Remove machine code that was not used for a month, and the cache folders of earlier versions."""
    oldest = time.time() - _UNUSED_AFTER_DAYS * _DAY_S
    with contextlib.suppress(OSError):
        for folder in parent.iterdir():
            if folder.is_dir() and folder.name != "kernels" and folder.stat().st_mtime < oldest:
                shutil.rmtree(folder, ignore_errors=True)
        for index in (parent / "kernels").glob("*.nbi"):
            if index.stat().st_mtime < oldest:
                for file in index.parent.glob(f"{index.stem}.*"):
                    file.unlink(missing_ok=True)


def _choose_processor() -> None:
    """Compile for any x86-64 processor with AVX2 (level v3 of the psABI) where this is one, whatever its make.

    The code is the same on all of them, to the bit, and quicker than what LLVM makes for the very processor: see decision 0063.
    ``NUMBA_CPU_NAME`` overrides it.
    """
    if os.environ.get("NUMBA_CPU_NAME") or os.environ.get("NUMBA_CPU_FEATURES"):
        return
    features = llvmlite.binding.get_host_cpu_features()
    if platform.machine().lower() in ("x86_64", "amd64") and all(features.get(name, False) for name in LEVEL_3):
        setattr(numba.config, "CPU_NAME", "x86-64-v3")  # noqa: B010 (made at run time, unknown to type checkers)
        setattr(numba.config, "CPU_FEATURES", "")  # noqa: B010


_choose_processor()
setattr(numba.config, "CACHE_DIR", str(kernel_cache_folder()))  # noqa: B010 (made at run time, unknown to type checkers)

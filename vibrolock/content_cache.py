"""What numba makes of a function, with machine code cached in one folder. Importing this module loads numba.

Kernels are declared with `vibrolock.compiled`, which comes here when one is first called.
"""

import os
import platform
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from types import FunctionType, SimpleNamespace
from typing import Any

import llvmlite.binding
import numba
from numba.core.caching import CompileResultCacheImpl, FunctionCache
from numba.core.ccallback import CFunc
from numba.core.registry import cpu_target
from numba.core.sigutils import normalize_signature

from vibrolock.compiling import on_compiling
from vibrolock.content_digest import content_digest
from vibrolock.kernel_cache import kernel_cache_folder, note_use
from vibrolock.kernel_compilers import InnerCompiler, KernelCompiler, restored

if sys.platform != "win32":
    import fcntl

PATIENCE_S = 300.0
"""How long a process waits for another that compiles the same kernel, before it does so itself. The largest take 30 s."""

LEVEL_3 = ("avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe")
"""What x86-64-v3 adds to a processor."""


def _choose_processor() -> None:
    """Compile for any x86-64 processor with AVX2 (level v3 of the psABI) where this is one, whatever its make.

    The code is the same on all of them, to the bit, and quicker than what LLVM makes for the very processor: see decision 0063.
    ``NUMBA_CPU_NAME`` overrides it. Where other code has let numba compile before, numba's generator was made for the very
    processor, and is made anew.
    """
    if os.environ.get("NUMBA_CPU_NAME") or os.environ.get("NUMBA_CPU_FEATURES"):
        return
    features = llvmlite.binding.get_host_cpu_features()
    if platform.machine().lower() in ("x86_64", "amd64") and all(features.get(name, False) for name in LEVEL_3):
        setattr(numba.config, "CPU_NAME", "x86-64-v3")  # noqa: B010 (made at run time, unknown to type checkers)
        setattr(numba.config, "CPU_FEATURES", "")  # noqa: B010
        context: Any = cpu_target.target_context
        if context.codegen().magic_tuple()[2]:
            context.init()


_choose_processor()
setattr(numba.config, "CACHE_DIR", str(kernel_cache_folder()))  # noqa: B010 (made at run time, unknown to type checkers)


def dispatcher(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    """Return numba's dispatcher of a kernel, cached on disk; return the function itself if numba is told not to compile."""
    made: Any = numba.njit(**{"pipeline_class": KernelCompiler, "no_cfunc_wrapper": True, **options})(function)
    if not numba.config.DISABLE_JIT:  # type: ignore[attr-defined]  # made at run time
        made._cache = _ContentCache(made)
    return made


def inner_dispatcher(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    """Return a dispatcher for calls from other kernels only.

    It has no entries for Python and C. A constant among the arguments is taken as a number like any other: numba would compile
    the kernel anew for each.
    """
    made = dispatcher(function, {**options, "no_cpython_wrapper": True, "pipeline_class": InnerCompiler})
    template: Any = made.get_call_template
    plain: Any = numba.types.unliteral

    def get_call_template(arguments: tuple[Any, ...], named: dict[str, Any]) -> Any:
        return template(tuple(map(plain, arguments)), {name: plain(value) for name, value in named.items()})

    made.get_call_template = get_call_template
    return made


def c_function(signature: Any, **options: Any) -> Callable[[Callable[..., Any]], Any]:
    """Return a decorator that compiles a C function of a signature at once, or loads its machine code like a kernel's.

    ``signature`` is numba's, or its text; ``options`` are numba's too. The function allocates nothing. ``numba.cfunc`` would
    first make all of numba's own implementations known, a third of a second, even where it only loads.
    """
    normalized: Any = normalize_signature
    options = {"_nrt": False, **options}  # it allocates nothing; what counts references is not loaded

    def decorate(function: Callable[..., Any]) -> Any:
        made: Any = CFunc(function, normalized(signature), locals={}, options=options)
        made._cache = _ContentCache(
            SimpleNamespace(py_func=function, targetoptions={**options, "cfunc": str(signature)})
        )
        made.compile()
        return made

    return decorate


def _named(dispatcher: Any) -> Any:
    """Return a copy of a kernel's function that holds the kernel's digest.

    On the function itself it would pass to every dispatcher that is made of it later: a kernel's dispatcher for calls from
    other kernels, which has no entry for Python, would be stored as the one that has.
    """
    function = dispatcher.py_func
    copy: Any = FunctionType(
        function.__code__, function.__globals__, function.__name__, function.__defaults__, function.__closure__
    )
    copy.__qualname__, copy.__module__ = function.__qualname__, function.__module__
    copy._content_digest = content_digest(dispatcher)
    return copy


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

    def rebuild(self, context: Any, stored: Any) -> Any:
        return restored(context, stored) or super().rebuild(context, stored)  # type: ignore[no-untyped-call]


class _ContentCache(FunctionCache):
    """numba's cache of one kernel, opened at the kernel's first call, when all names that it uses are defined."""

    _impl_class = _ContentImpl

    def __init__(self, dispatcher: Any) -> None:
        self._dispatcher: Any = dispatcher
        self._opened = False
        self._lock: int | None = None

    def _open(self) -> None:
        if self._opened:
            return
        self._opened = True
        super().__init__(_named(self._dispatcher))  # type: ignore[no-untyped-call]
        note_use(Path(self._cache_file._index_path))

    @property
    def cache_path(self) -> str:
        self._open()
        return str(super().cache_path)

    def flush(self) -> None:
        self._open()
        super().flush()  # type: ignore[no-untyped-call]

    def load_overload(self, signature: Any, target_context: Any) -> Any:
        """Load machine code; None where it is not there, which is then for this process to compile.

        Of several processes that miss a kernel one compiles it, and the others load what it has saved.
        """
        self._open()
        found = self._loaded(signature, target_context)
        if found is None:
            self._wait_for_others()
            found = self._loaded(signature, target_context)
        if found is None:
            for told in on_compiling:
                told(self._dispatcher.py_func.__name__)
        else:
            self._let_others()
        return found

    def save_overload(self, signature: Any, compiled: Any) -> None:
        """Save machine code for other processes."""
        super().save_overload(signature, compiled)  # type: ignore[no-untyped-call]
        self._let_others()

    def _loaded(self, signature: Any, target_context: Any) -> Any:
        """Load machine code, which needs none of numba's own implementations.

        numba would first make these known, which takes longer than the loading. The compiler does so before it compiles.
        """
        try:
            with self._guard_against_spurious_io_errors():
                return self._load_overload(signature, target_context)  # type: ignore[no-untyped-call]
        except (ImportError, AttributeError):  # the index names a type of argument by a module that it has left since
            self.flush()
        return None

    def _wait_for_others(self) -> None:
        """Wait until no other process compiles this kernel. From now on the others wait for this one.

        A kernel calls no kernel that calls it, so that processes never wait for each other in a circle.
        """
        if sys.platform == "win32" or self._lock is not None:
            return
        until_s = time.monotonic() + PATIENCE_S
        with suppress(OSError):  # a folder without locks
            self._lock = os.open(f"{self._cache_file._index_path}.lock", os.O_RDWR | os.O_CREAT, 0o600)
            while time.monotonic() < until_s:
                try:
                    fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                except BlockingIOError:
                    time.sleep(0.05)
                else:
                    break

    def _let_others(self) -> None:
        if self._lock is not None:
            if sys.platform != "win32":
                with suppress(OSError):
                    fcntl.flock(self._lock, fcntl.LOCK_UN)  # closing does not, where a forked child has the file too
            os.close(self._lock)
            self._lock = None

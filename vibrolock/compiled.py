"""Decorators for the compiled kernels of the distribution, whose machine code is found by their content.

A kernel is a module-level function. It takes and returns plain arrays, structured arrays and scalars, allocates nothing per
sample and never raises. It returns codes; its caller raises.

numba's own cache identifies a kernel by its file. It does not notice changes in other files, of a called kernel or of a
constant that is compiled in. Here machine code is found by a digest of all that determines it (`vibrolock.content_digest`).

numba itself is loaded when a kernel is first called, so that a module may declare kernels at no cost to those who call none.
"""

import functools
import threading
from collections.abc import Callable
from typing import Any, ParamSpec, TypeAlias, TypeVar, cast

P = ParamSpec("P")
R = TypeVar("R")

Record: TypeAlias = Any
"""One record of a structured array inside a kernel; numba knows the fields, the type checker does not."""

OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": False, "_nrt": False}
"""Options of numba: IEEE arithmetic only, so that runs repeat bit for bit. Kernels allocate nothing, so that arrays inside them
need no reference counts, which would cost a third of the time of a sample."""


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


def compiled_text(kernel: Callable[P, R], *examples: P.args, **named: P.kwargs) -> tuple[str, str]:
    """Return the LLVM text of a kernel for arguments of the types of ``examples``, with all that it calls, and its name there.

    There is none where numba is told not to compile.
    """
    made = cast("_Kernel", kernel)._made()
    types = tuple(map(made.typeof_pyval, examples))
    made.compile(types)
    result = made.overloads[types]
    return str(result.library._get_module_for_linking()), str(result.fndesc.llvm_func_name)


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

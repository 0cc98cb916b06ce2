"""Threads of a fit: as many as the linear algebra has, which meanwhile keeps to one."""

import ctypes
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

__all__ = ["available_threads", "threads"]


def _function(name: str) -> Any:
    """Return a function of the OpenBLAS of numpy, which has prefixes and suffixes of its own; None with another library."""
    try:
        library = ctypes.CDLL(np._core._multiarray_umath.__file__)  # type: ignore[attr-defined]
    except (AttributeError, OSError):
        return None
    names = (f"scipy_openblas_{name}64_", f"scipy_openblas_{name}", f"openblas_{name}64_", f"openblas_{name}")
    return next((getattr(library, one) for one in names if hasattr(library, one)), None)


_get, _set = _function("get_num_threads"), _function("set_num_threads")


def available_threads() -> int:
    """Return the number of threads of the linear algebra (``OMP_NUM_THREADS``, else one per core); 1 if it cannot be told."""
    return 1 if _get is None or _set is None else int(_get())


@contextmanager
def threads() -> Iterator[int]:
    """Yield the number of threads to use while the linear algebra keeps to one."""
    count = available_threads()
    if count == 1:
        yield 1
        return
    _set(1)
    try:
        yield count
    finally:
        _set(count)

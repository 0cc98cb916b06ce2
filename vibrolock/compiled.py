"""One decorator for every compiled kernel of the distribution.

A kernel is a module-level function in a file called ``kernels.py``: plain arrays, structured arrays and scalars in
and out, no allocation per sample, never raising. It returns codes; its caller raises.

numba's own cache does not notice when a kernel that is called from another file has changed. The cache folder therefore
carries a hash of all kernel sources and record layouts of the distribution, and a changed source starts an empty folder.
"""

import contextlib
import hashlib
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, ParamSpec, TypeAlias, TypeVar

import numba

__all__ = ["Record", "inner_kernel", "kernel", "kernel_cache_folder"]

P = ParamSpec("P")
R = TypeVar("R")

Record: TypeAlias = Any
"""One record of a structured array inside a kernel; numba knows its fields, the type checker does not."""

_PACKAGES = ("vibrolock", "controller", "simulators", "identification", "rig")
_COMPILED_FROM = (
    "kernels.py",
    "layout.py",
    "compiled.py",
)  # the code, constants and layouts in it, the compiler's options
_UNUSED_AFTER_DAYS = 30


def _source_hash() -> str:
    root = Path(__file__).parent.parent
    sources = sorted(path for name in _PACKAGES for file in _COMPILED_FROM for path in (root / name).rglob(file))
    digest = hashlib.sha256(f"numba {numba.__version__}".encode())
    for path in sources:
        digest.update(path.relative_to(root).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def kernel_cache_folder() -> Path:
    """Folder that holds the machine code of exactly these kernel sources; made if need be.

    Below ``NUMBA_CACHE_DIR``, ``XDG_CACHE_HOME`` or ``~/.cache``, the first that can be written; else a temporary folder of
    this process alone, for machine code is loaded from it and nobody else may have put it there.
    """
    for parent in _possible_parents():
        folder = parent / _source_hash()
        try:
            folder.mkdir(parents=True, exist_ok=True)
            os.utime(folder)
        except OSError:
            continue
        _remove_unused(parent)
        return folder
    return Path(tempfile.mkdtemp(prefix="vibrolock-"))


def _possible_parents() -> Iterator[Path]:
    for variable in ("NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        if os.environ.get(variable):
            yield Path(os.environ[variable]) / "vibrolock"
    with contextlib.suppress(RuntimeError):  # a user without a home
        yield Path.home() / ".cache" / "vibrolock"


def _remove_unused(parent: Path) -> None:
    oldest = time.time() - _UNUSED_AFTER_DAYS * 86400.0
    for folder in parent.iterdir():
        if folder.is_dir() and folder.stat().st_mtime < oldest:
            shutil.rmtree(folder, ignore_errors=True)


setattr(numba.config, "CACHE_DIR", str(kernel_cache_folder()))  # noqa: B010 (made at run time, unknown to type checkers)


OPTIONS: dict[str, Any] = {"cache": True, "error_model": "numpy", "fastmath": False, "_nrt": False}
"""IEEE arithmetic only, so that runs repeat bit for bit. Kernels allocate nothing, so arrays need no reference counts
inside them, which otherwise cost a third of the time of a sample."""


def kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a kernel with numba, cached on disk."""
    compiled: Callable[P, R] = numba.njit(**OPTIONS)(function)
    return compiled


def inner_kernel(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a kernel that becomes part of each kernel that calls it.

    For what runs every sample and takes bundles of arrays: handing over a rig and its state costs as much as the sensors do.
    """
    compiled: Callable[P, R] = numba.njit(forceinline=True, **OPTIONS)(function)
    return compiled

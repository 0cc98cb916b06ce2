"""The folder in which the machine code of kernels is kept, and what in it was not used for long."""

import contextlib
import glob
import os
import re
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

_UNUSED_AFTER_DAYS = 30
"""Days without use after which machine code is removed. Chosen: what a user comes back to within a month is still there."""
_DAY_S = 86400.0
"""Shortest time between two notes that machine code was used, s: a note writes to the disk."""
_INDEX = re.compile(r".+-[0-9a-f]{24}\.py\d+\w*\.nbi")
"""Name that numba gives to the index of a kernel, with the kernel's digest."""

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

"""Blocks appended to a file, each whole or not at all."""

import errno
import os
import shutil
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Self

from rig.recording.blocks import BlockKind, pack
from rig.system.locking import lock

SYNC_INTERVAL_S = 0.5
"""The disk is synchronised at most this often while blocks are appended."""

_WRITABLE = os.O_RDWR | os.O_APPEND | getattr(os, "O_BINARY", 0)
_fdatasync: Callable[[int], None] = getattr(os, "fdatasync", os.fsync)  # not on macOS and Windows


class NameLost(OSError):  # noqa: N818 (says what happened)
    """The file that is being written was removed or renamed by another program."""


class BlockFile:
    """The file of a journal, open for appending and locked against other writers.

    Every method may raise ``OSError``. After a failed or interrupted write the file is cut to where the block began. If that
    fails too, nothing more is written, because a block after half a block could not be read.
    """

    def __init__(self, descriptor: int, path: Path) -> None:
        self._descriptor, self._path = descriptor, path
        self._end = (0, 0)  # bytes and blocks as one value: a signal's exception never comes between the two
        self._unsound: OSError | None = None
        self._synced_s = time.monotonic()

    @classmethod
    def open(cls, path: Path, *, new: bool = False) -> Self:
        """Open the file at ``path``, made if it is ``new`` and missing.

        Raises:
            OSError: it cannot be opened.
            RecordingError: another process writes it.
        """
        descriptor = os.open(path, _WRITABLE | (os.O_CREAT if new else 0), 0o666)
        try:
            lock(descriptor, path)
        except BaseException:
            os.close(descriptor)
            raise
        return cls(descriptor, path)

    @property
    def size(self) -> int:
        """Length of the file, bytes."""
        return os.fstat(self._descriptor).st_size

    def cut(self, n_bytes: int, n_blocks: int) -> None:
        """Keep the first ``n_bytes``, which are ``n_blocks`` whole blocks, and go on behind them."""
        os.ftruncate(self._descriptor, n_bytes)
        self._end = (n_bytes, n_blocks)

    def append(self, kind: BlockKind, part: int, row: int, payload: bytes, *, twice: bool = False) -> None:
        """Append one block, or two copies of it; on return the operating system has it."""
        if self._descriptor < 0:
            raise OSError(errno.EBADF, "the journal is closed")
        if self._unsound:
            raise OSError(self._unsound.errno, f"no further writes after an earlier error: {self._unsound.strerror}")
        n_bytes, n_blocks = self._end
        numbers = range(n_blocks, n_blocks + (2 if twice else 1))
        blocks = b"".join(pack(kind, number, part, row, payload) for number in numbers)
        try:
            rest = memoryview(blocks)
            while rest:
                rest = rest[os.write(self._descriptor, rest) :]
            self._end = (n_bytes + len(blocks), numbers.stop)
        except BaseException:
            try:
                os.ftruncate(self._descriptor, self._end[0])
            except OSError as error:
                self._unsound = error
            raise

    def synchronise(self, *, if_due: bool = False) -> None:
        """Force what was written to the disk; ``if_due``: only if that was not done within ``SYNC_INTERVAL_S``.

        Raises:
            NameLost: the file no longer lies under its name.
        """
        now_s = time.monotonic()
        if not if_due or now_s - self._synced_s >= SYNC_INTERVAL_S:
            _fdatasync(self._descriptor)
            self._synced_s = now_s
            if not self._has_its_name():
                raise NameLost(errno.ENOENT, "was removed or renamed while it was written")

    def _has_its_name(self) -> bool:
        try:
            return os.path.samestat(self._path.stat(), os.fstat(self._descriptor))
        except OSError:
            return False

    def rescue(self) -> str:
        """Copy a removed file to where it was, or else to the folder for temporary files; says where its contents are.

        Raises:
            OSError: it can be written to neither.
        """
        if os.fstat(self._descriptor).st_nlink > 0:
            return "kept under the name that the file was given"
        folder = self._path.parent if self._path.parent.is_dir() else Path(tempfile.mkdtemp(prefix="vibrolock-"))
        place = folder / self._path.name
        with os.fdopen(os.dup(self._descriptor), "rb") as stream, place.open("xb") as copy:
            stream.seek(0)
            shutil.copyfileobj(stream, copy)
            copy.flush()
            os.fsync(copy.fileno())
        return f"written again to {place}"

    @property
    def closed(self) -> bool:
        """Whether the file was closed."""
        return self._descriptor < 0

    def close(self) -> None:
        """Close the file and let other writers in; may be called twice."""
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)

"""Rows of the points being measured. They are kept until their point is over: in memory, or in files if they are many."""

from collections import deque
from pathlib import Path

import numpy as np

from rig.campaigns.evaluation.rows import LongRows, Rows, Spool
from rig.errors import RecordingError
from rig.recording.parts import missing_rows
from vibrolock.arrays import undivided

IN_MEMORY_BYTES = 32 * 2**20  # bytes of rows in memory; more go to files; chosen


class RowBuffer:
    """Chunks of rows, sorted by the number of their first sample.

    Above ``in_memory_bytes`` they go to unnamed files in ``folder``, by default the system's for temporary files.
    """

    def __init__(self, dtype: np.dtype, folder: Path | None = None, *, in_memory_bytes: int = IN_MEMORY_BYTES) -> None:
        self._dtype, self._folder, self._most = dtype, folder, in_memory_bytes
        self._chunks: deque[tuple[int, np.ndarray]] = deque()
        self._bytes = 0
        self._spool: Spool | None = None
        self._first = 0
        """Sample of the first row of the spool."""

    def add(self, first: int, rows: np.ndarray) -> None:
        """Add a chunk that begins with sample ``first``; raises `RecordingError` if it cannot be kept in files."""
        self._chunks.append((first, rows))
        self._bytes += rows.nbytes
        if self._spool is None and self._bytes <= self._most:
            return
        try:
            if self._spool is None:
                self._first, self._spool = self._chunks[0][0], Spool(self._dtype, self._folder)
            while self._chunks:
                self._spool.add(self._chunks.popleft()[1])
        except OSError as error:
            where = self._folder or "the folder for temporary files"
            raise RecordingError(f"the rows of a long record cannot be kept ({error.strerror})", where=where) from error

    def take(self, first: int, end: int) -> Rows:
        """Return the rows of a point, and drop all rows up to the end of the point.

        Rows that are not there any more, for it was told too late that they belong to the point, are not numbers, as lost ones.
        """
        if self._spool is not None and first < self._first:
            kept = LongRows(self._spool, 0, self._spool.size).whole()
            self._spool, self._bytes = None, kept.nbytes
            self._chunks.append((self._first, kept))
        if self._spool is not None:
            begin, stop = self._first, self._first + self._spool.size
            taken = LongRows(self._spool, first - begin, end - begin)
            rest = LongRows(self._spool, end - begin, self._spool.size)
            self._spool, self._bytes = None, 0
            if end < stop:
                self.add(end, rest.whole())
            return taken
        out = missing_rows(end - first, self._dtype)
        while self._chunks and self._chunks[0][0] < end:
            start, rows = self._chunks.popleft()
            self._bytes -= rows.nbytes
            if start + rows.size <= first:
                continue
            taken_rows = slice(max(0, first - start), min(rows.size, end - start))
            place = slice(max(0, start - first), min(end, start + rows.size) - first)
            undivided(out)[place] = undivided(rows)[taken_rows]
            if start + rows.size > end:
                self._chunks.appendleft((start, rows))
                self._bytes += rows.nbytes
                break
        return out

    def drop_before(self, sample: int) -> None:
        """Drop the chunks that end before a sample."""
        if self._spool is not None and self._first + self._spool.size <= sample:
            self._spool, self._bytes = None, 0
        while self._chunks and self._chunks[0][0] + self._chunks[0][1].size <= sample:
            self._bytes -= self._chunks.popleft()[1].nbytes

"""Rows of the points being measured. They are kept in memory until their point is over."""

from collections import deque

import numpy as np

__all__ = ["RowBuffer"]


class RowBuffer:
    """Chunks of rows, sorted by the number of their first sample."""

    def __init__(self, dtype: np.dtype) -> None:
        self._dtype = dtype
        self._chunks: deque[tuple[int, np.ndarray]] = deque()

    def add(self, first: int, rows: np.ndarray) -> None:
        """Add a chunk that begins with sample ``first``."""
        self._chunks.append((first, rows))

    def take(self, first: int, end: int) -> np.ndarray:
        """Return the rows of a point, and drop all rows up to the end of the point."""
        out = np.empty(end - first, self._dtype)
        while self._chunks and self._chunks[0][0] < end:
            start, rows = self._chunks.popleft()
            if start + rows.size <= first:
                continue
            taken = slice(max(0, first - start), min(rows.size, end - start))
            out[max(0, start - first) : min(end, start + rows.size) - first] = rows[taken]
            if start + rows.size > end:
                self._chunks.appendleft((start, rows))
                break
        return out

    def drop_before(self, sample: int) -> None:
        """Drop the chunks that end before a sample."""
        while self._chunks and self._chunks[0][0] + self._chunks[0][1].size <= sample:
            self._chunks.popleft()

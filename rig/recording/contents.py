"""What a journal holds, part by part: rows are found by an index of its blocks, without holding them."""

from array import array
from bisect import bisect_right
from io import BufferedReader
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from rig.errors import RecordingError
from rig.recording.blocks import Kind, Tail, read_journal
from rig.recording.header import Header
from rig.recording.parts import Part, rows_at_once

__all__ = ["JournalContents", "JournalPart"]


class JournalPart(Part):
    """A part that is still in its journal."""

    def __init__(self, stream: BufferedReader, header: Header, information: dict[str, Any]) -> None:
        self.information, self.points, self.events, self.end = information, [], [], None
        self.n_rows, self.row_dtype, self.columns = 0, header.row_dtype, header.columns
        self.dropped_bytes, self.dropped_reason = 0, ""
        self._stream = stream
        self._offsets, self._firsts = array("q"), array("q")

    def add_rows(self, offset: int, n_rows: int) -> None:
        """Note ``n_rows`` further rows whose bytes begin at ``offset``."""
        self._offsets.append(offset)
        self._firsts.append(self.n_rows)
        self.n_rows += n_rows

    def read(self, start: int, stop: int) -> NDArray[Any]:
        """Read rows across blocks; see ``Part.read``."""
        rows = np.empty(stop - start, self.row_dtype)
        view, itemsize = rows.view(np.uint8).data, self.row_dtype.itemsize
        row, block = start, bisect_right(self._firsts, start) - 1
        while row < stop:
            block_stop = self._firsts[block + 1] if block + 1 < len(self._firsts) else self.n_rows
            taken = min(stop, block_stop) - row
            into = view[(row - start) * itemsize : (row - start + taken) * itemsize]
            try:
                self._stream.seek(self._offsets[block] + (row - self._firsts[block]) * itemsize)
                complete = self._stream.readinto(into) == len(into)
            except (OSError, ValueError) as error:
                raise RecordingError(f"journal: its rows cannot be read ({error})") from error
            if not complete:
                raise RecordingError("journal: it has become shorter while it was read")
            row, block = row + taken, block + 1
        return rows

    def _read_field(self, field: str, start: int, stop: int) -> NDArray[Any]:
        values = np.empty(stop - start, self.row_dtype[field])
        step = rows_at_once(self.row_dtype)
        for first in range(start, stop, step):
            last = min(first + step, stop)
            values[first - start : last - start] = self.read(first, last)[field]
        return values


class JournalContents:
    """Header, parts and tail of a journal; a context manager that holds the journal open for reading.

    Rows stay in the file; points, events and eight bytes twice per block of rows are held.

    Raises:
        RecordingError: on construction, as ``read_journal``.
    """

    def __init__(self, path: str | Path) -> None:
        blocks = read_journal(path)
        self.path, self.header = Path(path), blocks.header
        self.parts: list[JournalPart] = []
        self.n_blocks, self.size = 1, blocks.header_stop
        """Whole blocks with the header, and the bytes that they take."""
        self._stream: BufferedReader = self.path.open("rb")
        try:
            for block in blocks:
                self._add(block.kind, block.offset, block.payload, block.value)
                self.n_blocks, self.size = self.n_blocks + 1, block.stop
        except BaseException:
            self.close()
            raise
        self.tail: Tail = blocks.tail
        """What follows the last good block."""
        if self.parts:
            self.parts[-1].dropped_bytes, self.parts[-1].dropped_reason = self.tail.n_bytes, self.tail.reason

    def _add(self, kind: Kind, offset: int, payload: bytes, value: dict[str, Any]) -> None:
        if kind is Kind.PART:
            self.parts.append(JournalPart(self._stream, self.header, value))
            return
        part = self.parts[-1]
        if kind is Kind.ROWS:
            part.add_rows(offset, len(payload) // self.header.row_dtype.itemsize)
        elif kind is Kind.EVENT:
            part.events.append(value)
        elif kind is Kind.POINT:
            part.points.append(value)
        else:
            part.end = value

    def close(self) -> None:
        """Let go of the file; may be called twice."""
        self._stream.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

"""Contents of a journal, part by part; rows stay in the file and are found by an index of blocks."""

from array import array
from bisect import bisect_right
from io import BufferedReader
from pathlib import Path
from typing import cast

import numpy as np

from rig.errors import RecordingError
from rig.recording.blocks import Block, BlockKind, Gap
from rig.recording.header import Header
from rig.recording.journal_blocks import JournalBlocks, Tail
from rig.recording.parts import Part, missing_rows, rows_at_once
from rig.recording.stored import End, Event, Information
from rig.system.closing import Closing

MISSING = -1
"""Offset of rows that cannot be read."""
MOST_TOLD = 20
"""Gaps of a part that are reported one by one."""
LARGEST_RATIO = 200
"""Bytes of missing rows that are accepted per byte of the journal."""
_SMALL_BYTES = 2**26  # of missing rows that are accepted of any journal; chosen


class JournalPart(Part):
    """A part that is still in its journal."""

    def __init__(self, stream: BufferedReader, header: Header, information: Information) -> None:
        self.information, self.points, self.events, self.end = information, [], [], None
        self.n_rows, self.row_dtype, self.columns = 0, header.row_dtype, header.columns
        self.dropped_bytes, self.dropped_reason, self._n_gaps = 0, "", 0
        self._stream = stream
        self._offsets, self._firsts = array("q"), array("q")

    def add_rows(self, offset: int, n_rows: int) -> None:
        """Note ``n_rows`` further rows whose bytes begin at ``offset``, or which cannot be read (`MISSING`)."""
        self._offsets.append(offset)
        self._firsts.append(self.n_rows)
        self.n_rows += n_rows

    def add_gap(self, n_bytes: int, text: str) -> None:
        """Note bytes that cannot be read, and what was lost with them."""
        self.dropped_bytes += n_bytes
        self._n_gaps += 1
        if self._n_gaps <= MOST_TOLD:
            self.dropped_reason += f"; {text}" if self.dropped_reason else text
        elif self._n_gaps == MOST_TOLD + 1:
            self.dropped_reason += "; and more of the kind"

    def _read_rows(self, start: int, stop: int) -> np.ndarray:
        rows = np.empty(stop - start, self.row_dtype)
        view, itemsize = rows.view(np.uint8).data, self.row_dtype.itemsize
        row, block = start, bisect_right(self._firsts, start) - 1
        while row < stop:
            block_stop = self._firsts[block + 1] if block + 1 < len(self._firsts) else self.n_rows
            taken = min(stop, block_stop) - row
            into = view[(row - start) * itemsize : (row - start + taken) * itemsize]
            if self._offsets[block] == MISSING:
                rows[row - start : row - start + taken] = missing_rows(taken, self.row_dtype)
            else:
                self._fill(into, self._offsets[block] + (row - self._firsts[block]) * itemsize)
            row, block = row + taken, block + 1
        return rows

    def _fill(self, into: memoryview, offset: int) -> None:
        try:
            self._stream.seek(offset)
            complete = self._stream.readinto(into) == len(into)
        except (OSError, ValueError) as error:
            raise RecordingError(f"journal: its rows cannot be read ({error})") from error
        if not complete:
            raise RecordingError("journal: it has become shorter while it was read")

    def _read_field(self, field: str, start: int, stop: int) -> np.ndarray:
        values = np.empty(stop - start, self.row_dtype[field])
        step = rows_at_once(self.row_dtype)
        for first in range(start, stop, step):
            last = min(first + step, stop)
            values[first - start : last - start] = self.read(first, last)[field]
        return values


class JournalContents(Closing):
    """Header, parts and tail of a journal; a context manager that holds the journal open for reading.

    Rows stay in the file; points, events and eight bytes twice per block of rows are held. Rows in a block that cannot be
    read are not numbers, so that all behind them keep their place; the parts say what was lost.

    Raises:
        RecordingError: on construction, as `JournalBlocks`; or none of its parts can be told apart.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        blocks = JournalBlocks(self.path)
        self.header = blocks.header
        self.parts: list[JournalPart] = []
        self.n_blocks, self.size = 1, blocks.first.stop
        """Number of the block to come, and the bytes up to the last whole one."""
        self.damaged = False
        """Whether anything is lost apart from a write cut short at the end."""
        self.last_part = 0
        """Number of the part of the last whole block, from 1."""
        self._part_number = 0
        self._before_parts: list[tuple[int, str]] = []
        self._homeless: tuple[int, int, int] | None = None
        self._stream: BufferedReader = self.path.open("rb")
        try:
            if blocks.first.gap is not None:
                self._note(blocks.first.gap, "the header is there a second time")
            for block in blocks:
                self._add(block)
                self.n_blocks, self.size, self.last_part = block.sequence + 1, block.stop, block.part
            self._tell_homeless()
            if self.damaged and not self.parts:
                raise RecordingError(f"{path}: damaged: the beginnings of all its parts cannot be read")
        except BaseException:
            self.close()
            raise
        self.tail: Tail = blocks.tail
        """What follows the last good block."""
        self.damaged = self.damaged or not self.tail.torn
        if self.parts and self.tail.n_bytes:
            self.parts[-1].add_gap(self.tail.n_bytes, f"{self.tail.n_bytes} bytes lost at the end: {self.tail.reason}")

    def _add(self, block: Block) -> None:
        here = block.part == self._part_number
        if block.gap is not None:
            self._note(block.gap, self._lost_before(block) if here else "the end of a part")
        if block.kind is BlockKind.HEADER or (block.kind is BlockKind.PART and here):
            return
        if block.kind is BlockKind.PART:
            self._begin(block)
            return
        if not here:  # no part of that number has begun
            n_bytes, n_blocks, _ = self._homeless or (0, 0, 0)
            self._homeless = (n_bytes + block.stop - block.start, n_blocks + 1, block.part)
            return
        part = self.parts[-1]
        if block.kind is BlockKind.ROWS:
            part.add_rows(block.offset, len(block.payload) // self.header.row_dtype.itemsize)
        elif block.kind is BlockKind.EVENT:
            part.events.append(cast(Event, block.value))
        elif block.kind is BlockKind.POINT:
            part.points.append(block.value)
        else:
            part.end = cast(End, block.value)

    def _tell_homeless(self) -> None:
        """Note in one line the loss of a part whose beginning cannot be read."""
        if self._homeless is not None:
            n_bytes, n_blocks, part = self._homeless
            self._homeless = None
            self._note(Gap(n_bytes, n_blocks, f"the beginning of part {part} is lost"), "all of that part")

    def _begin(self, block: Block) -> None:
        self._tell_homeless()
        self._part_number = block.part
        self.parts.append(JournalPart(self._stream, self.header, cast(Information, block.value)))
        for n_bytes, text in self._before_parts:
            self.parts[-1].add_gap(n_bytes, text)
        self._before_parts.clear()

    def _lost_before(self, block: Block) -> str:
        """Add missing rows before a block of the same part; return which they are, in words."""
        first, n_rows = self.parts[-1].n_rows, block.row - self.parts[-1].n_rows
        if n_rows == 0:
            return "no rows"
        n_bytes = n_rows * self.header.row_dtype.itemsize
        if n_bytes > max(_SMALL_BYTES, LARGEST_RATIO * block.stop):
            raise RecordingError(f"{self.path}: damaged: a block says that {n_rows} rows before it are missing")
        self.parts[-1].add_rows(MISSING, n_rows)
        return f"rows {first} to {block.row - 1}, which are not numbers now"

    def _note(self, gap: Gap, lost: str) -> None:
        self.damaged = True
        blocks = "1 block" if gap.n_blocks == 1 else f"{gap.n_blocks} blocks"
        told = (gap.n_bytes, f"{blocks} of {gap.n_bytes} bytes lost: {gap.reason}; {lost}")
        if self.parts:
            self.parts[-1].add_gap(*told)
        else:
            self._before_parts.append(told)

    def close(self) -> None:
        """Close the file; may be called twice."""
        self._stream.close()

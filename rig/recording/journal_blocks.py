"""The whole blocks of a journal in order, including those after damage."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import BinaryIO

from rig.errors import RecordingError
from rig.recording.blocks import TWICE, BadBlockError, Block, BlockKind, Gap, following_block, read_block
from rig.recording.header import Header

EMPTY = "is empty: its run was killed before it began, and nothing was recorded; start it again"


@dataclass(frozen=True)
class Tail:
    """What follows the last good block of a journal."""

    n_bytes: int
    reason: str
    """Why reading stopped; empty where nothing follows."""
    torn: bool
    """True: nothing readable follows, so a write was cut short. False: damage within the file."""


class JournalBlocks:
    """The blocks of a journal in order, read one at a time; ``tail`` says how it ended once they are exhausted."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.tail = Tail(0, "", torn=True)
        try:
            with path.open("rb") as stream:
                first = self._header_in(stream)
        except OSError as error:
            raise RecordingError(f"{path}: cannot be read ({error.strerror})") from error
        if first.kind is not BlockKind.HEADER:
            raise RecordingError(f"{path}: not a readable journal; it does not begin with a header")
        self.header = Header.decoded(first.payload, path)
        self._first = first

    def _header_in(self, stream: BinaryIO) -> Block:
        """The header, or its copy where it cannot be read."""
        size = _size(stream)
        try:
            return read_block(stream, 0, size)
        except BadBlockError as error:
            second = following_block(stream, 1, size, 1)
            if second is None or second.kind is not BlockKind.HEADER:
                if not size:
                    raise RecordingError(f"{self.path}: {EMPTY}") from None
                raise RecordingError.of(
                    error, where=f"{self.path}: not a readable journal; at its beginning"
                ) from error
            return replace(second, gap=Gap(second.start, second.sequence, f"{error} (at byte 0)"))

    @property
    def header_stop(self) -> int:
        """Position of the first byte behind the header's block."""
        return self._first.stop

    @property
    def header_gap(self) -> Gap | None:
        """What cannot be read before the header."""
        return self._first.gap

    def __iter__(self) -> Iterator[Block]:
        """All whole blocks behind the header, also those behind damage; copies among them."""
        try:
            with self.path.open("rb") as stream:
                yield from self._blocks(stream)
        except OSError as error:
            raise RecordingError(f"{self.path}: cannot be read ({error.strerror})") from error

    def _blocks(self, stream: BinaryIO) -> Iterator[Block]:
        size, block = _size(stream), self._first
        while block.stop < size:
            try:
                following = self._in_order(read_block(stream, block.stop, size), block)
            except BadBlockError as error:
                reason = f"{error} (at byte {block.stop})"
                found = self._behind(stream, block, size)
                if found is None or found.version == 1:
                    self.tail = Tail(size - block.stop, reason, torn=found is None)
                    return
                gap = Gap(found.start - block.stop, found.sequence - block.sequence - 1, reason)
                following = replace(found, gap=gap)
            block = following
            yield block

    def _behind(self, stream: BinaryIO, last: Block, size: int) -> Block | None:
        """The first whole block after damage that can follow ``last``."""
        start = last.stop
        while found := following_block(stream, start, size, last.sequence + 1):
            whole = found.kind is not BlockKind.ROWS or len(found.payload) % self.header.row_dtype.itemsize == 0
            follows = (found.part, found.row) >= (last.part, last.row) and found.part > 0
            follows = follows and (found.start, found.sequence) != (last.stop, last.sequence + 1)  # which is no gap
            if found.version == 1 or (whole and follows and found.kind is not BlockKind.HEADER):
                return found
            start = found.start + 1
        return None

    def _in_order(self, block: Block, last: Block) -> Block:
        """The block with part and row, checked against ``last``; raises `BadBlockError` if it is out of place."""
        if block.sequence != last.sequence + 1:
            raise BadBlockError(f"block {block.sequence} where block {last.sequence + 1} belongs")
        n_rows = len(last.payload) // self.header.row_dtype.itemsize if last.kind is BlockKind.ROWS else 0
        part, row = last.part, last.row + n_rows
        copy = block.version > 1 and block.kind is last.kind and block.kind in TWICE and block.part == last.part
        if block.kind is BlockKind.PART and not copy:
            part, row = last.part + 1, 0
        elif not copy and (block.kind is BlockKind.HEADER or last.kind in (BlockKind.HEADER, BlockKind.END)):
            raise BadBlockError(f"a block of kind {block.kind.name.lower()} outside any part")
        if block.kind is BlockKind.ROWS and len(block.payload) % self.header.row_dtype.itemsize:
            raise BadBlockError(f"{len(block.payload)} bytes are no whole number of rows")
        if block.version == 1:
            return replace(block, part=part, row=row)
        if (block.part, block.row) != (part, row):
            raise BadBlockError(
                f"a block of part {block.part}, row {block.row}, where row {row} of part {part} belongs"
            )
        return block


def _size(stream: BinaryIO) -> int:
    return stream.seek(0, 2)


def read_journal(path: str | Path) -> JournalBlocks:
    """Open the journal at ``path`` for reading, block by block with bounded memory.

    Iterate the result for the whole blocks behind its ``header``: the ``gap`` of each says what cannot be read before it, and
    afterwards ``tail`` what cannot be read behind the last. A journal that is still being written may be read.

    Raises:
        RecordingError: no journal of ours, of a later schema, or not readable.
    """
    return JournalBlocks(Path(path))

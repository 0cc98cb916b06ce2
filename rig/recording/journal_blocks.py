"""The whole blocks of a journal in order, including those after damage."""

import os
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
    """The blocks of the journal at ``path``, read one at a time with bounded memory, also while it is still being written.

    Iterate it for the whole blocks behind its ``header``: the ``gap`` of each says what cannot be read before it, and ``tail``
    afterwards what cannot be read behind the last.

    Raises:
        RecordingError: on construction: no journal of ours, of a later schema, or not readable.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self.tail = Tail(0, "", torn=True)
        try:
            with path.open("rb") as stream:
                self.first = self._header_in(stream)
                """Block of the header."""
        except OSError as error:
            raise RecordingError(f"{path}: cannot be read ({error.strerror})") from error
        if self.first.kind is not BlockKind.HEADER:
            raise RecordingError(f"{path}: not a readable journal; it does not begin with a header")
        self.header = Header.decoded(self.first.payload, path)

    def _header_in(self, stream: BinaryIO) -> Block:
        """The header, or its copy where it cannot be read."""
        size = stream.seek(0, os.SEEK_END)
        try:
            return read_block(stream, 0, size)
        except BadBlockError as error:
            second = following_block(stream, 1, size, 1)
            if second is None or second.kind is not BlockKind.HEADER:
                if not size:
                    raise RecordingError(f"{self._path}: {EMPTY}") from None
                raise RecordingError.of(
                    error, where=f"{self._path}: not a readable journal; at its beginning"
                ) from error
            return replace(second, gap=Gap(second.start, second.sequence, f"{error} (at byte 0)"))

    def __iter__(self) -> Iterator[Block]:
        """All whole blocks behind the header, also those behind damage; copies among them."""
        try:
            with self._path.open("rb") as stream:
                yield from self._blocks(stream)
        except OSError as error:
            raise RecordingError(f"{self._path}: cannot be read ({error.strerror})") from error

    def _blocks(self, stream: BinaryIO) -> Iterator[Block]:
        size, block = stream.seek(0, os.SEEK_END), self.first
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
            raise BadBlockError(f"{len(block.payload)} bytes are not a whole number of rows")
        if block.version == 1:
            return replace(block, part=part, row=row)
        if (block.part, block.row) != (part, row):
            raise BadBlockError(
                f"a block of part {block.part}, row {block.row}, where row {row} of part {part} belongs"
            )
        return block

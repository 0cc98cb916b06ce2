"""The journal's block: a head of 24 bytes, a payload, and a checksum over both.

Head, little-endian: magic ``VLJB``, version (uint16), kind (uint16), payload length (uint32), sequence number from 0
(uint64), CRC-32 (uint32) of the twenty bytes before it followed by the payload.
"""

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import Any, BinaryIO

from rig.errors import RecordingError
from rig.recording import jsontext
from rig.recording.header import Header

__all__ = ["LARGEST_PAYLOAD", "Block", "JournalBlocks", "Kind", "Tail", "pack", "read_journal"]

MAGIC = b"VLJB"
VERSION = 1
LARGEST_PAYLOAD = 16 * 2**20
"""A longer length is taken for damage, which bounds the reader's memory."""

_HEAD = struct.Struct("<4sHHIQ")
_CRC = struct.Struct("<I")
_HEAD_BYTES = _HEAD.size + _CRC.size
_SEARCH_BYTES = 2**20


class Kind(IntEnum):
    """What a block holds: JSON text, but for ``ROWS``, which holds the bytes of whole rows."""

    HEADER = 1
    PART = 2
    ROWS = 3
    EVENT = 4
    POINT = 5
    END = 6


@dataclass(frozen=True)
class Block:
    """One whole block whose checksum holds."""

    kind: Kind
    sequence: int
    offset: int
    """Position of the payload in the file, bytes."""
    payload: bytes
    value: dict[str, Any]
    """The payload decoded; empty for rows."""

    @property
    def stop(self) -> int:
        """Position of the first byte behind the block."""
        return self.offset + len(self.payload)


@dataclass(frozen=True)
class Tail:
    """What follows the last good block of a journal."""

    n_bytes: int
    reason: str
    """Why reading stopped; empty where nothing follows."""
    torn: bool
    """Nothing readable follows: a write cut short by a kill, a power cut or a full disk; else damage amid the file."""


class _BadBlockError(Exception):
    """What is wrong with a block; never leaves this module."""


def pack(kind: Kind, sequence: int, payload: bytes) -> bytes:
    """Return the bytes of one block; ``payload`` holds at most ``LARGEST_PAYLOAD`` bytes."""
    head = _HEAD.pack(MAGIC, VERSION, kind, len(payload), sequence)
    return b"".join((head, _CRC.pack(zlib.crc32(payload, zlib.crc32(head))), payload))


def _read_block(stream: BinaryIO, start: int, size: int) -> Block:
    stream.seek(start)
    head = stream.read(_HEAD_BYTES)
    if not head.startswith(MAGIC[: len(head)]):
        raise _BadBlockError("no block begins there")
    if len(head) < _HEAD_BYTES:
        raise _BadBlockError("the file ends within a block's head")
    _, version, kind, length, sequence = _HEAD.unpack_from(head)
    if version != VERSION:
        raise _BadBlockError(f"block of journal version {version}, this version reads {VERSION}; update vibrolock")
    if length > LARGEST_PAYLOAD:
        raise _BadBlockError(f"a length of {length} bytes, at most {LARGEST_PAYLOAD} are written")
    if length > size - start - _HEAD_BYTES:
        raise _BadBlockError("the file ends within a block")
    payload = stream.read(length)
    if zlib.crc32(payload, zlib.crc32(head[: _HEAD.size])) != _CRC.unpack_from(head, _HEAD.size)[0]:
        raise _BadBlockError("checksum does not match")
    try:
        known = Kind(kind)
        value = {} if known is Kind.ROWS else jsontext.decode(payload)
    except ValueError as error:
        raise _BadBlockError(f"a block of kind {kind} that cannot be read ({error})") from error
    return Block(known, sequence, start + _HEAD_BYTES, payload, value)


def _whole_block_follows(stream: BinaryIO, start: int, size: int) -> bool:
    """Whether any readable block begins behind ``start``."""
    while start + _HEAD_BYTES <= size:
        stream.seek(start)
        window = stream.read(_SEARCH_BYTES)
        found = window.find(MAGIC)
        if found < 0:
            start += max(len(window) - len(MAGIC) + 1, 1)
            continue
        try:
            _read_block(stream, start + found, size)
        except _BadBlockError:
            start += found + 1
        else:
            return True
    return False


class JournalBlocks:
    """The blocks of a journal in order, read one at a time; ``tail`` says how it ended once they are exhausted."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.tail = Tail(0, "", torn=True)
        try:
            with path.open("rb") as stream:
                first = _read_block(stream, 0, _size(stream))
        except OSError as error:
            raise RecordingError(f"{path}: cannot be read ({error.strerror})") from error
        except _BadBlockError as error:
            empty = path.stat().st_size == 0
            why = "it is empty" if empty else f"at its beginning: {error}"
            raise RecordingError(f"{path}: not a readable journal; {why}") from error
        if first.kind is not Kind.HEADER or first.sequence != 0:
            raise RecordingError(f"{path}: not a readable journal; it does not begin with a header")
        self.header = Header.decoded(first.payload, path)
        self._first = first

    @property
    def header_stop(self) -> int:
        """Position of the first byte behind the header's block."""
        return self._first.stop

    def __iter__(self) -> Iterator[Block]:
        """All whole blocks behind the header, up to the first bad one."""
        try:
            with self.path.open("rb") as stream:
                yield from self._blocks(stream)
        except OSError as error:
            raise RecordingError(f"{self.path}: cannot be read ({error.strerror})") from error

    def _blocks(self, stream: BinaryIO) -> Iterator[Block]:
        size, block, in_part = _size(stream), self._first, False
        while block.stop < size:
            try:
                following = _read_block(stream, block.stop, size)
                self._check_order(following, block.sequence + 1, in_part)
            except _BadBlockError as error:
                torn = not _whole_block_follows(stream, block.stop + 1, size)
                self.tail = Tail(size - block.stop, f"{error} (at byte {block.stop})", torn)
                return
            block = following
            in_part = block.kind is not Kind.END
            yield block

    def _check_order(self, block: Block, sequence: int, in_part: bool) -> None:
        if block.sequence != sequence:
            raise _BadBlockError(f"block {block.sequence} where block {sequence} belongs")
        if block.kind is Kind.HEADER or (block.kind is not Kind.PART and not in_part):
            raise _BadBlockError(f"a block of kind {block.kind.name.lower()} outside any part")
        if block.kind is Kind.ROWS and len(block.payload) % self.header.row_dtype.itemsize:
            raise _BadBlockError(f"{len(block.payload)} bytes are no whole number of rows")


def _size(stream: BinaryIO) -> int:
    return stream.seek(0, 2)


def read_journal(path: str | Path) -> JournalBlocks:
    """Open the journal at ``path`` for reading, block by block with bounded memory.

    Iterate the result for the whole blocks behind its ``header``; afterwards its ``tail`` says how many bytes were
    dropped and why. A journal that is still being written may be read.

    Raises:
        RecordingError: no journal of ours, of a later schema, or not readable.
    """
    return JournalBlocks(Path(path))

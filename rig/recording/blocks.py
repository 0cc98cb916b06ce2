"""The journal's block: a head of 36 bytes, a payload, and a checksum over both.

Head, little-endian: magic ``VLJB``, version (uint16), kind (uint16), payload length (uint32), sequence number from 0
(uint64), number of the part from 1 (uint32, 0 in the header), rows of the part before the block (uint64), CRC-32 (uint32) of
the 32 bytes before it followed by the payload. Every block thus states its position and can be used even after a damaged block.
Blocks of version 1 had neither part nor rows in their heads of 24 bytes; nothing after a damaged block is read there.

The header and the beginning of each part are written twice, because nothing could be read without them.
"""

import struct
import zlib
from dataclasses import dataclass
from enum import IntEnum
from typing import BinaryIO

from rig.recording import jsontext
from rig.text.json_values import JsonValue

MAGIC = b"VLJB"
VERSION = 2  # of the block that is written
LARGEST_PAYLOAD = 16 * 2**20
"""A block that claims to be longer counts as damaged, which bounds the reader's memory."""

_HEADS = {1: struct.Struct("<4sHHIQ"), 2: struct.Struct("<4sHHIQIQ")}
_VERSION = struct.Struct("<4xH")
_CRC = struct.Struct("<I")
_SEARCH_BYTES = 2**20  # read at a time in search of a block; chosen


class BlockKind(IntEnum):
    """Kind of a block. ``ROWS`` holds the bytes of whole rows, all others JSON text."""

    HEADER = 1
    PART = 2
    ROWS = 3
    EVENT = 4
    POINT = 5
    END = 6


TWICE = frozenset((BlockKind.HEADER, BlockKind.PART))
"""Kinds that are written twice in a row, because nothing after them could be read without them."""


@dataclass(frozen=True)
class Gap:
    """Unreadable bytes between two whole blocks."""

    n_bytes: int
    n_blocks: int
    """Blocks that were written there."""
    reason: str


@dataclass(frozen=True)
class Block:
    """One whole block whose checksum holds."""

    version: int
    kind: BlockKind
    sequence: int
    part: int
    """Number of its part, from 1; counted by the reader in files of version 1."""
    row: int
    """Rows of its part before it; counted by the reader in files of version 1."""
    start: int
    """Position of its head in the file, bytes."""
    offset: int
    """Position of the payload in the file, bytes."""
    payload: bytes
    value: dict[str, JsonValue]
    """The payload decoded; empty for rows."""
    gap: Gap | None = None
    """The gap between the block before and this one, if there is one."""

    @property
    def stop(self) -> int:
        """Position of the first byte behind the block."""
        return self.offset + len(self.payload)


class BadBlockError(Exception):
    """A block is damaged; the message says how."""


def pack(kind: BlockKind, sequence: int, part: int, row: int, payload: bytes) -> bytes:
    """Return the bytes of one block; ``payload`` holds at most ``LARGEST_PAYLOAD`` bytes."""
    head = _HEADS[VERSION].pack(MAGIC, VERSION, kind, len(payload), sequence, part, row)
    return b"".join((head, _CRC.pack(zlib.crc32(payload, zlib.crc32(head))), payload))


def read_block(stream: BinaryIO, start: int, size: int) -> Block:
    """Read the block at byte ``start`` of a file of ``size`` bytes; raise `BadBlockError` if there is none."""
    stream.seek(start)
    head = stream.read(_VERSION.size)
    if not head.startswith(MAGIC[: len(head)]):
        raise BadBlockError("no block begins there")
    if len(head) < _VERSION.size:
        raise BadBlockError("the file ends within a block's head")
    version = _VERSION.unpack(head)[0]
    if version not in _HEADS:
        raise BadBlockError(f"block of journal version {version}, this version reads up to {VERSION}; update vibrolock")
    layout = _HEADS[version]
    head += stream.read(layout.size - len(head))
    checksum = stream.read(_CRC.size)
    if len(head) + len(checksum) < layout.size + _CRC.size:
        raise BadBlockError("the file ends within a block's head")
    _, _, kind, length, sequence, *where = layout.unpack(head)
    offset = start + layout.size + _CRC.size
    if length > LARGEST_PAYLOAD:
        raise BadBlockError(f"a length of {length} bytes, at most {LARGEST_PAYLOAD} are written")
    if length > size - offset:
        raise BadBlockError("the file ends within a block")
    payload = stream.read(length)
    if zlib.crc32(payload, zlib.crc32(head)) != _CRC.unpack(checksum)[0]:
        raise BadBlockError("checksum does not match")
    try:
        known = BlockKind(kind)
        value = {} if known is BlockKind.ROWS else jsontext.decode(payload)
    except ValueError as error:
        raise BadBlockError(f"a block of kind {kind} that cannot be read ({error})") from error
    part, row = where or (0, 0)
    return Block(version, known, sequence, part, row, start, offset, payload, value)


def following_block(stream: BinaryIO, start: int, size: int, sequence: int) -> Block | None:
    """The first whole block at or after byte ``start`` with number ``sequence`` or later."""
    while start < size:
        stream.seek(start)
        window = stream.read(_SEARCH_BYTES)
        found = window.find(MAGIC)
        if found < 0:
            start += max(len(window) - len(MAGIC) + 1, 1)
            continue
        try:
            block = read_block(stream, start + found, size)
        except BadBlockError:
            block = None
        if block is not None and block.sequence >= sequence:
            return block
        start += found + 1
    return None

"""Payloads of a device that runs the loop, the same on every wire: pieces of the records, its state and its rows."""

import struct
from collections.abc import Iterator

import numpy as np

from rig.errors import DaqRefused
from rig.wire.messages import (
    LARGEST_PIECE,
    LOWEST_VERSION,
    ROW_BYTES,
    STATE_BYTES,
    Message,
    Record,
    Rows,
    State,
    Stream,
)

RECORD, STATE, ROWS = 8, 9, 10
"""Second byte of a payload."""
LARGEST_PAYLOAD = 65_536
"""Largest header and body of any message, bytes; it bounds a receiver's memory."""

RECORD_HEAD = struct.Struct("<BBHBxxxI")  # version, type, number; array; offset
STATE_HEAD = struct.Struct("<BBHQ")  # sample
PIECE_HEAD = struct.Struct("<BxHI")  # array; length; offset: a piece of a state
ROWS_HEAD = struct.Struct("<BBHQQIHxx")  # first; clock_us; dropped; flags; two zeros
MOST_DROPPED = 2**32 - 1  # samples: 32 bits


class Malformed(ValueError):  # noqa: N818 (a remark on a frame)
    """A frame that arrived intact and is no message of this protocol, or no block of the stream agreed on."""

    counter = "malformed"


def rows_bytes(n_channels: int, block: int) -> int:
    """Bytes of the payload of a block of rows."""
    return ROWS_HEAD.size + block * (4 * n_channels + ROW_BYTES)


class LoopPayloads:
    """Messages of a loop on the device to payloads and back; its only state is the shape of the stream."""

    def __init__(self) -> None:
        self._shape = (0, 0)
        self.rows_size = 0
        """Bytes of the payload of a block of rows; 0 where the host runs the loop."""

    def configure(self, stream: Stream, version: int) -> None:
        """Agree on the shape of blocks."""
        self._shape = stream.block, stream.n_channels
        of_device = stream.loop and version > LOWEST_VERSION
        self.rows_size = rows_bytes(stream.n_channels, stream.block) if of_device else 0

    def encode(self, message: Message, version: int) -> bytes:
        """The payload of a message. Raises `DaqRefused` for rows of another shape, `TypeError` for another kind of message."""
        if isinstance(message, Record):
            return RECORD_HEAD.pack(version, RECORD, 0, message.array, message.offset) + message.data
        if isinstance(message, State):
            pieces = (PIECE_HEAD.pack(one.array, len(one.data), one.offset) + one.data for one in message.pieces)
            return STATE_HEAD.pack(version, STATE, 0, message.sample) + b"".join(pieces)
        if isinstance(message, Rows):
            first, readings, rows, flags, dropped, clock_us, sequence = message
            if readings.shape != self._shape or not self.rows_size:
                raise DaqRefused(f"readings of shape {readings.shape}: allowed is {self._shape}, the stream agreed on")
            dropped = min(dropped, MOST_DROPPED)
            head = ROWS_HEAD.pack(version, ROWS, sequence & 0xFFFF, first, clock_us, dropped, flags)
            return head + readings.astype("<f4").tobytes() + rows.tobytes()
        raise TypeError(f"{message!r} is not a message")

    def decode(self, payload: bytes) -> Message:
        """The message of a payload of at least four bytes. Raises only `Malformed`."""
        size, kind = len(payload), payload[1]
        if kind == ROWS and size == self.rows_size and size:
            _, _, sequence, first, clock_us, dropped, flags = ROWS_HEAD.unpack_from(payload)
            block = self._shape[0]
            readings = np.ndarray(self._shape, "<f4", payload, ROWS_HEAD.size)
            rows = np.ndarray((block, ROW_BYTES), np.uint8, payload, ROWS_HEAD.size + readings.nbytes)
            return Rows(first, readings, rows, flags, dropped, clock_us, sequence)
        if kind == RECORD and RECORD_HEAD.size < size <= RECORD_HEAD.size + LARGEST_PIECE:
            _, _, _, array, offset = RECORD_HEAD.unpack_from(payload)
            return Record(array, offset, payload[RECORD_HEAD.size :])
        if kind == STATE and STATE_HEAD.size <= size <= STATE_BYTES:
            return State(STATE_HEAD.unpack_from(payload)[3], tuple(_pieces(payload)))
        raise Malformed(f"type {kind} with {size} bytes")


def _pieces(payload: bytes) -> Iterator[Record]:
    """The pieces of a state. Raises `Malformed`."""
    at = STATE_HEAD.size
    while at < len(payload):
        if at + PIECE_HEAD.size > len(payload):
            raise Malformed(f"a piece of a state with {len(payload) - at} bytes")
        array, length, offset = PIECE_HEAD.unpack_from(payload, at)
        at += PIECE_HEAD.size
        data = payload[at : at + length]
        if len(data) < length:
            raise Malformed(f"{len(data)} of {length} bytes of a state")
        yield Record(array, offset, data)
        at += length

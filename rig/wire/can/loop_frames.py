"""Frames of a loop on the device, over CAN FD: pieces of its records, and the long messages with its state and its rows."""

import struct
from collections import deque
from zlib import crc32

from rig.wire.can.frames import Frame, padded_length
from rig.wire.loop_payloads import LARGEST_PAYLOAD, LoopPayloads, Malformed, rows_bytes
from rig.wire.messages import STATE_BYTES, Message, Record, Rows, State, Stream

PIECE = struct.Struct("<BBxxI")  # array; bytes; offset: a piece of the records
PIECE_BYTES = 64 - PIECE.size
PLACE = struct.Struct("<H")  # number of the message times 2048, plus part: a part of a long message
PART_BYTES = 64 - PLACE.size
PARTS, NUMBERS = 1 << 11, 1 << 5  # that a place tells apart
LENGTH = CRC = struct.Struct("<I")  # of the payload, before and behind it
OPEN_MESSAGES = 4  # of which parts may come: the newest and those before it
REMEMBERED = 4  # messages that were whole, so that a part that comes again is known

COUNTERS = ("crc_errors", "malformed")
"""Long messages that were damaged, and those that are none."""


def part_lengths(payload_bytes: int) -> list[int]:
    """Bytes of the frames of a long message."""
    whole = LENGTH.size + payload_bytes + CRC.size
    return [padded_length(PLACE.size + min(PART_BYTES, whole - first)) for first in range(0, whole, PART_BYTES)]


def lengths_of_rows(stream: Stream) -> tuple[list[int], list[int]]:
    """Bytes of the frames of a block of rows, and of a state at most."""
    return part_lengths(rows_bytes(stream.n_channels, stream.block)), part_lengths(STATE_BYTES)


class _Open:
    """A long message of which not all parts have come."""

    def __init__(self) -> None:
        self.parts: dict[int, bytes] = {}
        self.missing = 1
        self.is_told = False  # its length, by the first part

    def put(self, part: int, data: bytes) -> None:
        self.parts[part] = data
        self.missing -= 1
        if part == 0:
            (size,) = LENGTH.unpack_from(data)
            whole = LENGTH.size + min(size, LARGEST_PAYLOAD) + CRC.size
            self.missing = -(-whole // PART_BYTES) - len(self.parts)
            self.is_told = True

    def is_whole(self) -> bool:
        return self.is_told and self.missing <= 0

    def payload(self) -> bytes:
        """What was sent. Raises `Malformed`."""
        data = b"".join(self.parts[part] for part in sorted(self.parts))
        (size,) = LENGTH.unpack_from(data)
        end = LENGTH.size + size
        if len(data) < end + CRC.size or data[end : end + CRC.size] != CRC.pack(crc32(data[LENGTH.size : end])):
            raise Malformed(f"CRC-32 of {size} bytes")
        return data[LENGTH.size : end]


class LongMessages:
    """Payloads of one identifier from their parts, which may come in any order; a message of which one is lost is lost."""

    def __init__(self, counters: dict[str, int]) -> None:
        self._counters = counters
        self._open: dict[int, _Open] = {}
        self._whole: deque[int] = deque(maxlen=REMEMBERED)

    def put(self, data: bytes) -> bytes | None:
        """Take the data of a frame; return the payload that it completes. Raises `Malformed`, `struct.error`."""
        number, part = divmod(PLACE.unpack_from(data)[0], PARTS)
        content = data[PLACE.size :]
        message = self._open.get(number)
        if message is None:
            if number in self._whole:
                self._counters["repeated_frames"] += 1
                return None
            message = self._begin(number)
        elif part in message.parts:
            self._counters["repeated_frames"] += 1
            if message.parts[part] == content:
                return None
            self._counters["incomplete_blocks"] += 1  # of a message whose number has come round
            message = self._begin(number)
        message.put(part, content)
        if not message.is_whole():
            return None
        del self._open[number]
        self._whole.append(number)
        return message.payload()

    def _begin(self, number: int) -> _Open:
        self._open.pop(number, None)
        while len(self._open) >= OPEN_MESSAGES:
            del self._open[next(iter(self._open))]
            self._counters["incomplete_blocks"] += 1
        self._open[number] = out = _Open()
        return out


class LoopFrames:
    """One end's frames of a loop on the device. ``identifiers``: of records, states and rows."""

    def __init__(self, identifiers: tuple[int, int, int], counters: dict[str, int]) -> None:
        self._records, self._states, self._rows = identifiers
        self._counters = counters
        counters.update(dict.fromkeys(COUNTERS, 0))
        self._payloads = LoopPayloads()
        self._number = 0
        self._long = {identifier: LongMessages(counters) for identifier in identifiers[1:]}

    def configure(self, stream: Stream, version: int) -> None:
        """Agree on the shape of rows."""
        self._payloads.configure(stream, version)
        self._long = {identifier: LongMessages(self._counters) for identifier in self._long}

    def encode(self, message: Record | State | Rows, version: int) -> list[Frame]:
        """The frames of a message, in sending order."""
        if isinstance(message, Record):
            return [self._piece(message, first) for first in range(0, len(message.data), PIECE_BYTES)]
        payload = self._payloads.encode(message, version)
        data = LENGTH.pack(len(payload)) + payload + CRC.pack(crc32(payload))
        identifier = self._states if isinstance(message, State) else self._rows
        place = self._number % NUMBERS * PARTS
        self._number += 1
        return [
            _frame(identifier, PLACE.pack(place + part) + data[first : first + PART_BYTES])
            for part, first in enumerate(range(0, len(data), PART_BYTES))
        ]

    def _piece(self, message: Record, first: int) -> Frame:
        data = message.data[first : first + PIECE_BYTES]
        return _frame(self._records, PIECE.pack(message.array, len(data), message.offset + first) + data)

    def decode(self, frame: Frame, identifier: int) -> Message | None:
        """The message that a frame completes. Raises `ValueError` and `struct.error` for a frame that is none."""
        data = frame.data
        if not frame.fd:
            raise ValueError("a classical frame")
        if identifier == self._records:
            array, size, offset = PIECE.unpack_from(data)
            if not 0 < size <= PIECE_BYTES or len(data) != padded_length(PIECE.size + size):
                raise ValueError(f"{len(data)} bytes for a piece of {size}")
            return Record(array, offset, data[PIECE.size : PIECE.size + size])
        try:
            payload = self._long[identifier].put(data)
        except Malformed:
            self._counters["crc_errors"] += 1
            return None
        if payload is None:
            return None
        try:
            return self._payloads.decode(payload)
        except Malformed:
            self._counters["malformed"] += 1
            return None


def _frame(identifier: int, data: bytes) -> Frame:
    return Frame(identifier, data.ljust(padded_length(len(data)), b"\0"), True)

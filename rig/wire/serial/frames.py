"""Frames on a serial line: payload and CRC-32, encoded by COBS so that a zero occurs only between them.

COBS: S. Cheshire, M. Baker, Consistent overhead byte stuffing, IEEE/ACM Transactions on Networking 7 (1999) 159-172.
"""

import struct
from zlib import crc32

from cobs.cobs import DecodeError, decode, encode

from rig.wire.loop_payloads import LARGEST_PAYLOAD, Malformed
from rig.wire.messages import STATE_BYTES, Message, Stream
from rig.wire.serial.codec import Codec, Damaged, Oversize

CRC_SIZE = 4  # bytes of a CRC-32
CRC = struct.Struct("<I").pack
RESIDUE = crc32(bytes(CRC_SIZE))  # of any bytes with their CRC-32 behind them, low byte first
LONGEST_RUN = 254  # bytes of a COBS block

COUNTERS = ("crc_errors", "oversize_frames", "malformed", "foreign_versions", "garbage_bytes")
"""What a `FrameReader` counts: frames that were damaged, too long, no message, of another version; bytes of all these."""


def frame(payload: bytes) -> bytes:
    """The bytes of one payload on the line, with the zero that ends them."""
    encoded: bytes = encode(payload + CRC(crc32(payload)))
    return encoded + b"\0"


def payload_of(encoded: bytes) -> bytes:
    """The payload of one frame without its zero. Raises `Damaged`."""
    try:
        data: bytes = decode(encoded)
    except DecodeError as error:
        raise Damaged(str(error)) from error
    if crc32(data) != RESIDUE:  # which no three bytes or fewer have
        raise Damaged(f"CRC-32 of {len(data)} bytes")
    return data[:-CRC_SIZE]


def largest_frame(payload_size: int) -> int:
    """Bytes on the line of a payload in the worst case, with the zero that ends them."""
    size = payload_size + CRC_SIZE
    return size + size // LONGEST_RUN + 2


class FrameReader:
    """Messages out of a stream of bytes in any pieces.

    What is not a message is counted in ``counters`` and skipped; the next zero begins anew. Never holds more than one frame.
    """

    def __init__(self, codec: Codec, counters: dict[str, int]) -> None:
        self._codec, self._decode = codec, codec.decode
        self._counters = counters
        self._rest = b""
        self._skipping = False  # inside a frame that is too long already
        self._longest = largest_frame(LARGEST_PAYLOAD)
        counters.update((name, counters.get(name, 0)) for name in COUNTERS)

    def configure(self, stream: Stream) -> None:
        """Expect no frame longer than those of a stream."""
        self._longest = largest_frame(
            max(*Codec.sizes(stream, self._codec.version), STATE_BYTES if stream.loop else 64)
        )

    def feed(self, data: bytes) -> list[Message]:
        """Messages that are complete with these bytes, in order."""
        if self._rest:
            data = self._rest + data
        parts = data.split(b"\0")
        self._rest = parts.pop()
        if self._skipping and parts:
            self._counters["garbage_bytes"] += len(parts.pop(0))
            self._skipping = False
        messages: list[Message] = []
        for part in parts:
            if part:
                try:
                    if len(part) >= self._longest:
                        raise Oversize
                    messages.append(self._decode(payload_of(part)))
                except Malformed as remark:
                    self._counters[remark.counter] += 1
                    self._counters["garbage_bytes"] += len(part)
        if self._skipping or len(self._rest) >= self._longest:
            self._counters["oversize_frames"] += not self._skipping
            self._counters["garbage_bytes"] += len(self._rest)
            self._rest, self._skipping = b"", True
        return messages

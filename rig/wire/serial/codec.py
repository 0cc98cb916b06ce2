"""Messages as bytes: a header of four bytes, a body of fixed form, all little-endian; see ``docs/wire-protocol.md``."""

import struct
from enum import IntEnum

import numpy as np

from rig.errors import DaqRefused
from rig.wire.messages import VERSION, Answer, EmergencyStop, Heartbeat, Message, Output, Request, Samples, Stream

__all__ = ["LARGEST_PAYLOAD", "Codec", "Damaged", "ForeignVersion", "Malformed", "Oversize", "Type"]

LARGEST_PAYLOAD = 65_536
"""Bytes of the largest header and body, whatever the stream: what bounds a receiver's memory."""


class Type(IntEnum):
    """Second byte of a frame."""

    REQUEST = 1
    ANSWER = 2
    SAMPLES = 3
    OUTPUT = 4
    HEARTBEAT = 5
    EMERGENCY_STOP = 6


LASTING = (
    Type.REQUEST,
    Type.ANSWER,
    Type.EMERGENCY_STOP,
)  # the same in every version, so that versions can be agreed on

HEADER = struct.Struct("<BBH")  # version, type, sequence
COMMAND = struct.Struct("<BBHBBBBI")  # header; number, command or status, parameter, item, value
SAMPLES = struct.Struct("<BBHQQIHxx")  # header; first, clock_us, dropped, flags, two zeros that align the counts
OUTPUT = struct.Struct("<BBHQ")  # header; first
HEARTBEAT = struct.Struct("<BBHBBHIQ")  # header; state, boot, flags, dropped, samples
STOP = struct.Struct("<BBHB")  # header; reason

MOST_DROPPED = 2**32 - 1


class Malformed(ValueError):  # noqa: N818 (a remark on a frame)
    """A frame that arrived intact and is no message of this protocol, or no block of the stream agreed on."""

    counter = "malformed"


class ForeignVersion(Malformed):
    """A message of another version, whose form may have changed since."""

    counter = "foreign_versions"


class Damaged(Malformed):
    """A frame whose bytes changed on the way."""

    counter = "crc_errors"


class Oversize(Malformed):
    """More bytes without a zero than any frame has."""

    counter = "oversize_frames"


class Codec:
    """Messages to payloads and back. Without memory but for the stream: no payload depends on the one before."""

    def __init__(self) -> None:
        self._counts = np.dtype("<i2")
        self._shape = (0, 0)
        self._samples_size = self._output_size = 0  # of no payload: nothing is understood before `configure`

    def configure(self, stream: Stream) -> None:
        """Agree on the shape of blocks.

        Raises `DaqRefused` for counts other than 16 or 32 bits and for blocks that no frame holds.
        """
        if stream.bits not in (16, 32):
            raise DaqRefused(f"counts of {stream.bits} bits: allowed is 16 or 32")
        samples_size, output_size = self.sizes(stream)
        if samples_size > LARGEST_PAYLOAD:
            raise DaqRefused(
                f"a block of {stream.block} samples of {stream.n_channels} channels takes {samples_size} bytes: "
                f"allowed is {LARGEST_PAYLOAD}; ask for a smaller block"
            )
        self._counts = np.dtype(f"<i{stream.bits // 8}")
        self._shape = (stream.block, stream.n_channels)
        self._samples_size, self._output_size = samples_size, output_size

    @staticmethod
    def sizes(stream: Stream) -> tuple[int, int]:
        """Bytes of the payload of one block of samples, and of one of outputs."""
        width = stream.bits // 8
        return SAMPLES.size + width * stream.block * stream.n_channels, OUTPUT.size + width * stream.block

    def encode(self, message: Message) -> bytes:
        """The payload of a message; counts must have the shape agreed on."""
        if isinstance(message, Samples):
            first, counts, flags, dropped, clock_us, sequence = message
            self._check(counts, self._shape)
            dropped = min(dropped, MOST_DROPPED)
            head = SAMPLES.pack(VERSION, Type.SAMPLES, sequence & 0xFFFF, first, clock_us, dropped, flags)
            return head + counts.astype(self._counts, copy=False).tobytes()
        if isinstance(message, Output):
            first, counts, sequence = message
            self._check(counts, self._shape[:1])
            head = OUTPUT.pack(VERSION, Type.OUTPUT, sequence & 0xFFFF, first)
            return head + counts.astype(self._counts, copy=False).tobytes()
        if isinstance(message, Request):
            return COMMAND.pack(VERSION, Type.REQUEST, 0, *message)
        if isinstance(message, Answer):
            return COMMAND.pack(VERSION, Type.ANSWER, 0, *message)
        if isinstance(message, Heartbeat):
            state, flags, boot, samples, dropped = message
            dropped = min(dropped, MOST_DROPPED)
            return HEARTBEAT.pack(VERSION, Type.HEARTBEAT, 0, state, boot & 0xFF, flags, dropped, samples)
        return STOP.pack(VERSION, Type.EMERGENCY_STOP, 0, message.reason)

    def decode(self, payload: bytes) -> Message:
        """The message of a payload; counts are views of its bytes. Raises `Malformed`, and nothing else."""
        size = len(payload)
        if size < HEADER.size:
            raise Malformed(f"{size} bytes")
        version, kind, _ = HEADER.unpack_from(payload)
        if version != VERSION and kind not in LASTING:
            raise ForeignVersion(f"version {version}")
        if kind == Type.SAMPLES and size == self._samples_size:
            _, _, sequence, first, clock_us, dropped, flags = SAMPLES.unpack_from(payload)
            counts = np.frombuffer(payload, self._counts, -1, SAMPLES.size).reshape(self._shape)
            return Samples(first, counts, flags, dropped, clock_us, sequence)
        if kind == Type.OUTPUT and size == self._output_size:
            _, _, sequence, first = OUTPUT.unpack_from(payload)
            return Output(first, np.frombuffer(payload, self._counts, -1, OUTPUT.size), sequence)
        if kind == Type.REQUEST and size == COMMAND.size:
            return Request(*COMMAND.unpack(payload)[3:])
        if kind == Type.ANSWER and size == COMMAND.size:
            return Answer(*COMMAND.unpack(payload)[3:])
        if kind == Type.HEARTBEAT and size == HEARTBEAT.size:
            _, _, _, state, boot, flags, dropped, samples = HEARTBEAT.unpack(payload)
            return Heartbeat(state, flags, boot, samples, dropped)
        if kind == Type.EMERGENCY_STOP and size == STOP.size:
            return EmergencyStop(STOP.unpack(payload)[3])
        raise Malformed(f"type {kind} with {size} bytes")

    def _check(self, counts: np.ndarray, shape: tuple[int, ...]) -> None:
        if not self._samples_size:
            raise DaqRefused("samples and outputs are sent once their shape has been agreed on (configure)")
        if counts.shape != shape:
            raise DaqRefused(f"counts of shape {counts.shape}: allowed is {shape}, the stream agreed on")

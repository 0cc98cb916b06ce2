"""Messages as bytes: a header of four bytes, a body of fixed form, all little-endian; see ``docs/wire-protocol.md``."""

import struct

import numpy as np

from rig.errors import DaqRefused
from rig.wire.messages import VERSION, Answer, EmergencyStop, Heartbeat, Message, Output, Request, Samples, Stream

__all__ = ["HEARTBEAT_BODY", "LARGEST_PAYLOAD", "Codec", "Damaged", "ForeignVersion", "Malformed", "Oversize"]

LARGEST_PAYLOAD = 65_536
"""Bytes of the largest header and body, whatever the stream: what bounds a receiver's memory."""


REQUEST, ANSWER, SAMPLES, OUTPUT, HEARTBEAT, EMERGENCY_STOP = range(1, 7)  # second byte of a payload
LASTING = (REQUEST, ANSWER, EMERGENCY_STOP)  # the same in every version, so that versions can be agreed on

HEADER_SIZE = 4  # version, type, sequence: the first three fields of each of these
COMMAND = struct.Struct("<BBHBBBBI")  # number; command or status; parameter; item; value
SAMPLES_HEAD = struct.Struct("<BBHQQIHxx")  # first; clock_us; dropped; flags; two zeros that align the counts
OUTPUT_HEAD = struct.Struct("<BBHQ")  # first
HEARTBEAT_BODY = struct.Struct("<BBHBBHII")  # state; boot; flags; dropped; samples
STOP = struct.Struct("<BBHB")  # reason

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
        return SAMPLES_HEAD.size + width * stream.block * stream.n_channels, OUTPUT_HEAD.size + width * stream.block

    def encode(self, message: Message) -> bytes:
        """The payload of a message; counts must have the shape agreed on."""
        if isinstance(message, Samples):
            first, counts, flags, dropped, clock_us, sequence = message
            data = self._bytes_of(counts, self._shape)
            head = (VERSION, SAMPLES, sequence & 0xFFFF, first, clock_us, min(dropped, MOST_DROPPED), flags)
            return SAMPLES_HEAD.pack(*head) + data
        if isinstance(message, Output):
            first, counts, sequence = message
            data = self._bytes_of(counts, self._shape[:1])
            return OUTPUT_HEAD.pack(VERSION, OUTPUT, sequence & 0xFFFF, first) + data
        if isinstance(message, Request):
            return COMMAND.pack(VERSION, REQUEST, 0, *message)
        if isinstance(message, Answer):
            return COMMAND.pack(VERSION, ANSWER, 0, *message)
        if isinstance(message, Heartbeat):
            state, flags, boot, samples, dropped = message
            dropped = min(dropped, MOST_DROPPED)
            return HEARTBEAT_BODY.pack(VERSION, HEARTBEAT, 0, state, boot & 0xFF, flags, dropped, samples & 0xFFFFFFFF)
        return STOP.pack(VERSION, EMERGENCY_STOP, 0, message.reason)

    def decode(self, payload: bytes) -> Message:
        """The message of a payload; counts are views of its bytes. Raises `Malformed`, and nothing else."""
        size = len(payload)
        if size < HEADER_SIZE:
            raise Malformed(f"{size} bytes")
        version, kind = payload[0], payload[1]
        if version != VERSION and kind not in LASTING:
            raise ForeignVersion(f"version {version}")
        if kind == SAMPLES and size == self._samples_size:
            _, _, sequence, first, clock_us, dropped, flags = SAMPLES_HEAD.unpack_from(payload)
            counts = np.frombuffer(payload, self._counts, -1, SAMPLES_HEAD.size).reshape(self._shape)
            return Samples(first, counts, flags, dropped, clock_us, sequence)
        if kind == OUTPUT and size == self._output_size:
            _, _, sequence, first = OUTPUT_HEAD.unpack_from(payload)
            return Output(first, np.frombuffer(payload, self._counts, -1, OUTPUT_HEAD.size), sequence)
        if kind == REQUEST and size == COMMAND.size:
            return Request(*COMMAND.unpack(payload)[3:])
        if kind == ANSWER and size == COMMAND.size:
            return Answer(*COMMAND.unpack(payload)[3:])
        if kind == HEARTBEAT and size == HEARTBEAT_BODY.size:
            _, _, _, state, boot, flags, dropped, samples = HEARTBEAT_BODY.unpack(payload)
            return Heartbeat(state, flags, boot, samples, dropped)
        if kind == EMERGENCY_STOP and size == STOP.size:
            return EmergencyStop(STOP.unpack(payload)[3])
        raise Malformed(f"type {kind} with {size} bytes")

    def _bytes_of(self, counts: np.ndarray, shape: tuple[int, ...]) -> bytes:
        if not self._samples_size:
            raise DaqRefused("samples and outputs are sent once their shape has been agreed on (configure)")
        if counts.shape != shape:
            raise DaqRefused(f"counts of shape {counts.shape}: allowed is {shape}, the stream agreed on")
        if counts.dtype != self._counts:
            counts = counts.astype(self._counts)
        return counts.tobytes()

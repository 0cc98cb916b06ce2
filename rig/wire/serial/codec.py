"""Messages as bytes: a header of four bytes, a body of fixed form, little-endian; see ``docs/reference/wire-protocol.md``."""

import struct

import numpy as np

from rig.errors import DaqRefused
from rig.wire.loop_payloads import (
    LARGEST_PAYLOAD,
    MOST_DROPPED,
    RECORD,
    ROWS,
    STATE,
    LoopPayloads,
    Malformed,
    rows_bytes,
)
from rig.wire.messages import (
    LOWEST_VERSION,
    VERSION,
    Answer,
    EmergencyStop,
    Heartbeat,
    Message,
    Output,
    Readback,
    Request,
    Samples,
    Stream,
)

REQUEST, ANSWER, SAMPLES, OUTPUT, HEARTBEAT, EMERGENCY_STOP, READBACK = range(1, 8)
"""Second byte of a payload."""
LASTING = (REQUEST, ANSWER, EMERGENCY_STOP)  # the same in every version, so that versions can be agreed on

SPOKEN = range(LOWEST_VERSION, VERSION + 1)
"""Versions whose heartbeats are alike; a device that was reset begins with the lowest."""

HEADER_SIZE = 4  # version, type, sequence: the first three fields of each of these
COMMAND = struct.Struct("<BBHBBBBI")  # number; command or status; parameter; item; value
SAMPLES_HEAD = struct.Struct("<BBHQQIHxx")  # first; clock_us; dropped; flags; two zeros that align the counts
OUTPUT_HEAD = struct.Struct("<BBHQ")  # first
PERIODIC_HEAD = struct.Struct("<BBHQII")  # first; period; ramp: an output from version 2 on
READBACK_HEAD = struct.Struct("<BBHQ")  # first
HEARTBEAT_BODY = struct.Struct("<BBHBBHII")  # state; boot; flags; dropped; samples
STOP = struct.Struct("<BBHB")  # reason


class ForeignVersion(Malformed):
    """A message of another version of the protocol, whose form may differ."""

    counter = "foreign_versions"


class Damaged(Malformed):
    """A frame whose bytes changed on the way."""

    counter = "crc_errors"


class Oversize(Malformed):
    """More bytes without a zero than the longest frame has."""

    counter = "oversize_frames"


class Codec:
    """Messages to payloads and back; its only state is the version and the shape of the stream.

    So no payload depends on an earlier one.
    """

    def __init__(self) -> None:
        self.version = LOWEST_VERSION
        """Version in use: that of what is sent."""
        self._counts = np.dtype("<i2")
        self._shape, self._output_shape = (0, 0), (0,)
        self._samples_size = self._output_size = self._readback_size = 0  # of no payload: none before `configure`
        self._loop = LoopPayloads()

    def configure(self, stream: Stream) -> None:
        """Agree on the shape of blocks.

        Raises `DaqRefused` for counts other than 16 or 32 bits and for blocks that no frame holds.
        """
        DaqRefused.raise_if(stream.bits not in (16, 32), f"counts of {stream.bits} bits: allowed is 16 or 32")
        samples_size, output_size, readback_size = self.sizes(stream, self.version)
        if samples_size > LARGEST_PAYLOAD:
            raise DaqRefused(
                f"a block of {stream.block} samples of {stream.n_channels} channels takes {samples_size} bytes: "
                f"allowed is {LARGEST_PAYLOAD}; ask for a smaller block"
            )
        self._counts = np.dtype(f"<i{stream.bits // 8}")
        self._shape, self._output_shape = (stream.block, stream.n_channels), (stream.block,)
        self._samples_size, self._output_size, self._readback_size = samples_size, output_size, readback_size
        self._loop.configure(stream, self.version)

    @staticmethod
    def sizes(stream: Stream, version: int) -> tuple[int, int, int]:
        """Bytes of the payload of one block of samples or rows, of outputs, and of a readback; 0 where a version has none."""
        width = stream.bits // 8
        samples = SAMPLES_HEAD.size + width * stream.block * stream.n_channels
        if stream.loop and version > LOWEST_VERSION:
            samples = rows_bytes(stream.n_channels, stream.block)
        if version == LOWEST_VERSION:
            return samples, OUTPUT_HEAD.size + width * stream.block, 0
        return samples, PERIODIC_HEAD.size + width * stream.block, READBACK_HEAD.size + width * stream.block

    @staticmethod
    def largest_block(n_channels: int, bits: int) -> int:
        """Samples of the largest block that one payload holds."""
        return (LARGEST_PAYLOAD - SAMPLES_HEAD.size) // (bits // 8 * n_channels)

    def encode(self, message: Message) -> bytes:
        """The payload of a message; counts must have the shape agreed on."""
        if message.__class__ is Samples:
            first, counts, flags, dropped, clock_us, sequence = message
            if counts.shape != self._shape or counts.dtype is not self._counts:
                counts = self._fitted(counts, self._shape)
            if dropped > MOST_DROPPED:
                dropped = MOST_DROPPED
            head = SAMPLES_HEAD.pack(self.version, SAMPLES, sequence & 0xFFFF, first, clock_us, dropped, flags)
            return head + counts.tobytes()
        version = self.version
        if isinstance(message, Output | Readback):
            kind, form = OUTPUT, OUTPUT_HEAD
            rest: tuple[int, ...] = ()
            if isinstance(message, Readback):
                kind, form = READBACK, READBACK_HEAD
                DaqRefused.raise_if(version == LOWEST_VERSION, "a readback is sent in version 2 of the protocol")
            elif version > LOWEST_VERSION:
                form, rest = PERIODIC_HEAD, (message.period, message.ramp)
            data = form.pack(version, kind, message.sequence & 0xFFFF, message.first, *rest)
            return data + self._fitted(message.counts, self._output_shape).tobytes()
        if isinstance(message, Request | Answer):
            return COMMAND.pack(version, REQUEST if isinstance(message, Request) else ANSWER, 0, *message)
        if isinstance(message, Heartbeat):
            state, flags, boot, samples, dropped = message
            dropped = min(dropped, MOST_DROPPED)
            return HEARTBEAT_BODY.pack(version, HEARTBEAT, 0, state, boot & 0xFF, flags, dropped, samples & 0xFFFFFFFF)
        if isinstance(message, EmergencyStop):
            return STOP.pack(version, EMERGENCY_STOP, 0, message.reason)
        return self._loop.encode(message, version)

    def decode(self, payload: bytes) -> Message:
        """Decode a payload into a message. Arrays of counts are views of the payload, not copies. Raises only `Malformed`."""
        size = len(payload)
        if size < HEADER_SIZE:
            raise Malformed(f"{size} bytes")
        version, kind = payload[0], payload[1]
        if version != self.version and kind not in LASTING and not (kind == HEARTBEAT and version in SPOKEN):
            raise ForeignVersion(f"version {version}")
        if kind == SAMPLES and size == self._samples_size and not self._loop.rows_size:
            _, _, sequence, first, clock_us, dropped, flags = SAMPLES_HEAD.unpack_from(payload)
            counts = np.ndarray(self._shape, self._counts, payload, SAMPLES_HEAD.size)
            return Samples(first, counts, flags, dropped, clock_us, sequence)
        if kind in (RECORD, STATE, ROWS) and version > LOWEST_VERSION:
            return self._loop.decode(payload)
        if kind == OUTPUT and size == self._output_size:
            head = PERIODIC_HEAD if self._readback_size else OUTPUT_HEAD  # of the version agreed on with the stream
            _, _, sequence, first, *goes_on = head.unpack_from(payload)
            return Output(first, np.ndarray(self._output_shape, self._counts, payload, head.size), sequence, *goes_on)
        if kind == READBACK and size == self._readback_size and size:
            _, _, sequence, first = READBACK_HEAD.unpack_from(payload)
            return Readback(first, np.ndarray(self._output_shape, self._counts, payload, READBACK_HEAD.size), sequence)
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

    def _fitted(self, counts: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
        if counts.shape == shape and counts.dtype is self._counts and self._samples_size:
            return counts
        if not self._samples_size:
            raise DaqRefused("samples and outputs are sent once their shape has been agreed on (configure)")
        if counts.shape != shape:
            raise DaqRefused(f"counts of shape {counts.shape}: allowed is {shape}, the stream agreed on")
        return counts.astype(self._counts)

"""CAN frames to messages and back, for either end."""

import struct

import numpy as np

from rig.errors import DaqMismatch, DaqRefused
from rig.wire.can.frames import Frame, padded_length
from rig.wire.can.groups import Blocks
from rig.wire.can.protocol import Kind, Protocol
from rig.wire.messages import Answer, DeviceState, EmergencyStop, Heartbeat, Message, Output, Request, Samples, Stream

__all__ = ["COUNTERS", "CanCodec"]

COUNTERS = ("foreign_frames", "own_frames", "damaged_frames", "repeated_frames", "incomplete_blocks", "resynchronised")
"""What a codec counts: frames of others, our own come back, of a wrong length, come twice; torn blocks; indices put right."""

_LARGEST_DROPPED = 255
_COUNT = np.dtype("<i2")


class CanCodec:
    """One end of the protocol on a bus: `encode` what it sends, `decode` what it receives.

    ``device`` is whether this is the device's end: samples go out and outputs come in. Streams need `configure` first.
    """

    def __init__(self, protocol: Protocol, device: bool, counters: dict[str, int]) -> None:
        self.protocol = protocol
        self._device = device
        self._shape = protocol.shape
        self._counters = counters
        counters.update(dict.fromkeys(COUNTERS, 0))
        self._kinds = protocol.kinds
        self._identifiers = protocol.identifiers
        self._command = protocol.packing(Kind.REQUEST)
        self._beat = protocol.packing(Kind.HEARTBEAT)
        self._index = protocol.packing(Kind.OUTPUT_INDEX)
        self._stream: Stream | None = None
        self._last_beat: Heartbeat | None = None
        self._flags_told = 0

    def check(self, stream: Stream) -> None:
        """Raise `DaqRefused` for a block or a resolution that frames cannot carry, `DaqMismatch` for other channels."""
        shape = self._shape
        if stream.n_channels != shape.n_channels:
            raise DaqMismatch(f"{stream.n_channels} channels, but the bus is defined for {shape.n_channels}")
        if stream.bits != 16:
            raise DaqRefused(f"counts of {stream.bits} bits: allowed over CAN is 16")
        if not 1 <= stream.block <= shape.largest_block:
            raise DaqRefused(
                f"block = {stream.block}: allowed over {'CAN FD' if shape.fd else 'classical CAN'} with "
                f"{shape.n_channels} channels is 1 to {shape.largest_block} samples"
            )

    def configure(self, stream: Stream) -> None:
        """Agree on the shape of samples and outputs; both begin anew. Errors: those of `check`."""
        self.check(stream)
        shape = self._shape
        self._stream = stream
        self._flags, self._dropped = 0, 0
        self._reported = -(1 << 30)  # group at which the receiver was last told its index
        # Whole blocks, so that a loss of a whole wrap cannot make one block of the frames of two.
        self._sample_groups = -(-stream.block // shape.rows)
        self._sample_wrap = shape.wrap - shape.wrap % self._sample_groups
        self._output_groups = -(-stream.block // shape.output_rows)
        self._output_wrap = shape.output_wrap - shape.output_wrap % self._output_groups
        if self._device:
            self._incoming = Blocks(self._counters, self._output_wrap, 1, shape.output_rows, stream.block, 1)
            self._incoming.begin(stream.queue)
        else:
            self._incoming = Blocks(
                self._counters, self._sample_wrap, shape.parts, shape.rows, stream.block, shape.n_channels
            )

    def encode(self, message: Message) -> list[Frame]:
        """The frames of a message, in the order in which they must be sent."""
        if isinstance(message, Samples):
            return self._encode_samples(message)
        if isinstance(message, Output):
            return self._encode_output(message)
        if isinstance(message, Request | Answer):
            kind = Kind.REQUEST if isinstance(message, Request) else Kind.ANSWER
            return [Frame(self._identifiers[kind, 0], self._command.pack(*message))]
        if isinstance(message, Heartbeat):
            self._last_beat = message
            return [self._heartbeat(message)]
        return [Frame(self._identifiers[Kind.EMERGENCY_STOP, 0], bytes((message.reason & 0xFF,)))]

    def _heartbeat(self, beat: Heartbeat) -> Frame:
        dropped = min(beat.dropped, _LARGEST_DROPPED)
        data = self._beat.pack(beat.state, beat.flags & 0xFF, beat.boot & 0xFF, dropped, beat.samples & 0xFFFFFFFF)
        self._flags_told = beat.flags
        return Frame(self._identifiers[Kind.HEARTBEAT, 0], data)

    def _encode_samples(self, message: Samples) -> list[Frame]:
        stream, shape, groups, wrap = self._streaming(), self._shape, self._sample_groups, self._sample_wrap
        first = message.first // stream.block * groups
        frames = []
        beat = self._last_beat
        stale = first + groups - self._reported > wrap // 2
        if beat is not None and (stale or (not shape.fd and message.flags != self._flags_told)):
            frames.append(
                self._heartbeat(beat._replace(flags=message.flags, samples=message.first, dropped=message.dropped))
            )
            self._reported = first
        for group in range(groups):
            rows = message.counts[group * shape.rows : (group + 1) * shape.rows]
            sequence = (first + group) % wrap
            for part in range(shape.parts):
                counts = rows if shape.parts == 1 else rows[:, shape.columns(part)]
                number = part if shape.fd else sequence * shape.parts + part
                frames.append(self._stream_frame(Kind.SAMPLES, number, sequence, message.flags, counts))
        return frames

    def _encode_output(self, message: Output) -> list[Frame]:
        stream, shape, groups, wrap = self._streaming(), self._shape, self._output_groups, self._output_wrap
        first = message.first // stream.block * groups
        frames = []
        if first + groups - self._reported > wrap // 2:
            frames.append(Frame(self._identifiers[Kind.OUTPUT_INDEX, 0], self._index.pack(message.first & 0xFFFFFFFF)))
            self._reported = first
        for group in range(groups):
            sequence = (first + group) % wrap
            counts = message.counts[group * shape.output_rows : (group + 1) * shape.output_rows]
            frames.append(self._stream_frame(Kind.OUTPUT, 0 if shape.fd else sequence, sequence, 0, counts))
        return frames

    def _stream_frame(self, kind: Kind, number: int, sequence: int, flags: int, counts: np.ndarray) -> Frame:
        data = counts.astype(_COUNT, copy=False).tobytes()
        if not self._shape.fd:
            return Frame(self._identifiers[kind, number], data)
        data = bytes((sequence, flags & 0xFF)) + data
        return Frame(self._identifiers[kind, number], data.ljust(padded_length(len(data)), b"\0"), True)

    def decode(self, frame: Frame) -> Message | None:
        """The message that a frame completes, if any; frames that are none of ours are counted and dropped."""
        known = None if frame.extended else self._kinds.get(frame.identifier)
        if known is None:
            self._counters["foreign_frames"] += 1
            return None
        kind, number = known
        if kind is Kind.EMERGENCY_STOP:  # of any length, and rather once too often than too seldom
            return EmergencyStop(frame.data[0] if frame.data else 0)
        if kind is (Kind.OUTPUT if self._device else Kind.SAMPLES):
            return self._decode_stream(frame, number)
        try:
            return self._decode_command(kind, frame.data)
        except struct.error:
            self._counters["damaged_frames"] += 1
            return None

    def _decode_command(self, kind: Kind, data: bytes) -> Message | None:
        if self._device:
            if kind is Kind.REQUEST:
                return Request(*self._command.unpack(data))
            if kind is Kind.OUTPUT_INDEX and self._stream is not None:
                self._incoming.mark(self._index.unpack(data)[0])
                return None
        elif kind is Kind.ANSWER:
            return Answer(*self._command.unpack(data))
        elif kind is Kind.HEARTBEAT:
            state, flags, boot, dropped, samples = self._beat.unpack(data)
            self._flags, self._dropped = flags, dropped
            if self._stream is not None and state != DeviceState.IDLE:
                self._incoming.mark(samples)
            return Heartbeat(state, flags, boot, samples, dropped)
        self._counters["own_frames"] += 1  # some buses return what one sends
        return None

    def _decode_stream(self, frame: Frame, number: int) -> Message | None:
        shape, data = self._shape, frame.data
        if self._stream is None or frame.fd != shape.fd or len(data) < shape.header:
            self._counters["damaged_frames" if self._stream else "foreign_frames"] += 1
            return None
        if shape.fd:
            sequence, flags, part = data[0], data[1], number
        else:
            sequence, part = (number, 0) if self._device else divmod(number, shape.parts)
            flags = self._flags if not self._device else 0
        columns = slice(0, 1) if self._device else shape.columns(part)
        width = columns.stop - columns.start
        rows = self._incoming.rows_of(sequence)
        n_bytes = shape.header + 2 * rows * width
        if len(data) != (padded_length(n_bytes) if shape.fd else n_bytes):
            self._counters["damaged_frames"] += 1
            return None
        counts = np.frombuffer(data, _COUNT, rows * width, shape.header).reshape(rows, width)
        whole = self._incoming.put(sequence, part, columns, counts, flags)
        return None if whole is None else self._block(*whole)

    def _block(self, block: int, counts: np.ndarray, flags: int) -> Message:
        assert self._stream is not None
        first = block * self._stream.block
        if self._device:
            return Output(first, counts[:, 0], block * self._output_groups % self._output_wrap)
        return Samples(first, counts, flags, self._dropped, 0, block * self._sample_groups % self._sample_wrap)

    def _streaming(self) -> Stream:
        if self._stream is None:
            raise DaqRefused("samples and outputs cannot be sent before the stream is configured")
        return self._stream

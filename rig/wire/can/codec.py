"""CAN frames to messages and back, for either end."""

import struct

import numpy as np

from rig.errors import DaqRefused
from rig.wire.can.blocks import Blocks, StreamFrames, check_stream
from rig.wire.can.frames import Frame
from rig.wire.can.loop_frames import LoopFrames
from rig.wire.can.periods import PeriodsHeard, PeriodsTold
from rig.wire.can.protocol import FrameKind, Protocol
from rig.wire.can.readbacks import COUNT, Readbacks
from rig.wire.messages import (
    LOWEST_VERSION,
    Answer,
    DeviceState,
    EmergencyStop,
    Heartbeat,
    Message,
    Output,
    Readback,
    Record,
    Request,
    Rows,
    Samples,
    State,
    Stream,
)

COUNTERS = (
    *("foreign_frames", "own_frames", "damaged_frames", "repeated_frames"),
    *("out_of_order_frames", "late_frames", "incomplete_blocks", "resynchronised"),
)
"""Counters of a codec: foreign frames, own frames returned, wrong lengths, frames that come twice or after their block was
given up, frames that come after a later one and those of them whose block was given up, torn blocks, corrected indices."""

_LARGEST_DROPPED = 255  # samples: a heartbeat has one byte for them
_NEVER = -(1 << 30)  # group before all others


class CanCodec:
    """One end of the protocol on a bus: `encode` what it sends, `decode` what it receives.

    ``device``: this is the device's end, which sends samples and receives outputs. It begins with version 1; streams need
    `configure` first.
    """

    def __init__(self, protocol: Protocol, device: bool, counters: dict[str, int]) -> None:
        self._latest = protocol
        self._device = device
        self._shape = protocol.shape
        self._counters = counters
        counters.update(dict.fromkeys(COUNTERS, 0))
        self._loop: LoopFrames | None = None
        if protocol.carries_rows:
            records, states, rows = (protocol.identifiers[FrameKind.OF_LOOP, number] for number in range(3))
            self._loop = LoopFrames((records, states, rows), counters)
        self.speak(LOWEST_VERSION)
        self._command = protocol.packing(FrameKind.REQUEST)
        self._beat = protocol.packing(FrameKind.HEARTBEAT)
        self._index = protocol.packing(FrameKind.OUTPUT_INDEX)
        self._period = struct.Struct("<II")
        self._stream: Stream | None = None
        self._continues = False  # whether the stream is one of version 2
        self._last_beat: Heartbeat | None = None
        self._flags_told = 0

    def speak(self, version: int) -> None:
        """Use a version of the protocol from now on, before `configure`."""
        self.protocol = self._latest.speaking(version)
        self._kinds, self._identifiers = self.protocol.kinds, self.protocol.identifiers

    def configure(self, stream: Stream) -> None:
        """Set the shape of samples and outputs; both start at index 0. Errors: those of `check_stream`."""
        if stream.loop and self._loop is not None:
            self._loop.configure(stream, self.protocol.version)
            self._stream = None  # there are no samples and no outputs
            return
        check_stream(self._shape, stream)
        self._stream = stream
        self._flags, self._dropped = 0, 0
        self._reported = _NEVER  # group whose index the receiver was told last
        samples, outputs = (
            StreamFrames(self.protocol, kind, stream.block) for kind in (FrameKind.SAMPLES, FrameKind.OUTPUT)
        )
        self._sent, self._received = (samples, outputs) if self._device else (outputs, samples)
        self._incoming = Blocks(self._counters, self._received)
        if self._device:
            self._incoming.begin(stream.queue)
        self._continues = self.protocol.version > LOWEST_VERSION
        if self._continues:
            self._told, self._heard = PeriodsTold(stream.rate_hz), PeriodsHeard()
            identifier = self._identifiers[FrameKind.READBACK, 0]
            self._readbacks, self._here = Readbacks(identifier, stream.block, self._shape.fd), 0

    def encode(self, message: Message) -> list[Frame]:
        """The frames of a message, in sending order."""
        if isinstance(message, Samples):
            return self._encode_samples(message)
        if isinstance(message, Output):
            return self._encode_output(message)
        if isinstance(message, Readback):
            self._streaming()
            DaqRefused.raise_if(not self._continues, "a readback is sent in version 2 of the protocol")
            return self._readbacks.frames(message.first, message.counts)
        if isinstance(message, Request | Answer):
            kind = FrameKind.REQUEST if isinstance(message, Request) else FrameKind.ANSWER
            return [Frame(self._identifiers[kind, 0], self._command.pack(*message))]
        if isinstance(message, Heartbeat):
            self._last_beat = message
            return [self._heartbeat(message)]
        if isinstance(message, EmergencyStop):
            return [Frame(self._identifiers[FrameKind.EMERGENCY_STOP, 0], bytes((message.reason & 0xFF,)))]
        if isinstance(message, Record | State | Rows) and self._loop is not None:
            return self._loop.encode(message, self.protocol.version)
        raise DaqRefused("this bus has no frames for a loop on the device")

    def _heartbeat(self, beat: Heartbeat) -> Frame:
        dropped = min(beat.dropped, _LARGEST_DROPPED)
        data = self._beat.pack(beat.state, beat.flags & 0xFF, beat.boot & 0xFF, dropped, beat.samples & 0xFFFFFFFF)
        self._flags_told = beat.flags
        return Frame(self._identifiers[FrameKind.HEARTBEAT, 0], data)

    def _encode_samples(self, message: Samples) -> list[Frame]:
        frames = self._streaming().frames(message.first, message.counts, message.flags)
        beat, tells = self._last_beat, not self._shape.fd and message.flags != self._flags_told
        if beat is not None and (self._must_tell(message.first) or tells):
            self._reported = message.first // self._sent.block * self._sent.groups
            now = beat._replace(flags=message.flags, samples=message.first, dropped=message.dropped)
            return [self._heartbeat(now), *frames]
        return frames

    def _encode_output(self, message: Output) -> list[Frame]:
        frames = self._streaming().frames(message.first, message.counts, 0)
        if self._continues and self._told.must_tell(message.first, message.period, message.ramp):
            data = self._period.pack(message.period, message.ramp)
            frames = [Frame(self._identifiers[FrameKind.OUTPUT_PERIOD, 0], data), *frames]
        if self._must_tell(message.first):
            self._reported = message.first // self._sent.block * self._sent.groups
            data = self._index.pack(message.first & 0xFFFFFFFF)
            return [Frame(self._identifiers[FrameKind.OUTPUT_INDEX, 0], data), *frames]
        return frames

    def forget_told(self) -> None:
        """Note that frames of an output were not sent: what they told may not have arrived."""
        if self._continues:
            self._told.forget()

    def _must_tell(self, first: int) -> bool:
        """Whether a block would end more than half a wrap after the last index that the receiver was told."""
        sent = self._sent
        return (first // sent.block + 1) * sent.groups - self._reported > sent.wrap // 2

    def decode(self, frame: Frame) -> Message | None:
        """Return the message that a frame completes, if any. Foreign frames are counted and dropped."""
        known = None if frame.extended else self._kinds.get(frame.identifier)
        if known is None:
            self._counters["foreign_frames"] += 1
            return None
        kind, number = known
        if kind is FrameKind.EMERGENCY_STOP:  # accepted with any length: a false stop is safer than a missed one
            return EmergencyStop(frame.data[0] if frame.data else 0)
        if kind is (FrameKind.OUTPUT if self._device else FrameKind.SAMPLES):
            return self._decode_stream(frame, number)
        try:
            if kind is FrameKind.READBACK and not self._device:
                return self._decode_readback(frame)
            if kind is FrameKind.OF_LOOP and self._loop is not None:
                return self._loop.decode(frame, frame.identifier)
            return self._decode_command(kind, frame.data)
        except (struct.error, ValueError):
            self._counters["damaged_frames"] += 1
            return None

    def _decode_command(self, kind: FrameKind, data: bytes) -> Message | None:
        if self._device:
            if kind is FrameKind.REQUEST:
                return Request(*self._command.unpack(data))
            if kind is FrameKind.OUTPUT_INDEX and self._stream is not None:
                self._incoming.mark(self._index.unpack(data)[0])
                return None
            if kind is FrameKind.OUTPUT_PERIOD and self._continues:
                self._heard.hear(*self._period.unpack(data))
                return None
        elif kind is FrameKind.ANSWER:
            return Answer(*self._command.unpack(data))
        elif kind is FrameKind.HEARTBEAT:
            state, flags, boot, dropped, samples = self._beat.unpack(data)
            self._flags, self._dropped = flags, dropped
            if self._stream is not None and state != DeviceState.IDLE:
                self._incoming.mark(samples)
            return Heartbeat(state, flags, boot, samples, dropped)
        self._counters["own_frames"] += 1  # some buses return the frames that one sends
        return None

    def _decode_readback(self, frame: Frame) -> Readback | None:
        if not self._continues:
            self._counters["foreign_frames"] += 1
            return None
        whole = self._readbacks.put(frame, self._here)
        return None if whole is None else Readback(*whole, self._received.sequence_of(whole[0]))

    def _decode_stream(self, frame: Frame, number: int) -> Message | None:
        if self._stream is None:
            self._counters["foreign_frames"] += 1
            return None
        received, incoming, data = self._received, self._incoming, frame.data
        if frame.fd != received.fd or len(data) < received.header:
            self._counters["damaged_frames"] += 1
            return None
        if received.fd:
            sequence, flags, part = data[0], data[1], number
        else:
            sequence, part = divmod(number, received.parts)
            flags = self._flags
        group = incoming.group(sequence)
        piece = received.pieces[group % received.groups][part]
        if len(data) != piece.n_bytes:
            self._counters["damaged_frames"] += 1
            return None
        counts = np.frombuffer(data, COUNT, piece.size, received.header).reshape(piece.shape)
        whole = incoming.put(group, part, piece, counts, flags)
        return None if whole is None else self._block(*whole)

    def _block(self, block: int, counts: np.ndarray, flags: int) -> Message:
        first = block * self._received.block
        sequence = self._received.sequence_of(first)
        if self._device:
            goes_on = self._heard.of(first) if self._continues else (0, 0)
            return Output(first, counts[:, 0], sequence, *goes_on)
        self._here = first + self._received.block
        return Samples(first, counts, flags, self._dropped, 0, sequence)

    def _streaming(self) -> StreamFrames:
        if self._stream is None:
            raise DaqRefused("samples and outputs cannot be sent before the stream is configured")
        return self._sent

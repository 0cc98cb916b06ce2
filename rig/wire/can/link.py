"""`CanLink`: one end of the protocol on a bus, and what a stream asks of the bus."""

import time
from pathlib import Path
from typing import NamedTuple

from rig.wire.can.blocks import check_stream, pieces_of
from rig.wire.can.bus import FrameBus
from rig.wire.can.codec import CanCodec
from rig.wire.can.frames import BusTiming, frame_seconds
from rig.wire.can.loop_frames import lengths_of_rows
from rig.wire.can.periods import TOLD_EVERY_S
from rig.wire.can.protocol import Shape, protocol
from rig.wire.can.readbacks import Readbacks
from rig.wire.link import LATE_SHARE, Link, Load
from rig.wire.loop_payloads import ROWS_HEAD, rows_bytes
from rig.wire.messages import (
    HEARTBEATS_HZ,
    LOOP_PINGS_HZ,
    LOWEST_VERSION,
    VERSION,
    Message,
    Output,
    Readback,
    Samples,
    Stream,
)


class Traffic(NamedTuple):
    """Frames of one kind."""

    name: str
    frames_hz: float
    share: float
    """Of the bus's time."""


def traffic(
    shape: Shape, stream: Stream, bit_rate_hz: float, data_bit_rate_hz: float, version: int = VERSION
) -> list[Traffic]:
    """Samples, outputs, heartbeats and output indices of a stream; from version 2 on also periods and readbacks.

    Periods are told as often as they may be, and one block in twenty is counted as late, with its readback. With the loop on
    the device: rows, states, heartbeats and pings.
    """
    blocks_hz = stream.rate_hz / stream.block

    def seconds(lengths: list[int]) -> float:
        return sum(frame_seconds(length, shape.fd, bit_rate_hz, data_bit_rate_hz) for length in lengths)

    if stream.loop:
        rows, state = lengths_of_rows(stream)
        told = [("rows", blocks_hz, rows), ("states", stream.states_hz, state)]
        small = (("heartbeats", HEARTBEATS_HZ), ("pings and their answers", 2 * LOOP_PINGS_HZ))
        return [
            *(Traffic(name, hz * len(lengths), hz * seconds(lengths)) for name, hz, lengths in told),
            *(Traffic(name, hz, hz * frame_seconds(8, False, bit_rate_hz)) for name, hz in small),
        ]

    out, marks_hz = [], []
    for name, outputs, wrap in (("samples", False, shape.wrap), ("outputs", True, shape.output_wrap)):
        pieces = pieces_of(shape, stream.block, outputs)
        lengths = [piece.n_bytes for group in pieces for piece in group]
        out.append(Traffic(name, blocks_hz * len(lengths), blocks_hz * seconds(lengths)))
        marks_hz.append(_marks_hz(blocks_hz, len(pieces), wrap))
    beats_hz = HEARTBEATS_HZ + marks_hz[0]
    out.append(Traffic("heartbeats", beats_hz, beats_hz * frame_seconds(8, False, bit_rate_hz)))
    out.append(Traffic("indices", marks_hz[1], marks_hz[1] * frame_seconds(4, False, bit_rate_hz)))
    if version > LOWEST_VERSION:
        periods_hz = min(blocks_hz, 1.0 / TOLD_EVERY_S)
        out.append(Traffic("periods", periods_hz, periods_hz * frame_seconds(8, False, bit_rate_hz)))
        lengths, late_hz = Readbacks(0, stream.block, shape.fd).lengths(), LATE_SHARE * blocks_hz
        out.append(Traffic("readbacks", late_hz * len(lengths), late_hz * seconds(lengths)))
    return out


def _marks_hz(blocks_hz: float, groups: int, wrap: int) -> float:
    """Rate of index messages: one with each block that would end more than half a wrap after the last message."""
    return blocks_hz / max((wrap - wrap % groups) // 2 // groups, 1)


def bus_load(shape: Shape, stream: Stream, bit_rate_hz: float, data_bit_rate_hz: float, version: int = VERSION) -> Load:
    """Load of the bus in bits of its bit rate; the faster bits of CAN FD count by their duration."""
    parts = traffic(shape, stream, bit_rate_hz, data_bit_rate_hz, version)
    share = sum(part.share for part in parts)
    terms = " + ".join(
        f"{part.name} {part.frames_hz:.0f}/s x {part.share / part.frames_hz * 1e6:.0f} us" for part in parts
    )
    rate = f"{bit_rate_hz / 1e6:g}" + (f"/{data_bit_rate_hz / 1e6:g}" if shape.fd else "") + " Mbit/s"
    text = f"{terms} = {share * 1e3:.0f} ms of every second on a bus of {rate}: {share:.0%}"
    return Load(share * bit_rate_hz, bit_rate_hz, text)


COMMAND_S = 0.1
"""How long a command may wait for the bus."""
SHORTEST_DEADLINE_S = 0.005  # s in which samples and outputs must be sent, at least; chosen: some frames of others
_FRAMES_A_CALL = 256  # bounds a call with a time-out of 0 on a bus full of foreign frames


class CanLink(Link):
    """The protocol on a bus, for a number of channels and a node.

    Samples and outputs that cannot be sent within the duration of a block are dropped and counted ("expired_frames"). The link
    does not notice two devices with the same node; `rig.drivers.wire.dialogue.Dialogue` does.
    """

    def __init__(
        self,
        bus: FrameBus,
        n_channels: int,
        timing: BusTiming = BusTiming(),  # noqa: B008 (a tuple)
        node: int = 1,
        dbc: str | Path | None = None,
        device: bool = False,
    ) -> None:
        super().__init__(f"{bus.name}, node {node}")
        self._bus = bus
        self._protocol = protocol(n_channels, timing.fd, node, dbc)
        self.counters = bus.counters
        self._codec = CanCodec(self._protocol, device, self.counters)
        self._rates_hz = timing.bit_rate_hz, timing.data_bit_rate_hz
        self._deadline_s = COMMAND_S

    def open(self) -> None:
        """Open the bus."""
        self._bus.open()

    def speak(self, version: int) -> None:
        """Use a version of the protocol from now on."""
        super().speak(version)
        self._codec.speak(version)

    @property
    def highest_version(self) -> int:
        """Version of the definition."""
        return self._protocol.version

    def configure(self, stream: Stream) -> None:
        """Agree on the stream; `DaqRefused` for a block that the frames' sequence numbers cannot tell apart."""
        self._codec.configure(stream)
        self._deadline_s = max(stream.block / stream.rate_hz, SHORTEST_DEADLINE_S)

    def send(self, message: Message) -> None:
        """Send one message; one that cannot be sent in time is dropped, because it would be out of date."""
        left_s = self._deadline_s if isinstance(message, Samples | Output | Readback) else COMMAND_S
        frames = self._codec.encode(message)
        if len(frames) == 1:
            if not self._bus.send(frames[0], left_s):
                self._codec.forget_told()
            return
        deadline = time.monotonic() + left_s
        for frame in frames:
            if not self._bus.send(frame, max(deadline - time.monotonic(), 0.0)):
                self._codec.forget_told()
                return  # the rest of an incomplete block is useless

    def receive(self, timeout_s: float) -> Message | None:
        """The next message."""
        deadline = time.monotonic() + timeout_s
        wait_s = timeout_s
        for _ in range(_FRAMES_A_CALL):
            frame = self._bus.receive(wait_s)
            if frame is not None:
                message = self._codec.decode(frame)
                if message is not None:
                    return message
            wait_s = max(deadline - time.monotonic(), 0.0) if timeout_s else 0.0
            if frame is None and wait_s == 0.0:
                return None
        return None

    def load(self, stream: Stream) -> Load:
        """Both directions, with worst-case stuffing, heartbeats and indices.

        Raises `DaqRefused` for a stream that no frames can carry, however fast the bus.
        """
        if not stream.loop:
            check_stream(self._protocol.shape, stream)
        return bus_load(self._protocol.shape, stream, *self._rates_hz, self.version)

    def why_no_rows(self, stream: Stream) -> str:
        """With the sum of the rows' bits where the bus is a classical one."""
        if self._protocol.carries_rows:
            return ""
        if self._protocol.shape.fd:
            return (
                f"{self.name}: its definition of frames (driver.options.dbc) leaves no identifiers for rows of a loop"
            )
        row = rows_bytes(stream.n_channels, 1) - ROWS_HEAD.size
        needed, rate = 8.0 * row * stream.rate_hz, self._rates_hz[0]
        return (
            f"{self.name}: a loop on the device needs CAN FD: its rows take {stream.rate_hz:g} Hz x {row} bytes = "
            f"{needed / 1e6:.2f} Mbit/s without what frames them, and this classical bus has {rate / 1e6:g} Mbit/s"
        )

    @property
    def layout_crc(self) -> int:
        """CRC-32 of the compiled definition in the version in use."""
        return self._codec.protocol.layout.crc

    @property
    def largest_block(self) -> int:
        """Largest number of samples in a block on this bus."""
        return self._protocol.shape.largest_block

    def close(self) -> None:
        """Close the bus."""
        self._bus.close()

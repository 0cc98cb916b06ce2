"""Blocks of samples as a device has sent them, over a line or a bus, with what they say was put out."""

import struct
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from rig.wire.can.blocks import StreamFrames
from rig.wire.can.protocol import FrameKind
from tests.firmware.events import Choice, Event, frame_of, protocol_of

HEAD = struct.Struct("<BBHQQIHH")
READBACK_HEAD = struct.Struct("<BBHQ")


class Rows(NamedTuple):
    """A block."""

    time_us: int
    first: int
    sequence: int
    clock_us: int
    dropped: int
    flags: int
    reserved: int
    counts: Any
    """[n, n_channels]"""
    readback: Any = None
    """[n]: what was put out, where an output was missing (version 2)."""

    def is_like(self, other: "Rows") -> bool:
        """Whether all but the counts is the same; times are rounded."""
        times = abs(self.time_us - other.time_us) <= 1 and abs(self.clock_us - other.clock_us) <= 1
        plain = {"time_us": 0, "clock_us": 0, "counts": None, "readback": None}
        return times and self._replace(**plain) == other._replace(**plain)


def rows_of_payload(time_us: int, payload: bytes, choice: Choice, before: bytes = b"") -> Rows:
    """The block of a payload on a serial line; ``before``: that of its readback, which came immediately before it."""
    _, _, sequence, first, clock_us, dropped, flags, reserved = HEAD.unpack_from(payload)
    counts = np.frombuffer(payload, f"<i{choice.bits // 8}", offset=HEAD.size).reshape(-1, choice.n_channels)
    readback = None
    if before:
        assert READBACK_HEAD.unpack_from(before)[2:] == (sequence, first)
        readback = np.frombuffer(before, f"<i{choice.bits // 8}", offset=READBACK_HEAD.size)
    return Rows(time_us, first, sequence, clock_us, dropped, flags, reserved, counts, readback)


class SamplesOnBus:
    """Puts blocks together again from frames of which none is lost."""

    def __init__(self, choice: Choice, block_of: Sequence[int]) -> None:
        self.rows: list[Rows] = []
        self._choice, self._block_of = choice, block_of
        self._protocol = protocol_of(choice.n_channels, choice.fd, choice.node)
        self._streams: dict[int, StreamFrames] = {}
        self._frames: list[Event] = []
        self._readback: list[Event] = []

    def take(self, event: Event) -> None:
        if len(self.rows) == len(self._block_of):
            raise AssertionError("a block more than was measured")
        block = self._block_of[len(self.rows)]
        if block not in self._streams:
            self._streams[block] = StreamFrames(self._protocol, FrameKind.SAMPLES, block)
        stream = self._streams[block]
        self._frames.append(event)
        if len(self._frames) == stream.groups * stream.parts:
            self.rows.append(self._joined(stream)._replace(readback=self._read_back(block)))
            self._frames, self._readback = [], []

    def take_readback(self, event: Event) -> None:
        """Take a frame of what was put out; they go before the samples of their block."""
        assert not self._frames, "a readback within its block"
        self._readback.append(event)

    def _read_back(self, block: int) -> np.ndarray | None:
        if not self._readback:
            return None
        rows, counts, indices = 31 if self._choice.fd else 3, [], []
        for at, event in enumerate(self._readback):
            frame = frame_of(event.data)
            n = min(rows, block - rows * at)
            indices.append(int.from_bytes(frame.data[:2], "little"))
            counts += list(struct.unpack_from(f"<{n}h", frame.data, 2))
            assert frame.identifier == 0x060 + self._choice.node
            assert (frame.fd, frame.data[2 + 2 * n :]) == (self._choice.fd, bytes(len(frame.data) - 2 - 2 * n))
            assert self._choice.fd or len(frame.data) == 8
        assert indices == [(indices[0] + rows * at) & 0xFFFF for at in range(len(indices))]
        return np.array(counts)

    def _joined(self, stream: StreamFrames) -> Rows:
        frames = [frame_of(event.data) for event in self._frames]
        counts = np.empty((stream.block, stream.n_channels), np.int16)
        header, pieces = stream.header, [piece for group in stream.pieces for piece in group]
        for frame, piece in zip(frames, pieces, strict=True):
            assert (frame.fd, len(frame.data)) == (stream.fd, piece.n_bytes)
            counts[piece.rows, piece.columns] = np.frombuffer(frame.data, "<i2", piece.size, header).reshape(
                piece.shape
            )
        number, flags = self._place(stream, frames)
        return Rows(self._frames[0].time_us, 0, number, 0, 0, flags, 0, counts)

    def _place(self, stream: StreamFrames, frames: list) -> tuple[int, int]:
        """Sequence number of the first frame, and flags; those of classical CAN are in heartbeats."""
        if not stream.fd:
            number = (frames[0].identifier - 0x300) // 16 // stream.parts
            expected = [0x300 + 16 * (number * stream.parts + at) + self._choice.node for at in range(len(frames))]
            assert [frame.identifier for frame in frames] == expected
            return number, 0
        sequences = [frame.data[0] for frame in frames]
        assert sequences == [sequences[0] + at // stream.parts for at in range(len(frames))]
        assert {frame.data[1] for frame in frames} == {frames[0].data[1]}
        return sequences[0], frames[0].data[1]

"""What a stream asks of a bus: every frame with its worst-case stuffing, both directions, for they share the wire."""

from typing import NamedTuple

from rig.wire.can.definition import Shape
from rig.wire.can.frames import frame_seconds, padded_length
from rig.wire.link import Load
from rig.wire.messages import HEARTBEATS_HZ, Stream

__all__ = ["Traffic", "bus_load", "frame_lengths", "traffic"]


class Traffic(NamedTuple):
    """Frames of one kind."""

    name: str
    frames_hz: float
    share: float
    """Of the bus's time."""


def frame_lengths(shape: Shape, block: int, outputs: bool) -> list[int]:
    """Bytes of every frame that a block takes, samples or outputs."""
    rows = shape.output_rows if outputs else shape.rows
    out = []
    for first in range(0, block, rows):
        for part in range(1 if outputs else shape.parts):
            columns = shape.columns(part)
            width = 1 if outputs else columns.stop - columns.start
            n_bytes = shape.header + 2 * width * min(rows, block - first)
            out.append(padded_length(n_bytes) if shape.fd else n_bytes)
    return out


def traffic(shape: Shape, stream: Stream, bit_rate_hz: float, data_bit_rate_hz: float) -> list[Traffic]:
    """Samples, outputs, heartbeats and output indices of a stream."""
    blocks_hz = stream.rate_hz / stream.block
    out = []
    for name, outputs in (("samples", False), ("outputs", True)):
        lengths = frame_lengths(shape, stream.block, outputs)
        seconds = sum(frame_seconds(length, shape.fd, bit_rate_hz, data_bit_rate_hz) for length in lengths)
        out.append(Traffic(name, blocks_hz * len(lengths), blocks_hz * seconds))
    groups, wrap = len(frame_lengths(shape, stream.block, False)) // shape.parts, shape.wrap
    beats_hz = HEARTBEATS_HZ + _marks_hz(blocks_hz, groups, wrap)
    out.append(Traffic("heartbeats", beats_hz, beats_hz * frame_seconds(8, False, bit_rate_hz)))
    marks_hz = _marks_hz(blocks_hz, len(frame_lengths(shape, stream.block, True)), shape.output_wrap)
    out.append(Traffic("indices", marks_hz, marks_hz * frame_seconds(4, False, bit_rate_hz)))
    return out


def _marks_hz(blocks_hz: float, groups: int, wrap: int) -> float:
    """How often the other end is told an index: with the first block that would end beyond half a wrap after the last one."""
    return blocks_hz / max((wrap - wrap % groups) // 2 // groups, 1)


def bus_load(shape: Shape, stream: Stream, bit_rate_hz: float, data_bit_rate_hz: float) -> Load:
    """The sum, in bits of the bit rate; CAN FD's faster bits are counted by the time they take."""
    parts = traffic(shape, stream, bit_rate_hz, data_bit_rate_hz)
    share = sum(part.share for part in parts)
    terms = " + ".join(
        f"{part.name} {part.frames_hz:.0f}/s x {part.share / part.frames_hz * 1e6:.0f} us" for part in parts
    )
    rate = f"{bit_rate_hz / 1e6:g}" + (f"/{data_bit_rate_hz / 1e6:g}" if shape.fd else "") + " Mbit/s"
    text = f"{terms} = {share * 1e3:.0f} ms of every second on a bus of {rate}: {share:.0%}"
    return Load(share * bit_rate_hz, bit_rate_hz, text)

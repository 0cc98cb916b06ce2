"""How blocks of samples or outputs are spread over frames, and put together again from frames that may be lost."""

from typing import NamedTuple

import numpy as np

from rig.errors import DaqMismatch, DaqRefused
from rig.wire.can.frames import Frame, padded_length
from rig.wire.can.protocol import FrameKind, Protocol, Shape
from rig.wire.can.readbacks import COUNT
from rig.wire.messages import Stream


def check_stream(shape: Shape, stream: Stream) -> None:
    """Raise `DaqRefused` for a block or a resolution that frames cannot carry, `DaqMismatch` for other channels."""
    if stream.n_channels != shape.n_channels:
        raise DaqMismatch(f"{stream.n_channels} channels, but the bus is defined for {shape.n_channels}")
    DaqRefused.raise_if(stream.bits != 16, f"counts of {stream.bits} bits: allowed over CAN is 16")
    if not 1 <= stream.block <= shape.largest_block:
        raise DaqRefused(
            f"allowed over {('CAN FD' if shape.fd else 'classical CAN')} with {shape.n_channels} channels is "
            f"1 to {shape.largest_block} samples",
            field="block",
            value=stream.block,
        )


class Piece(NamedTuple):
    """The part of a block that one frame carries."""

    rows: slice
    columns: slice
    shape: tuple[int, int]
    size: int
    """Counts."""
    n_bytes: int
    """Of the frame's data, with header and padding."""
    padding: bytes


def pieces_of(shape: Shape, block: int, outputs: bool) -> tuple[tuple[Piece, ...], ...]:
    """The frames of a block of samples or outputs, by group within the block and part."""
    height, columns = shape.rows, [shape.columns(part) for part in range(shape.parts)]
    if outputs:
        height, columns = shape.output_rows, [slice(0, 1)]
    out = []
    for first in range(0, block, height):
        rows = slice(first, min(first + height, block))
        group = []
        for column in columns:
            size = (rows.stop - first) * (column.stop - column.start)
            used = shape.header + 2 * size
            n_bytes = padded_length(used) if shape.fd else used
            counts = rows.stop - first, column.stop - column.start
            group.append(Piece(rows, column, counts, size, n_bytes, bytes(n_bytes - used)))
        out.append(tuple(group))
    return tuple(out)


class StreamFrames:
    """The frames of one direction, for blocks of one size: `rig.wire.can.protocol.Shape` worked out.

    The sequence numbers wrap after whole blocks, so that after a loss frames of two blocks are never combined to one.
    """

    def __init__(self, protocol: Protocol, kind: FrameKind, block: int) -> None:
        shape, outputs = protocol.shape, kind is FrameKind.OUTPUT
        self.fd, self.header = shape.fd, shape.header
        self.block = block
        self.n_channels = 1 if outputs else shape.n_channels
        self.pieces = pieces_of(shape, block, outputs)
        """By group within the block, and part."""
        self.parts = len(self.pieces[0])
        """Frames of a group."""
        self.groups = len(self.pieces)
        """Groups of a block."""
        wrap = shape.output_wrap if outputs else shape.wrap
        self.wrap = wrap - wrap % self.groups
        """Sequence numbers."""
        numbers = self.parts if self.fd else self.wrap * self.parts
        self._identifiers = tuple(protocol.identifiers[kind, number] for number in range(numbers))

    def sequence_of(self, first: int) -> int:
        """The sequence number with which the block from sample ``first`` on begins."""
        return first // self.block * self.groups % self.wrap

    def frames(self, first: int, counts: np.ndarray, flags: int) -> list[Frame]:
        """The frames of a block: counts int16 [n, n_channels], or [n] for outputs."""
        counts = counts.astype(COUNT, copy=False)
        sequence, out, parts = self.sequence_of(first), [], self.parts
        for pieces in self.pieces:
            for part, piece in enumerate(pieces):
                data = (counts[piece.rows] if parts == 1 else counts[piece.rows, piece.columns]).tobytes()
                if self.fd:
                    data = b"%c%c%b%b" % (sequence, flags & 0xFF, data, piece.padding)
                    out.append(Frame(self._identifiers[part], data, True))
                else:
                    out.append(Frame(self._identifiers[sequence * parts + part], data))
            sequence += 1  # within a block it never comes to the wrap
        return out


OPEN_BLOCKS = 4
"""Blocks that frames may belong to: the newest and those right before it. Older ones are given up."""

_NEVER = 1 << 30  # more groups than any stream has
INDICES = 1 << 32  # a frame has 32 bits for the index of a sample


class _Open:
    def __init__(self, shape: tuple[int, int], n_frames: int) -> None:
        self.counts = np.zeros(shape, np.int16)
        self.missing = n_frames
        self.seen = bytearray(n_frames)
        self.flags = 0


class Blocks:
    """Puts blocks together from frames that may be lost, doubled or swapped.

    A frame carries its sequence number, modulo ``wrap``, and its part. The number is taken as the nearest group ahead of the
    last one if that is less than half a wrap away, else as one behind. Blocks are returned as they become whole: one may come
    right after the next one, of which frames have overtaken its own; all older ones are given up. After a loss of
    half a wrap or more, an index from another message (`mark`) corrects the numbering once a frame agrees with it.
    """

    def __init__(self, counters: dict[str, int], stream: StreamFrames) -> None:
        self._counters = counters
        self._wrap, self._parts = stream.wrap, stream.parts
        self._shape = (stream.block, stream.n_channels)
        self._per_block = stream.groups
        self._open: dict[int, _Open] = {}
        self._oldest = 0
        """The first block that may still come."""
        self._early: int | None = None
        """A block that has come before the one right before it, which may still come."""
        self._next = 0
        """The group after the newest one."""
        self._newest = -1
        """The newest frame, counted from the start: group times parts, plus part."""
        self._came = [-1] * (self._wrap * self._parts)
        """The last frame that came with each sequence number and part, counted likewise."""
        self._mark: int | None = None

    def begin(self, block: int) -> None:
        """Set the first block to come, if it is not block 0."""
        self._oldest, self._next = block, block * self._per_block
        self._newest = self._next * self._parts - 1

    def mark(self, sample: int) -> None:
        """Note that ``sample``, modulo 2^32, is next; used only if it is half a wrap or more ahead of the sequence numbers."""
        n = self._shape[0]
        here = self._next // self._per_block * n
        sample += INDICES * round((here - sample) / INDICES)
        group = sample // n * self._per_block
        far = sample % n == 0 and group - self._next >= self._wrap // 2
        self._mark = group if far else None

    def group(self, sequence: int) -> int:
        """The group that a sequence number stands for; negative for one from before the start."""
        base = self._next if self._mark is None or sequence != self._mark % self._wrap else self._mark
        ahead = (sequence - base) % self._wrap
        return base + ahead - self._wrap * (ahead >= self._wrap // 2)

    def put(
        self, group: int, part: int, piece: Piece, counts: np.ndarray, flags: int
    ) -> tuple[int, np.ndarray, int] | None:
        """Add the counts (int16, rows by columns) of a frame; return number, counts and flags of a block it completes."""
        if self._mark is not None and group == self._mark:
            self._counters["resynchronised"] += 1
            self._drop(group // self._per_block)
        self._mark = None
        block, place = divmod(group, self._per_block)
        is_out_of_order = self._note_order(block, group * self._parts + part)
        if group >= self._next:
            self._next = group + 1
            self._drop(block - OPEN_BLOCKS + 1)
        if block < self._oldest or block == self._early:
            self._counters["repeated_frames"] += 1
            if is_out_of_order:
                self._counters["late_frames"] += 1
            return None
        if self._per_block * self._parts == 1:
            self._finish(block)
            return block, counts, flags
        return self._add(block, place * self._parts + part, piece, counts, flags)

    def _note_order(self, block: int, frame: int) -> bool:
        """Whether a frame has not come before but comes after a later one, and is of one of the newest blocks; counted."""
        slot = frame % len(self._came)
        if self._came[slot] >= frame:
            return False
        self._came[slot] = frame
        if frame > self._newest:
            self._newest = frame
            return False
        if block <= self._newest // (self._per_block * self._parts) - OPEN_BLOCKS:
            return False
        self._counters["out_of_order_frames"] += 1
        return True

    def _add(
        self, block: int, frame: int, piece: Piece, counts: np.ndarray, flags: int
    ) -> tuple[int, np.ndarray, int] | None:
        held = self._open.get(block)
        if held is None:
            held = self._open[block] = _Open(self._shape, self._per_block * self._parts)
        into = held.counts[piece.rows, piece.columns]
        if held.seen[frame]:
            self._counters["repeated_frames"] += 1
            if not np.array_equal(into, counts):
                held.missing = _NEVER  # the two differ and either may be wrong: the block is given up
            return None
        held.seen[frame] = 1
        held.missing -= 1
        held.flags |= flags
        into[...] = counts
        if held.missing:
            return None
        del self._open[block]
        self._finish(block)
        return block, held.counts, held.flags

    def _finish(self, block: int) -> None:
        """Note that a block has come whole: the one right before it may still come, and none before that."""
        oldest = block - 1
        if oldest < self._oldest or oldest == self._early:
            oldest = block + 1 if block + 1 != self._early else block + 2
        self._early = block if oldest < block else None
        self._drop(oldest)

    def _drop(self, oldest: int) -> None:
        self._oldest = max(self._oldest, oldest)
        for block in [block for block in self._open if block < self._oldest]:
            del self._open[block]
            self._counters["incomplete_blocks"] += 1

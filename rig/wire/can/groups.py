"""Blocks from frames: sequence numbers unwrapped, parts put together, in bounded memory."""

import numpy as np

from rig.wire.can.streams import Piece, StreamFrames

__all__ = ["OPEN_BLOCKS", "Blocks"]

OPEN_BLOCKS = 4
"""Blocks of which frames may be under way at the same time; the oldest gives way."""


_NEVER = 1 << 30
INDICES = 1 << 32  # a frame has 32 bits for the index of a sample


class _Open:
    """A block of which frames are missing."""

    def __init__(self, shape: tuple[int, int], n_frames: int) -> None:
        self.counts = np.zeros(shape, np.int16)
        self.missing = n_frames
        self.seen = bytearray(n_frames)
        self.flags = 0


class Blocks:
    """Puts blocks together from frames that may be lost, doubled or swapped.

    A frame says its sequence number, modulo ``wrap``, and its part. It is taken for the nearest group ahead of the last one if
    that is less than half a wrap away, else for one behind. A whole block ends all older ones: time does not go back. A group
    index from elsewhere (`mark`) puts right what a loss of half a wrap or more has confused, once a frame agrees with it.
    """

    def __init__(self, counters: dict[str, int], stream: StreamFrames) -> None:
        self._counters = counters
        self._wrap, self._parts = stream.wrap, stream.parts
        self._shape = (stream.block, stream.n_channels)
        self._per_block = stream.groups
        self._open: dict[int, _Open] = {}
        self._oldest = 0
        """The first block that may still come."""
        self._next = 0
        """The group after the newest one."""
        self._mark: int | None = None

    def begin(self, block: int) -> None:
        """The first block to come, where it is not block 0."""
        self._oldest, self._next = block, block * self._per_block

    def mark(self, sample: int) -> None:
        """Somebody who knows says that this sample, modulo 2^32, is next. Believed if the sequence numbers cannot tell it."""
        n = self._shape[0]
        here = self._next // self._per_block * n
        sample += INDICES * round((here - sample) / INDICES)
        group = sample // n * self._per_block
        far = sample % n == 0 and group - self._next >= self._wrap // 2
        self._mark = group if far else None

    def group(self, sequence: int) -> int:
        """The group that a sequence number stands for; below 0 from before the start, and too old."""
        base = self._next if self._mark is None or sequence != self._mark % self._wrap else self._mark
        ahead = (sequence - base) % self._wrap
        return base + ahead - self._wrap * (ahead >= self._wrap // 2)

    def put(
        self, group: int, part: int, piece: Piece, counts: np.ndarray, flags: int
    ) -> tuple[int, np.ndarray, int] | None:
        """Take the counts (int16, rows by columns) of a frame; return number, counts and flags of a block that is whole now."""
        if self._mark is not None and group == self._mark:
            self._count("resynchronised")
            self._drop(group // self._per_block)
        self._mark = None
        self._next = max(self._next, group + 1)
        block, place = divmod(group, self._per_block)
        if block < self._oldest:
            self._count("repeated_frames")
            return None
        if self._per_block * self._parts == 1:
            self._drop(block + 1)
            return block, counts, flags
        return self._add(block, place * self._parts + part, piece, counts, flags)

    def _add(
        self, block: int, frame: int, piece: Piece, counts: np.ndarray, flags: int
    ) -> tuple[int, np.ndarray, int] | None:
        held = self._open.get(block)
        if held is None:
            held = self._open[block] = _Open(self._shape, self._per_block * self._parts)
            if len(self._open) > OPEN_BLOCKS:
                self._drop(sorted(self._open)[1])
                if block < self._oldest:
                    return None
        into = held.counts[piece.rows, piece.columns]
        if held.seen[frame]:
            self._count("repeated_frames")
            if not np.array_equal(into, counts):
                held.missing = _NEVER  # one of the two is false, and nobody knows which
            return None
        held.seen[frame] = 1
        held.missing -= 1
        held.flags |= flags
        into[...] = counts
        if held.missing:
            return None
        del self._open[block]
        self._drop(block + 1)
        return block, held.counts, held.flags

    def _drop(self, oldest: int) -> None:
        """Give up what is older than this block."""
        self._oldest = oldest
        if not self._open:
            return
        for block in [block for block in self._open if block < oldest]:
            del self._open[block]
            self._count("incomplete_blocks")

    def _count(self, name: str) -> None:
        self._counters[name] += 1

"""The frames of what was put out at the instants of a block (version 2), and the block from its frames."""

import numpy as np

from rig.wire.can.frames import Frame, padded_length

COUNT = np.dtype("<i2")
"""A count in a frame."""
INDEX_SIZE = 2  # bytes
INDICES = 1 << 16  # a frame has 16 bits for the index of a count
COUNTS_A_FRAME = {True: 31, False: 3}  # int16 behind the index, of CAN FD (64 bytes) or classical (8)
CLASSICAL_SIZE = INDEX_SIZE + 2 * COUNTS_A_FRAME[False]  # bytes of every classical frame


class Readbacks:
    """Readbacks of blocks of one size to frames and back. The frames of a block may come in any order."""

    def __init__(self, identifier: int, block: int, fd: bool) -> None:
        self._identifier, self._block, self._fd = identifier, block, fd
        self._rows = COUNTS_A_FRAME[fd]
        self._first = -1
        self._missing: set[int] = set()
        self._counts = np.zeros(block, np.int16)

    def lengths(self) -> list[int]:
        """Bytes of each frame of a block."""
        return [self._length(row) for row in range(0, self._block, self._rows)]

    def _length(self, row: int) -> int:
        used = INDEX_SIZE + 2 * min(self._rows, self._block - row)
        return padded_length(used) if self._fd else CLASSICAL_SIZE

    def frames(self, first: int, counts: np.ndarray) -> list[Frame]:
        """The frames of a block: counts int16 [n]."""
        out, counts = [], counts.astype(COUNT, copy=False)
        for row in range(0, self._block, self._rows):
            data = ((first + row) % INDICES).to_bytes(INDEX_SIZE, "little") + counts[row : row + self._rows].tobytes()
            out.append(Frame(self._identifier, data.ljust(self._length(row), b"\0"), self._fd))
        return out

    def put(self, frame: Frame, here: int) -> tuple[int, np.ndarray] | None:
        """Take a frame; return index and counts of a block that it completes. ``here``: an index nearby.

        Raises `ValueError` for a frame that is none of a block.
        """
        index = (
            here + (int.from_bytes(frame.data[:INDEX_SIZE], "little") - here + INDICES // 2) % INDICES - INDICES // 2
        )
        first, row = index - index % self._block, index % self._block
        if index < 0 or row % self._rows or frame.fd != self._fd or len(frame.data) != self._length(row):
            raise ValueError(f"{len(frame.data)} bytes for sample {index}")
        if first != self._first:
            self._first, self._counts = first, np.zeros(self._block, np.int16)
            self._missing = set(range(0, self._block, self._rows))
        size = min(self._rows, self._block - row)
        self._counts[row : row + size] = np.frombuffer(frame.data, COUNT, size, INDEX_SIZE)
        if row not in self._missing:
            return None
        self._missing.remove(row)
        return None if self._missing else (first, self._counts)

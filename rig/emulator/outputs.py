"""Outputs by the index of the sample at which they are due, and what the converter holds where none has come."""

import numpy as np

__all__ = ["OutputQueue"]

BLOCKS_AHEAD = 4  # beyond the queue: what a host may be early


class OutputQueue:
    """A ring of outputs, ``block`` samples a slot."""

    def __init__(self, block: int, queue: int) -> None:
        self.block = block
        self._size = (queue + BLOCKS_AHEAD) * block
        self._values = np.zeros(self._size)
        self._there = np.zeros(self._size, bool)
        self.held = 0.0
        """Count that the converter holds."""

    def put(self, first: int, counts: np.ndarray, present: int) -> int | None:
        """Keep the outputs of a block; those before sample ``present`` are too late.

        Returns how many came in time; None where the block makes no sense.
        """
        block = self.block
        if counts.shape != (block,) or first < 0 or first % block:
            return None
        if first + block > present - present % block + self._size:
            return None
        late = min(max(0, present - first), block)
        slot = first % self._size
        self._values[slot + late : slot + block] = counts[late:]
        self._there[slot + late : slot + block] = True
        return block - late

    def is_there(self, first: int) -> bool:
        """Whether a whole block has come."""
        slot = first % self._size
        return bool(self._there[slot : slot + self.block].all())

    def take(self, first: int) -> tuple[np.ndarray, bool]:
        """Counts of a block as the converter puts them out, and whether it had to hold one; the slot is free then."""
        slot = slice(first % self._size, first % self._size + self.block)
        values, there = self._values[slot].copy(), self._there[slot]
        held = not there.all()
        if held:
            last = self.held
            for index in range(self.block):
                last = values[index] = values[index] if there[index] else last
        self._there[slot] = False
        self.held = float(values[-1])
        return values, held

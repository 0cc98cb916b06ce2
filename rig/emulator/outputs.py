"""What a device does with its outputs: it keeps them until they are due, and puts them on its converter."""

import math

import numpy as np

__all__ = ["Converter", "OutputQueue"]


class Converter:
    """The output converter: passes outputs, holds the last one where one is missing, or goes to 0 V.

    It has put out everything before the instant of a change when `open` or `close` is called. Instants are sample indices; one
    between two samples is a fraction.
    """

    def __init__(self, range_v: float) -> None:
        self.held_v = 0.0
        """Voltage that it holds."""
        self._range_v = range_v
        self._is_open = False
        self._closes = math.inf
        self._ramp_samples = 0.0
        self._from_v = 0.0

    def open(self) -> None:
        """Pass outputs from the next sample on."""
        self._is_open, self._closes = True, math.inf

    def close(self, instant: float, ramp_samples: float = 0.0) -> None:
        """Bring the output from where it is to 0 V by a ramp of ``ramp_samples`` that begins at an instant."""
        self._is_open, self._closes, self._ramp_samples = False, instant, ramp_samples
        self._from_v = self.held_v
        if ramp_samples == 0.0:
            self.held_v = 0.0  # at once: it may be opened again before a sample is put out

    def is_closing(self, first: int) -> bool:
        """Whether the output was brought down and its ramp may still be under way at sample ``first``."""
        return first < self._closes + self._ramp_samples and self._closes < math.inf

    def put_out(self, first: int, volts: np.ndarray, there: np.ndarray) -> tuple[np.ndarray, bool]:
        """Put out samples from ``first`` on: outputs [n] that have come where ``there`` [n] says so, V.

        Returns the voltages [n], and whether one was held.
        """
        held = False
        if self._is_open:
            held = not there.all()
            if held:
                volts = self._filled(volts, there)
        elif self.is_closing(first):
            beyond = np.arange(first, first + volts.size) - self._closes
            volts = self._from_v * np.clip(1.0 - beyond / self._ramp_samples, 0.0, 1.0)
        else:
            volts = np.zeros(volts.size)
        self.held_v = min(max(float(volts[-1]), -self._range_v), self._range_v)
        return volts, held

    def _filled(self, volts: np.ndarray, there: np.ndarray) -> np.ndarray:
        """The outputs, with the last voltage where none has come."""
        out, last = volts.copy(), self.held_v
        for index in range(volts.size):
            last = out[index] = volts[index] if there[index] else last
        return out


BLOCKS_AHEAD = 4  # blocks beyond the queue by which a host may be early


class OutputQueue:
    """A ring of outputs by the index of the sample at which they are due, ``block`` samples per slot."""

    def __init__(self, block: int, queue: int) -> None:
        self.block = block
        self._size = (queue + BLOCKS_AHEAD) * block
        self._values = np.zeros(self._size)
        self._there = np.zeros(self._size, bool)

    def put(self, first: int, counts: np.ndarray, present: int) -> int | None:
        """Keep the outputs of a block; those due before sample ``present`` are too late.

        Returns how many are in time; None for a block of the wrong size or place.
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
        """Whether all outputs of the block at ``first`` have arrived."""
        slot = first % self._size
        return bool(self._there[slot : slot + self.block].all())

    def take(self, first: int, end: int) -> tuple[np.ndarray, np.ndarray]:
        """Counts of samples ``first`` to before ``end`` of one block, and which of them have come; frees their slots."""
        slot = slice(first % self._size, first % self._size + end - first)
        values, there = self._values[slot].copy(), self._there[slot].copy()
        self._there[slot] = False
        return values, there

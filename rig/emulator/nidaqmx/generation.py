"""The samples of an output task, from the call that writes them to the converter."""

import numpy as np

from vibrolock.arrays import Float


class Generation:
    """The buffer of an output task. Without regeneration it fails where nothing has been written in time."""

    def __init__(self, size: int, *, regenerates: bool) -> None:
        self.size = size
        self.written = 0
        """Samples written so far."""
        self.generated = 0
        """Samples put out so far."""
        self.first: int | None = None
        """Sample of the timeline at which it begins; None: it has not begun."""
        self.has_failed = False
        self.regenerates = regenerates
        self._values = np.zeros(size)

    def room(self, present: int) -> int:
        """Samples that can be written while ``present`` is the first sample of the timeline that is not due yet."""
        due = 0 if self.first is None else min(max(0, present - self.first), self.written)
        return self.size - (self.written - due)

    def runs_dry(self, present: int) -> bool:
        """Whether a sample that is due has not been written."""
        return self.first is not None and not self.regenerates and present > self.first + self.written

    def write(self, volts: Float) -> None:
        """Take samples [n], V, for which there is room."""
        self._values[np.arange(self.written, self.written + volts.size) % self.size] = volts
        self.written += volts.size

    def take(self, first: int, volts: Float) -> float:
        """Fill ``volts`` [n], which hold the last voltage, from sample ``first`` of the timeline on; return the last one.

        Where nothing has been written it fails, and the last voltage is held.
        """
        if self.first is None or self.has_failed:
            return float(volts[-1])
        begin = max(0, self.first - first)
        index = np.arange(first + begin, first + volts.size) - self.first
        if self.regenerates:
            index %= max(1, min(self.written, self.size))
        there = index < self.written
        n = int(there.sum())
        volts[begin : begin + n] = self._values[index[:n] % self.size]
        self.generated += n
        if n < index.size:
            self.has_failed = True
            if begin + n > 0:
                volts[begin + n :] = volts[begin + n - 1]
        return float(volts[-1])

"""What a device does with its outputs: it keeps them until they are due, and puts them on its converter.

Where one is missing, it goes on with the last period that the host has sent, by `rig.continuation`, or holds the last output.
"""

import math
from typing import NamedTuple

import numpy as np

from rig.continuation import SOURCE, begin, count_at, forget, keep, ring_for
from rig.wire.messages import Output
from vibrolock.compiled import bound


class Converter:
    """The output converter: passes outputs, holds the last one where one is missing, or goes to 0 V.

    It has put out everything before the instant of a change when `open` or `close` is called. Instants are sample indices; one
    between two samples is a fraction.
    """

    def __init__(self, range_v: float) -> None:
        self.held_v = 0.0
        """Voltage that it holds."""
        self.is_open = False
        """Whether it passes outputs."""
        self._range_v = range_v
        self._closes = math.inf
        self._ramp_samples = 0.0
        self._from_v = 0.0

    def open(self) -> None:
        """Pass outputs from the next sample on."""
        self.is_open, self._closes = True, math.inf

    def close(self, instant: float, ramp_samples: float = 0.0) -> None:
        """Bring the output from where it is to 0 V by a ramp of ``ramp_samples`` that begins at an instant."""
        self.is_open, self._closes, self._ramp_samples = False, instant, ramp_samples
        self._from_v = self.held_v
        if ramp_samples == 0.0:
            self.held_v = 0.0  # at once: it may be opened again before a sample is put out

    def is_closing(self, first: int) -> bool:
        """Whether the output was brought down and its ramp may still be under way at sample ``first``."""
        return first < self._closes + self._ramp_samples and self._closes < math.inf

    def put_out(self, first: int, volts: np.ndarray, there: np.ndarray) -> np.ndarray:
        """Put out samples from ``first`` on: outputs [n] where ``there`` [n] says so, V; returns the voltages [n]."""
        if self.is_open:
            if not there.all():
                came = np.where(there, np.arange(volts.size), -1)
                last = np.maximum.accumulate(came)  # the last output that has come up to each sample; -1: none
                volts = np.where(last >= 0, volts[last], self.held_v)
        elif self.is_closing(first):
            beyond = np.arange(first, first + volts.size) - self._closes
            volts = self._from_v * np.clip(1.0 - beyond / self._ramp_samples, 0.0, 1.0)
        else:
            volts = np.zeros(volts.size)
        self.held_v = min(max(float(volts[-1]), -self._range_v), self._range_v)
        return volts


class Due(NamedTuple):
    """Outputs that are due."""

    counts: np.ndarray
    """int64[n]."""
    there: np.ndarray
    """bool[n]: it has come in time, or the device goes on with this one."""
    is_whole: bool
    """Whether all are there."""
    is_continued: bool
    """Whether the device goes on with one that has not come."""


BLOCKS_AHEAD = 4  # blocks beyond the queue by which a host may be early


class OutputQueue:
    """Outputs by the index of the sample at which they are due, in blocks of ``block``.

    Two rings: one has what is still to come, each output until it is due. The other has what the host has sent, in time or
    late, for the rule by which missing ones are continued; periods of up to ``longest_period`` samples can be, 0 for none.
    """

    def __init__(self, block: int, queue: int, longest_period: int) -> None:
        self.block = block
        self._size = (queue + BLOCKS_AHEAD) * block
        self._values = np.zeros(self._size, np.int64)
        self._there = np.zeros(self._size, bool)
        self._source, self._sent = np.zeros(1, SOURCE)[0], ring_for(longest_period)
        begin(self._source, longest_period)
        self._keep = bound(keep, self._source, self._sent, 0, self._values[:block], 0, 0)

    def put(self, output: Output, present: int) -> int | None:
        """Keep the outputs of a block; those due before sample ``present`` are too late.

        Returns how many are in time; None for a block of the wrong size or place.
        """
        first, block = output.first, self.block
        if output.counts.shape != (block,) or first < 0 or first % block:
            return None
        if first + block > present - present % block + self._size:
            return None
        counts = output.counts.astype(np.int64)
        self._keep(self._source, self._sent, first, counts, output.period, output.ramp)
        late = min(max(0, present - first), block)
        slot = first % self._size
        self._values[slot + late : slot + block] = counts[late:]
        self._there[slot + late : slot + block] = True
        return block - late

    def forget(self, present: int) -> None:
        """Go on with nothing that was due before sample ``present``; what is still to come stays."""
        forget(self._source, present)

    def is_there(self, first: int) -> bool:
        """Whether all outputs of the block at ``first`` have arrived."""
        slot = first % self._size
        return bool(self._there[slot : slot + self.block].all())

    def take(self, first: int, end: int) -> Due:
        """Outputs of samples ``first`` to before ``end`` of one block; frees their slots."""
        slot = slice(first % self._size, first % self._size + end - first)
        counts, there = self._values[slot].copy(), self._there[slot].copy()
        self._there[slot] = False
        has_come = bool(there.all())
        goes_on = not has_come and bool(self._source["period"])
        if goes_on:
            for index in np.flatnonzero(~there):
                counts[index] = self.count_at(first + int(index))
            there.fill(True)
        return Due(counts, there, has_come or goes_on, goes_on)

    def count_at(self, instant: int) -> int:
        """The count with which to go on at an instant, where there is a source."""
        return count_at(self._source, self._sent, instant)

"""Samples of stored rows: a plan may store one row of several, and the changes are events of the recording."""

from typing import NamedTuple

import numpy as np

from rig.recording.parts import Part


class _Change(NamedTuple):
    """From ``row`` on, rows are the samples from ``sample`` on whose number is a multiple of ``stride``."""

    row: int
    sample: int
    stride: int


class StoredSamples:
    """Where the rows of a part stand in time."""

    def __init__(self, part: Part) -> None:
        told = (event for event in part.events if event.get("what") == "telemetry")
        changes = (_Change(int(one["row"]), int(one["sample"]), int(one["stride"])) for one in told)
        self._changes = [_Change(0, 0, 1), *changes]

    def samples(self, rows: np.ndarray) -> np.ndarray:
        """Return the sample of the part for each row number, float64[n]; fractions of rows count."""
        first, sample, stride = np.array(self._changes).T
        at = np.searchsorted(first, rows, side="right") - 1
        begin = -(-sample // stride) * stride
        return np.asarray(begin[at] + stride[at] * (rows - first[at]), float)

    def rows_before(self, sample: int) -> int:
        """Return how many rows hold samples before this one, as if the part never ended."""
        at = len(self._changes) - 1
        while at > 0 and self._changes[at].sample >= sample:
            at -= 1
        row, first, stride = self._changes[at]
        found = row + max(0, -(-sample // stride) - -(-first // stride))
        return min(found, self._changes[at + 1].row) if at + 1 < len(self._changes) else found

    def unbroken_from(self, row: int) -> int:
        """Return the first row from which on all samples are stored up to ``row``; ``row`` itself if that is not so there."""
        last = [change for change in self._changes if change.row <= row]
        while len(last) > 1 and last[-1].row == row:
            last.pop()
        return last[-1].row if last[-1].stride == 1 else row

"""Select the rows of a run that are stored, and map samples to rows of the file."""

from bisect import bisect_right

import numpy as np

from rig.campaigns.planning.plan import Plan
from rig.recording.stored import Event


class StoredRows:
    """Selects rows on their way to the journal.

    ``segments`` is the table of the sequencer, and ``evaluated``, bool[n], says which of them are evaluated. Of what the plan
    does not store in full, only rows whose sample number is a multiple of ``plan.row_stride`` are stored. Every change of the
    stride is recorded as an event. The sample numbers of all rows follow from these events
    (`rig.campaigns.evaluation.stored_samples`).
    """

    def __init__(self, plan: Plan, segments: np.ndarray, evaluated: np.ndarray, sample_rate_hz: float) -> None:
        points = [*segments["point"].tolist(), -1]  # the last entry is for rows outside any segment (number -1)
        used = [*evaluated.tolist(), False]
        self._strides = np.array(
            [plan.row_stride(n, sample_rate_hz, evaluated=e) for n, e in zip(points, used, strict=True)]
        )
        self._all = bool((self._strides == 1).all())
        self._changes: list[tuple[int, int, int]] = [(0, 0, 1)]  # first sample, first row, stride
        self._rows = 0

    def take(self, first: int, rows: np.ndarray) -> tuple[np.ndarray, list[Event]]:
        """Return the rows to store of a chunk that begins with sample ``first``, and an event for each change of stride."""
        if self._all:
            return rows, []
        strides = self._strides[rows["segment"]]
        samples = first + np.arange(rows.size)
        kept = samples % strides == 0
        stored_before = self._rows + np.concatenate([[0], np.cumsum(kept)])
        events: list[Event] = []
        previous = self._changes[-1][2]
        for index in np.flatnonzero(np.diff(strides, prepend=previous)):
            change = (int(samples[index]), int(stored_before[index]), int(strides[index]))
            self._changes.append(change)
            sample, row, stride = change
            state = "all rows" if stride == 1 else f"1 row of {stride}"
            events.append({"sample": sample, "what": "telemetry", "state": state, "row": row, "stride": stride})
        self._rows = int(stored_before[-1])
        return rows[kept], events

    def row_range(self, first: int, end: int) -> tuple[int, int] | None:
        """Return the rows of the part that hold samples ``first`` to ``end``; None if not all of these samples are stored."""
        index = bisect_right(self._changes, (first, 2**63, 0)) - 1
        sample, row, stride = self._changes[index]
        until = self._changes[index + 1][0] if index + 1 < len(self._changes) else end
        if stride != 1 or until < end:
            return None
        return row + first - sample, row + end - sample

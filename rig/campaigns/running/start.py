"""The dialogue of a run with its loop about the start: the level rises only once the vibration there was judged."""

import math

import numpy as np

from rig.campaigns.evaluation.point import Point
from rig.campaigns.evaluation.rows import Rows
from rig.campaigns.running.row_buffer import RowBuffer
from rig.campaigns.running.start_judgement import PERIODS, StartJudgement
from rig.loop.session import RunningLoop
from rig.tick.sequencer.layout import SegmentKind

UNDECIDED = (
    "the vibration at the start voltage was not steady enough to compare its scale with the last check; the first point is "
    "compared instead"
)


class Start:
    """The start of a run at its start voltage. The loop stays there until a judgement of its last periods lets it go on.

    Judgements are made one after the other in another thread (`judge`), from rows that are taken before (`due_rows`).
    """

    def __init__(self, judgement: StartJudgement, loop: RunningLoop) -> None:
        self._judgement, self._loop, self._tick = judgement, loop, loop.tick
        kinds = loop.tick.arrays.segments["kind"]
        self._segment = int(np.argmax(kinds == SegmentKind.START)) if (kinds == SegmentKind.START).any() else None
        self._asked = 0
        self._undecided = False

    def first_needed(self) -> int | None:
        """Return the first sample that a judgement may need; None if no judgement is to come."""
        return None if self._segment is None else self._tick.sample - self._samples()

    def due_rows(self, kept: RowBuffer) -> tuple[Rows, int, bool] | None:
        """Return the arguments of `judge` if a judgement is due that was not asked for yet."""
        due = self._tick.start_judgements
        if self._segment is None or due <= self._asked:
            return None
        self._asked = due
        end, begin = self._tick.sample, int(self._tick.outcomes[self._segment]["first_sample"])
        rows = kept.take(max(end - self._samples(), begin), end)
        return rows, due, self._tick.start_late_periods >= self._judgement.longest_periods

    def judge(self, rows: Rows, number: int, last: bool) -> list[Point[object]]:
        """Let the run go on from the start voltage, or ask for the ramp to 0 V if the vibration is refused.

        ``number`` of the judgement, from 1; ``last``: it is the last one. Returns no points.
        """
        try:
            refusal = self._judgement.refusal_of_rows(rows)
        except BaseException:
            self._loop.request_stop()  # a loop in lockstep waits for an answer
            raise
        if refusal:
            self._loop.request_stop(f"before the first level: {refusal}")
        elif last or not self._judgement.pending:
            self._undecided = self._judgement.pending and self._judgement.longest_periods > 0.0
            self._loop.release_start()
        else:
            self._loop.continue_start(number)
            return []
        self._segment = None
        return []

    def take_remark(self) -> str:
        """Return once what is to be said of a start that ended undecided; else an empty string."""
        said, self._undecided = UNDECIDED if self._undecided else "", False
        return said

    def _samples(self) -> int:
        rate_hz = self._tick.bench.sample_rate_hz
        return math.ceil((PERIODS + 0.5) / self._tick.frequency_hz * rate_hz)

"""A part of a recording in time: its rows at a sample, its bins, the segment and point that were under way."""

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rig.bench import Bench
from rig.campaigns.evaluation.stored_samples import StoredSamples
from rig.campaigns.planning.plan import Plan
from rig.errors import RigError
from rig.live.layout import BIN_S, bin_dtype, put_bin
from rig.recording.parts import Part
from rig.tick.layout import recorded_row
from rig.tick.safety.layout import GuardMode
from rig.tick.sequencer.layout import SegmentKind
from rig.tick.sequencer.segments import segment_table
from vibrolock.arrays import Int

MANY = 100
"""Points whose end is looked for by bisection, each by itself, at most."""


@dataclass(frozen=True)
class PlanOfPart:
    """The plan that was in force, and what it may have asked for in a part."""

    plan: Plan
    numbers: Sequence[int]
    """Numbers in the recording of the plan's points."""
    left_out: tuple[frozenset[int], ...]
    """Which places in the plan may have been left out, the most likely first."""


class RecordedPart:
    """Part ``number``, from 1, of a recording. Times are samples of the part, from 0; rows are read when asked for."""

    def __init__(self, part: Part, number: int, bench: Bench, of: PlanOfPart) -> None:
        self.part, self.number, self._bench, self._of = part, number, bench, of
        self.n_samples = 0
        self._samples = StoredSamples(part)
        if part.n_rows:
            self.n_samples = int(self._samples.samples(np.array([part.n_rows - 1]))[0]) + 1
        self._dtype = recorded_row(len(bench.channels))
        self._bin_dtype = bin_dtype(len(bench.channels))
        self.bin_samples = math.ceil(BIN_S * bench.sample_rate_hz)
        self.n_bins = self.n_samples // self.bin_samples
        self.segments = self._segments()

    def rows(self, first: int, stop: int) -> NDArray[np.void]:
        """Return rows as a run publishes them. What an earlier version did not record is NaN, or 0."""
        out = np.zeros(max(stop - first, 0), self._dtype)
        for name in self._dtype.names or ():
            if name in (self.part.row_dtype.names or ()):
                out[name] = self.part.rows(name, first, stop)
            elif out[name].dtype.kind in "fc":
                out[name] = np.nan
            elif name == "segment":
                out[name] = -1
        return out

    def rows_until(self, samples: int) -> int:
        """Return how many rows the first ``samples`` samples have."""
        return min(self._samples.rows_before(samples), self.part.n_rows)

    def unbroken_from(self, row: int) -> int:
        """Return the first row from which on all samples are stored up to ``row``."""
        return self._samples.unbroken_from(row)

    def bins(self, first: int, stop: int) -> NDArray[np.void]:
        """Return bins of the traces, made as those of a run under way. A bin without a row holds no number."""
        out = np.zeros(stop - first, self._bin_dtype)
        edges = [self.rows_until(n * self.bin_samples) for n in range(first, stop + 1)]
        begin = max(edges[0] - 1, 0)
        rows = self.rows(begin, edges[-1])
        rate = self._bench.sample_rate_hz
        for n, (one, left, right) in enumerate(zip(out, edges[:-1], edges[1:], strict=True), first):
            end_s = (n + 1) * self.bin_samples / rate
            if left < right:
                level = self.level(rows[right - begin - 1])
                put_bin(one, rows[left - begin : right - begin], end_s=end_s, part=self.number, level=level)
                continue
            for name in self._bin_dtype.names or ():
                one[name] = np.nan if one[name].dtype.kind == "f" else 0
            one["end_s"], one["part"] = end_s, self.number
            if left > 0:
                one["lock"], one["guard"] = rows[left - begin - 1]["lock"], rows[left - begin - 1]["guard"]
        return out

    def level(self, row: np.void) -> float:
        """Return the level at a row: the output's amplitude where levels are in volts, else that of a held segment, or NaN."""
        if self._of.plan.level_unit == "V":
            return float(abs(row["command_v"]))
        segment = self.segment(row)
        held = segment is not None and segment["kind"] not in (SegmentKind.RAMP, SegmentKind.LEVEL_SWEEP)
        return float(segment["level"]) if segment is not None and held else math.nan

    def segment(self, row: np.void) -> np.void | None:
        """Return the segment that was under way, as `rig.tick.sequencer.layout.SEGMENT`; None if that is not known."""
        at = int(row["segment"])
        known = self.segments is not None and 0 <= at < self.segments.size and row["guard"] == GuardMode.ARMED
        return self.segments[at] if self.segments is not None and known else None

    def end_of_points(self) -> list[int]:
        """Return the sample with which each of the part's points was over, in their order.

        Where nothing was recorded of a point: the one with which its last segment ended, or the end of the part.
        """
        ends: list[int | None] = [
            self._sample_of(int(point["end_sample"])) if "end_sample" in point else None for point in self.part.points
        ]
        unknown = [n for n, end in enumerate(ends) if end is None]
        if unknown and self.segments is not None:
            last = {int(point): at for at, point in enumerate(self.segments["point"])}
            column = self.part.rows("segment") if len(unknown) > MANY else None
            for n in unknown:
                number = int(self.part.points[n]["number"])
                place = self._of.numbers.index(number) if number in self._of.numbers else -1
                if place in last:
                    ends[n] = self._sample_of(self._end_of_segment(last[place], column))
        latest, out = 0, []
        for end in ends:  # results come in this order
            latest = max(latest, self.n_samples if end is None else end)
            out.append(min(latest, self.n_samples))
        return out

    def _end_of_segment(self, segment: int, column: Int | None) -> int:
        """Return the first row after a segment. The plan goes through its segments from the first to the last, then to -1."""

        def reached(row: int) -> int:
            at = int(column[row] if column is not None else self.part.rows("segment", row, row + 1)[0])
            return at if at >= 0 else np.iinfo(np.int64).max

        return bisect_right(range(self.part.n_rows), segment, key=reached)

    def _sample_of(self, row: int) -> int:
        return int(self._samples.samples(np.array([max(row - 1, 0)]))[0]) + 1

    def _segments(self) -> NDArray[np.void] | None:
        """Return the table of segments that the part went through, or None if it cannot be rebuilt."""
        if "segment" not in (self.part.row_dtype.names or ()):
            return None
        for left_out in self._of.left_out:
            try:
                segments = self._of.plan.segments(self._bench.sample_rate_hz, left_out)
                table, _ = segment_table(segments, self._bench.sample_rate_hz, self._of.plan.amplitude_law)
            except (RigError, ValueError, IndexError):  # a plan of an earlier version that is not carried out any more
                continue
            if table.size and self._fits(table):
                return table
        return None

    def _fits(self, table: NDArray[np.void]) -> bool:
        """Return whether the rows of the first points lie in segments of these points, or of those measured with them."""
        for point in [point for point in self.part.points if "end_sample" in point][:5]:
            end_sample, number = int(point["end_sample"]), int(point["number"])
            at = int(self.part.rows("segment", end_sample - 1, end_sample)[0])
            if not 0 <= at < table.size or number not in self._of.numbers:
                return False
            if int(table[at]["point"]) not in self._of.plan.together(self._of.numbers.index(number)):
                return False
        return True

"""The start of a run: the vibration at the start voltage is judged before a loop raises the output to the first level."""

import math
from dataclasses import replace

import numpy as np

from identification import IdentificationError
from rig.arming.checked_scale import CheckedScale
from rig.bench import Bench
from rig.campaigns.evaluation.plausibility import start_refusal
from rig.campaigns.evaluation.point import Point, Quality, planned_point
from rig.campaigns.evaluation.rows import Rows
from rig.campaigns.evaluation.scale import scale_misfit
from rig.campaigns.evaluation.vibration_quality import vibration_part
from rig.campaigns.evaluation.vibrations import recorded_vibration
from rig.campaigns.planning.locked import LockedPlan
from rig.campaigns.planning.plan import Plan, Target
from rig.campaigns.running.row_buffer import RowBuffer
from rig.loop.session import RunningLoop
from rig.tick.sequencer.layout import SegmentKind

PERIODS = 10
"""Periods at the start voltage that are judged."""
HARMONICS = 3  # evaluated of the vibration at the start; chosen
LONGEST = 300.0  # periods: largest extension of the start, for modes with little damping


class StartJudgement:
    """Compares channels with each other by the mode shapes, and the scale of force and motion with the last check.

    This is done once, under a lock: at the start voltage, or with the first point where the plan has none. What is refused ends
    the run before the level rises; a scale that is merely warned of is a warning of every point. ``checked`` is None if no
    check is known.
    """

    def __init__(self, bench: Bench, plan: Plan, checked: CheckedScale | None) -> None:
        self._bench, self._plan, self._checked = bench, plan, checked
        self._warning = ""
        self.pending = isinstance(plan, LockedPlan)
        """Whether the scale was not compared yet."""
        self.refused = False
        """Whether the run must end."""

    @property
    def longest_periods(self) -> float:
        """Periods for which the start may last longer until the scale can be compared: three time constants of the mode."""
        return 0.0 if self._checked is None else min(LONGEST, 3.0 / (2.0 * math.pi * self._checked.damping_ratio))

    def refusal_of_rows(self, rows: Rows) -> str:
        """Judge rows recorded at the start voltage; return why the run must end, or an empty string.

        If `pending` is still true afterwards, the vibration was not steady enough to compare its scale.
        """
        try:
            vibration = recorded_vibration(self._bench, rows, HARMONICS)
            growth_1_s = self._growth_1_s(rows)
        except (IdentificationError, ArithmeticError):
            return ""  # a record that cannot be evaluated proves nothing; other checks end a run without a vibration
        target = Target(number=0, level=1.0)
        point = replace(planned_point(self._plan, target), vibration=vibration_part(vibration, rows))
        refusal = start_refusal(self._bench, self._plan, point) or self._judged(point, growth_1_s, at_start=True)
        self.refused = bool(refusal)
        return refusal

    def applied(self, point: Point[object]) -> tuple[Point[object], str]:
        """Judge a point unless the start was judged, and add the warning; also return why the run must end."""
        refusal = ""
        if self.pending and point.accepted and point.spectrum is not None:
            refusal = self._judged(point)
        if refusal:
            self.refused = True
            return point.refused(refusal, Quality.IMPLAUSIBLE), refusal
        return (point.warned(self._warning) if self._warning and point.accepted else point), ""

    def _judged(self, point: Point[object], growth_1_s: float = 0.0, *, at_start: bool = False) -> str:
        """Compare with the check, if there is one; keep what is warned of, and return what is refused."""
        if self._checked is None:
            self.pending = False
            return ""
        misfit = scale_misfit(self._bench, point, self._checked, growth_1_s, at_start=at_start)
        self.pending = misfit is None
        if misfit is None or not misfit.warned:
            return ""
        self._warning = "" if misfit.refused else misfit.text
        return misfit.text if misfit.refused else ""

    def _growth_1_s(self, rows: Rows) -> float:
        """Relative rate of growth of the drive point's fundamental from the first to the second half of the rows, 1/s."""
        half = rows.size // 2
        drive = self._bench.index_of("drive")
        first, second = (
            float(abs(recorded_vibration(self._bench, part, 1).harmonics[drive, 1]))
            for part in (rows[:half], rows[half:])
        )
        if not (0.0 < first < math.inf and 0.0 < second < math.inf):
            return 0.0
        return math.log(second / first) * self._bench.sample_rate_hz / half


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

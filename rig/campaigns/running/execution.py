"""Execution of one part of a run: the control loop, the journal, the evaluated points, and every way to stop."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import ParamSpec, Protocol, TypeVar

import numpy as np

from controller import LockState
from identification import IdentificationError
from rig.arming.checked_scale import CheckedScale
from rig.arming.run_options import Progress
from rig.bench import Bench
from rig.campaigns.evaluation.force_harmonics import with_force_harmonics
from rig.campaigns.evaluation.heavy_damping import with_heavy_damping
from rig.campaigns.evaluation.images import with_images
from rig.campaigns.evaluation.lost_samples import lost_objection, lost_rows
from rig.campaigns.evaluation.measured_together import Passage, round_at
from rig.campaigns.evaluation.plausibility import with_plausibility
from rig.campaigns.evaluation.point import Attempt, Point, Quality, RowRange, point_name
from rig.campaigns.evaluation.rows import Rows
from rig.campaigns.evaluation.skipped import skipped_summary
from rig.campaigns.evaluation.stored_point import point_from, stored
from rig.campaigns.evaluation.transient_disturbance import refused_for_a_transient
from rig.campaigns.evaluation.vibrations import failed_point, not_evaluated
from rig.campaigns.kinds import KINDS
from rig.campaigns.planning.locked import SettledPlan
from rig.campaigns.planning.plan import Plan, Target
from rig.campaigns.running.attempts import MeasuredBefore, RefusedRecords, after_attempts, measured_before_repeat
from rig.campaigns.running.device_remarks import with_device_remarks, with_disorder
from rig.campaigns.running.evaluation_thread import EvaluationThread
from rig.campaigns.running.row_buffer import RowBuffer
from rig.campaigns.running.start_judgement import Start, StartJudgement
from rig.campaigns.running.stored_rows import StoredRows
from rig.campaigns.running.trip_advice import Before, Trip, advice_on
from rig.campaigns.running.tripped_level import tripped_at
from rig.daq import Image, flag_names
from rig.errors import RecordingError
from rig.live.publisher import Live
from rig.loop.loop import LoopStatistics
from rig.loop.session import RunningLoop
from rig.recording.stored import End, Event, Information
from rig.system.stop_signals import deferred, stopping_on_signals
from rig.text.disorder import disorder_text
from rig.tick.safety.layout import EndReason, GuardMode
from rig.tick.safety.limits import describe_end, end_reason_of
from rig.tick.sequencer.layout import EVALUATED, Outcome, SegmentKind
from vibrolock.one_thread import one_thread

NO_LOCK = {EndReason.NO_LOCK_IN_WINDOW, EndReason.NO_LOCK}
UNLOCKED = {Outcome.OUTSIDE_WINDOW, Outcome.NOT_LOCKED, Outcome.NOT_SETTLED}
OVER = {*Outcome} - {Outcome.PENDING, Outcome.RUNNING, Outcome.SKIPPED, Outcome.INTERRUPTED}
P = ParamSpec("P")
T = TypeVar("T")
Table = TypeVar("Table", bound=Mapping[str, object])


class Journal(Protocol):
    """Takes what a part of a run produces; `rig.recording.journal.JournalWriter` writes it to a disk."""

    def part(self, information: Information) -> None:
        """Begin the part."""

    def rows(self, rows: np.ndarray) -> None:
        """Take telemetry rows."""

    def event(self, event: Event) -> None:
        """Take an event."""

    def point(self, point: Mapping[str, object]) -> None:
        """Take a point."""

    def end(self, end: End) -> None:
        """End the part."""


class Execution:
    """One part of a recording: runs the control loop, writes the journal and evaluates the points.

    Rows of a record too long for memory wait for their evaluation in unnamed files in ``folder``.
    """

    def __init__(
        self,
        plan: Plan,
        bench: Bench,
        loop: RunningLoop,
        journal: Journal,
        progress: Progress,
        before: MeasuredBefore | None = None,
        folder: Path | None = None,
        live: Live | None = None,
        checked: CheckedScale | None = None,
        images: Sequence[Image] = (),
    ) -> None:
        before = before or MeasuredBefore()
        self.plan, self.bench, self.loop, self.tick = plan, bench, loop, loop.tick
        self.journal, self.progress, self.live = journal, progress, live or Live()
        self.kind, self.images = KINDS[plan.kind], images
        self.batched = self.kind.measure_batch is not None
        self.targets = plan.targets()
        self.measured_before = before.done | before.given_up
        self.numbers = range(len(self.targets)) if before.numbers is None else before.numbers
        self.known = list(before.points)
        self.done = len(before.done)
        self.finished = len(self.measured_before)
        self.accepted = self.done
        given_up = {self.numbers[number] for number in before.given_up}
        self.reported = {point.number: point for point in before.points if point.number in given_up}
        self.attempts: dict[int, tuple[Attempt, ...]] = dict(before.attempts)
        self.refused = RefusedRecords()
        self.passing: set[int] = set()
        self.lost_lock: set[int] = set()
        self.next_segment = 0
        self.locked = any(point.accepted for point in before.points)
        self.last = {"lock": int(LockState.SEARCHING), "guard": int(GuardMode.ARMED)}
        self.kept = RowBuffer(loop.tick.row_dtype, folder)
        segments = loop.tick.arrays.segments
        self.settles = bool((segments["kind"] == SegmentKind.SETTLE).any())
        whole = self.batched or plan.evaluates_approach
        evaluated = segments["point"] >= 0 if whole else np.isin(segments["kind"], list(EVALUATED))
        self.stored = StoredRows(plan, segments, evaluated, bench.sample_rate_hz)
        self.evaluations = EvaluationThread(beside=not loop.waits)
        self.scale = StartJudgement(bench, plan, checked)
        self.start = Start(self.scale, loop)
        self.write_error: RecordingError | None = None
        self.failure: BaseException | None = None

    def run(self, information: Information) -> None:
        """Run to the end of the plan, or as far as possible; afterwards raise errors that occurred on the way.

        ``information`` is written to the journal before the first row of the part. A run that ends early raises no error.
        """
        flags: Information = {"points_done": self.done, "device_flags": flag_names(self.loop.counters)}
        begin: Information = {**information, **flags}
        self._write("part", self.journal.part, begin)
        for remark in self.loop.remarks:
            self._remark(remark)
        with one_thread(), deferred():  # signals: until the end record is in the journal
            with stopping_on_signals(self.loop.request_stop), self.live.stopping_on_request(self.loop.request_stop):
                try:
                    for rows in self.loop.run():
                        self._take(rows)
                except BaseException as error:  # whatever interrupted the loop, its end is still recorded
                    self.failure = self.failure or error
                    self.loop.bring_down()
            self._report_rest()
            self._attempt(self._mark_interrupted)
            self._report_rest()
            self._attempt(self._mark_unlocked)
            self.evaluations.close()
            self._remark(disorder_text(self.loop.counters))
            self._write("end", self.journal.end, self._end())
        if self.failure is not None:
            raise self.failure
        if self.write_error is not None:
            raise RecordingError(f"{self.write_error}; `rig resume` measures the rest once it can be written")

    def _remark(self, text: str) -> None:
        if text:
            self._event({"sample": self.tick.sample, "what": "remark", "text": text})
            self._attempt(self.progress.remark, text)

    def _take(self, rows: np.ndarray) -> None:
        stored, events = self.stored.take(self.tick.sample - rows.size, rows)
        if stored.size:
            self._record(self.journal.rows, stored)
        for event in events:
            self._event(event)
        self._attempt(self._note_changes, rows)
        self._attempt(self._collect, rows)
        self._attempt(self.progress.advance, rows, self.tick)
        self.live.take(rows, self.loop, self.finished, len(self.targets))

    def _attempt(self, step: Callable[P, None], *arguments: P.args, **named: P.kwargs) -> None:
        """Run a step outside the control loop. If it fails, the rig is ramped down, and the error is raised at the end."""
        if self.failure is None:
            self._anyway(step, *arguments, **named)

    def _anyway(self, step: Callable[P, T], *arguments: P.args, **named: P.kwargs) -> T | None:
        """Run a step even after an earlier failure; return the result of the step, or None if it fails."""
        try:
            return step(*arguments, **named)
        except BaseException as error:  # whatever the error, the driven rig is brought down before anything is reported
            self.failure = self.failure or error
            self.loop.request_stop()
            return None

    def _event(self, event: Event) -> None:
        self._write("event", self.journal.event, event)

    def _write(self, what: str, write: Callable[[Table], None], content: Table) -> None:
        """Publish a part, an event, a point or an end, and ``write`` it to the journal."""
        self.live.line(what, content)
        self._record(write, content)

    def _record(self, write: Callable[[T], None], content: T) -> None:
        """Write to the journal. If that fails, bring the rig down; the run continues unrecorded until it is at rest."""
        if self.write_error is not None:
            return
        try:
            write(content)
        except RecordingError as error:
            self.write_error = error
            self.loop.request_stop(str(error))

    def _note_changes(self, rows: np.ndarray) -> None:
        """Record every change of the lock state and of the guard as an event with its sample number."""
        first = self.tick.sample - rows.size
        events: list[Event] = []
        for name, kind in (("lock", LockState), ("guard", GuardMode)):
            values = np.ascontiguousarray(rows[name])
            begins = [0] if int(values[0]) != self.last[name] else []
            for index in (*begins, *(np.flatnonzero(values[1:] != values[:-1]) + 1).tolist()):
                state = kind(int(rows[name][index])).name.lower()
                self.locked = self.locked or state == "locked"
                events.append({"sample": first + int(index), "what": name, "state": state})
            self.last[name] = int(rows[name][-1])
        for event in sorted(events, key=lambda event: event["sample"]):
            self._event(event)

    def _collect(self, rows: np.ndarray) -> None:
        """Keep the rows of the current point, and request the evaluation of points that are over."""
        self.kept.add(self.tick.sample - rows.size, rows)
        if (due := self.start.due_rows(self.kept)) is not None:
            self.evaluations.ask(self.start.judge, *due)
        self._remark(self.start.take_remark())
        self._note_refused()
        outcomes, segments = self.tick.outcomes, self.tick.arrays.segments
        while self.next_segment < segments.size:
            if self.batched and int(segments[self.next_segment]["point"]) >= 0:
                if not self._finish_round():
                    break
                continue
            entry, kind = outcomes[self.next_segment], int(segments[self.next_segment]["kind"])
            code = Outcome(int(entry["outcome"]))
            if code not in OVER and code is not Outcome.SKIPPED:
                break
            number = int(segments[self.next_segment]["point"])
            if number >= 0 and code is not Outcome.SKIPPED:
                target = self.targets[number]
                if code is not Outcome.DONE:
                    self.evaluations.known(failed_point(self.plan, target, entry, locked=self.locked))
                elif kind in EVALUATED:
                    settling = outcomes[self.next_segment - 1].copy()
                    record = self.kept.take(first := self._begin(self.next_segment), int(entry["end_sample"]))
                    steady = kind == SegmentKind.RECORD
                    faults = self._faults(self.next_segment, self.next_segment + 1, settled=steady)
                    self.evaluations.ask(
                        self._measured, first, record, faults, [target], steady=steady, settling=settling
                    )
            self.next_segment += 1
        self.kept.drop_before(self._first_needed())
        while self.evaluations if self.loop.waits else self.evaluations.ready():
            for point in self.evaluations.take():
                self._report(point)

    def _note_refused(self) -> None:
        """Keep what the sequencer has refused and measures again."""
        for number, sample, attempt in self.refused.take(self.tick, self.stored):
            self.attempts[number] = (*self.attempts.get(number, ()), attempt)
            name, tried = point_name(self.numbers[number]), len(self.attempts[number])
            text = f"{name}, attempt {tried}: {attempt.reason}; measured again"
            self._event({"sample": sample, "what": "attempt", "state": "refused", "text": text})
            self.progress.remark(text)

    def _faults(self, first: int, end: int, *, settled: bool) -> int:
        """Return the samples with passing faults of the device from where the point of segment ``first`` begins to ``end``.

        Unless the vibration has ``settled``, those of the point before count too: they may still be felt.
        """
        first = self._point_begins(first)
        if first > 0 and not settled:
            first = self._point_begins(first - 1)
        outcomes = self.tick.outcomes[first:end]
        return int(sum(outcomes[name].sum() for name in ("held", "continued", "lost")))

    def _measured(
        self,
        first: int,
        rows: Rows,
        faults: int,
        targets: list[Target],
        *,
        steady: bool = False,
        settling: np.void | None = None,
        passages: Sequence[Passage] = (),
        ended: str = "",
    ) -> list[Point[object]]:
        """Evaluate the points in rows that begin with sample ``first``, and note those that are worth another attempt.

        ``faults``: samples with passing faults of the device; ``steady``: the rows hold one vibration at one level.
        """
        bench, plan, out = self.bench, self.plan, []
        lost = int(lost_rows(rows).sum())  # a loop on the device knows nothing of those that were lost on the way here
        try:
            if self.kind.measure_batch is not None:
                points = self.kind.measure_batch(bench, plan, targets, rows, passages, ended)
            else:
                assert self.kind.measure is not None
                points = [self.kind.measure(bench, plan, target, rows, settling) for target in targets]
        except (IdentificationError, ArithmeticError) as failure:
            objection = lost_objection(lost, rows.size)
            error = IdentificationError(objection) if objection else failure
            points = [not_evaluated(plan, target, error, self.settles) for target in targets]
            points = [replace(point, direction="both") for point in points] if self.batched else points
        kept = self.stored.row_range(first, first + rows.size)
        where = None if kept is None else RowRange(first_sample=kept[0], end_sample=kept[1])
        for target, measured in zip(targets, points, strict=True):
            point = with_device_remarks(measured, rows, self.loop.counters)
            if settling is not None:
                point = with_force_harmonics(bench, plan, target, point, int(settling["left_alone"]))
            point = with_heavy_damping(point)
            if refused_for_a_transient(point, bench, rows, faults + lost, steady):
                self.passing.add(point.number)
            point = with_images(bench, point, self.images, damping=self.kind.asks_for_damping)
            out.append(replace(point, rows=where))
        return out

    def _report_rest(self) -> None:
        """Wait for points still being evaluated, even after a failure elsewhere or in one of them, and report them."""
        while self.evaluations:
            for point in self._anyway(self.evaluations.take) or ():
                self._anyway(self._report, point)

    def _begin(self, segment: int) -> int:
        if self.plan.evaluates_approach:
            segment = self._point_begins(segment)
        return int(self.tick.outcomes[segment]["first_sample"])

    def _point_begins(self, segment: int) -> int:
        """Return the first segment of the point that a segment belongs to."""
        points = self.tick.arrays.segments["point"]
        while segment > 0 and points[segment - 1] == points[segment]:
            segment -= 1
        return segment

    def _first_needed(self) -> int:
        outcomes, segments, index = self.tick.outcomes, self.tick.arrays.segments, self.next_segment
        if index >= outcomes.size:
            return self.tick.sample
        if (first := self.start.first_needed()) is not None:
            return first
        code, of_a_point = int(outcomes[index]["outcome"]), int(segments[index]["point"]) >= 0
        needed = code == Outcome.RUNNING
        if self.batched and of_a_point:
            needed = code != Outcome.PENDING
        elif self.plan.evaluates_approach and of_a_point:
            needed = needed or (index > 0 and segments[index - 1]["point"] == segments[index]["point"])
        else:
            needed = needed and int(segments[index]["kind"]) in EVALUATED
        return self._begin(index) if needed else self.tick.sample

    def _finish_round(self, *, cut_short: bool = False) -> bool:
        """Evaluate points that are measured together, once all their segments are over or no further segment will run."""
        numbers = self.plan.together(int(self.tick.arrays.segments[self.next_segment]["point"]))
        found = round_at(self.tick, self.next_segment, numbers, cut_short=cut_short)
        if found is None:
            return False
        first, passages = found.first_sample, found.passages
        rows = self.kept.take(first, first + passages[-1].end)
        targets = [self.targets[number] for number in sorted(numbers - self.measured_before)]
        ended = self._why() if found.ended_early else ""
        faults = self._faults(self.next_segment, found.end_segment, settled=False)
        self.evaluations.ask(self._measured, first, rows, faults, targets, passages=passages, ended=ended)
        self.next_segment = found.end_segment
        return True

    def _report(self, point: Point[object]) -> None:
        """Write and show a point under its number in the recording, which a change of plan does not alter."""
        point = with_plausibility(self.bench, self.plan, with_disorder(point, self.loop.counters), self.known)
        point, refusal = self.scale.applied(point)
        if refusal:
            self.loop.request_stop(refusal)
        if self.kind.watch is not None:
            point, stop = self.kind.watch(self.plan, self.known, point)
            if stop:
                self.loop.request_stop(stop)
        if point.quality is Quality.GOOD and point.warnings:
            point = replace(point, quality=Quality.WARNED)
        number = point.number
        point = after_attempts(point, self.attempts.get(number, ()))
        if point.quality is not Quality.REJECTED or point.attempts > self.plan.retries:
            self.passing.discard(number)
        again = isinstance(self.plan, SettledPlan) and point.attempts < self.plan.lost_lock_attempts
        if point.quality is Quality.LOST_LOCK and again:
            self.lost_lock.add(number)
        point = replace(point, number=self.numbers[number])
        self.known.append(point)
        self._write("point", self.journal.point, stored(point))
        self.reported[point.number] = point
        self.finished += 1
        self.accepted += 1 if point.accepted else 0
        self.progress.point(point, self.finished, len(self.targets))

    @property
    def to_repeat(self) -> frozenset[int]:
        """Numbers in the plan of points worth another attempt, once the plan was carried out.

        They were refused for something that passes, or have lost their lock, and with these the points that were not reached.
        """
        completed = EndReason(int(self.tick.guard["reason"][0])) is EndReason.COMPLETED and self.loop.failure is None
        if not completed:
            return frozenset()
        places = (target.number for target in self.targets if target.number not in self.measured_before)
        untried = {place for place in places if self.lost_lock and self.numbers[place] not in self.reported}
        return frozenset(self.passing | self.lost_lock | untried)

    def measured_before_repeat(self, points: Iterable[Mapping[str, object]]) -> MeasuredBefore:
        """Return what was measured before the next attempts at `to_repeat`; ``points``: all of the recording."""
        known = tuple[Point[object], ...](point_from(table, self.kind.result) for table in points)
        return measured_before_repeat(self.numbers, known, self.to_repeat, self.attempts)

    def _mark_unlocked(self) -> None:
        if EndReason(int(self.tick.guard["reason"][0])) not in NO_LOCK:
            return
        entry = next(one for one in self.tick.outcomes[::-1] if int(one["outcome"]) in UNLOCKED)
        for target in self.targets:
            left = target.number not in self.measured_before
            if left and self.numbers[target.number] not in self.reported:
                self._report(failed_point(self.plan, target, entry, at_start=True))

    def _mark_interrupted(self) -> None:
        if self.batched:
            index, segments = self.next_segment, self.tick.arrays.segments
            if index < segments.size and int(segments[index]["point"]) >= 0:
                self._finish_round(cut_short=True)
            return
        for segment, entry in zip(self.tick.arrays.segments, self.tick.outcomes, strict=True):
            if int(entry["outcome"]) == Outcome.INTERRUPTED and int(segment["point"]) >= 0:
                number = int(segment["point"])
                self._report(failed_point(self.plan, self.targets[number], entry, locked=self.locked))

    def _end(self) -> End:
        reason = EndReason(int(self.tick.guard["reason"][0]))
        if self.scale.refused and reason is EndReason.STOP_REQUESTED:
            reason = EndReason.START_REFUSED
        if self.loop.failure is not None and not reason.is_trip:
            reason = end_reason_of(self.loop.failure)  # the driver failed when it was stopped, after ramp-down
        return {
            "completed": reason is EndReason.COMPLETED and self.accepted == len(self.targets) and self.failure is None,
            "reason": reason.name.lower(),
            "text": self._why(),
            "tripped": reason.is_trip,
            **(self._trip(reason) if reason.is_trip else {}),
            "skipped": skipped_summary(self.reported.values(), len(self.targets) - self.done),
            "loop": dict(self.loop.report),
            "counters": self.loop.counters,
        }

    def _trip(self, reason: EndReason) -> End:
        """Return where in the plan the run tripped, the most likely cause, and what to do."""
        at = tripped_at(self.tick, self.plan, self.targets)
        frequency_hz = self.tick.frequency_hz
        trip = Trip(reason, int(self.tick.guard["channel"][0]), frequency_hz)
        recorded = [point for point in self.known if point.spectrum is not None or point.accepted]
        points = [point for point in recorded if point.quality is not Quality.IMPLAUSIBLE]
        first = not points and (self.batched or len(self.reported) <= 1)
        advice = advice_on(trip, self.bench, self.plan, at, Before(points, self.locked, first))
        return {
            "tripped_at": None if at is None else at._asdict(),
            "likely_cause": advice.likely_cause,
            "what_to_do": advice.what_to_do,
        }

    def _why(self) -> str:
        """Return in one sentence why the output was brought down."""
        reason = EndReason(int(self.tick.guard["reason"][0]))
        if self.loop.failure is not None:
            down = "" if reason.is_trip else f"{reason.text}, but the driver failed at the end: "
            return f"{down}{self.loop.failure}"
        if self.failure is not None and not self.loop.cause:
            return f"stopped by an error outside the loop: {type(self.failure).__name__}: {self.failure}"
        if self.loop.cause and reason is EndReason.STOP_REQUESTED:
            return self.loop.cause
        return describe_end(self.tick.guard, self.bench)


def end_without_measuring(bench: Bench) -> End:
    """Return the end record of a part in which nothing moved, because all points of the plan had been measured before."""
    return {
        "completed": True,
        "reason": EndReason.COMPLETED.name.lower(),
        "text": "nothing was left to measure",
        "tripped": False,
        "skipped": "",
        "loop": dict(LoopStatistics(bench.sample_rate_hz).report(0)),
        "counters": {},
    }

"""The runner: carries out a plan on a bench and records it. However a run ends, the output is brought to 0 V."""

from collections.abc import Callable, Iterator, Set
from contextlib import AbstractContextManager, contextmanager
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import cast

from pydantic import TypeAdapter, ValidationError

import vibrolock
from rig.arming.bench_memory import RememberedTrip, known_scale, memory_of, now, remember
from rig.arming.checked_scale import CheckedScale
from rig.arming.rehearsed import Rehearsed, rehearsal_facts
from rig.arming.run_facts import calibration_remarks, unproven_phase
from rig.arming.run_options import Progress, RunOptions
from rig.bench import Bench
from rig.bench.user_code import imported_code, refuse_code
from rig.campaigns.evaluation.stored_point import point_from, stored
from rig.campaigns.kinds import KINDS
from rig.campaigns.planning.lengths import check_length
from rig.campaigns.planning.locked import LockedPlan
from rig.campaigns.planning.plan import Plan
from rig.campaigns.running.attempts import MeasuredBefore
from rig.campaigns.running.continuation import remaining
from rig.campaigns.running.device_queue import armed_with_queue, settled_queue, with_queue
from rig.campaigns.running.execution import Execution, end_without_measuring
from rig.campaigns.running.output_file import back_up, forget_before, prepare_output, restore_backup
from rig.campaigns.running.settings import tick_settings
from rig.campaigns.running.tripped_level import refuse_tripped
from rig.campaigns.running.watched import watched_facts
from rig.errors import ConfigurationError, RecordingError, RigError
from rig.live.publisher import Live, published
from rig.loop.session import RunningLoop, Session, open_session
from rig.recording.conversion import continue_recording, finalise
from rig.recording.header import Column, Header
from rig.recording.journal import JournalWriter, journal_path
from rig.recording.reader import Recording
from rig.recording.stored import About, Information
from rig.system.stop_signals import deferred, ended_in_order
from rig.tick.layout import ROW_COLUMNS, recorded_row
from rig.tick.safety.layout import EndReason
from rig.tick.safety.limits import describe_end
from rig.tick.tick import TickSettings


@ended_in_order()
def run_plan(plan: Plan, bench: Bench, output: Path, options: RunOptions | None = None) -> Recording:
    """Carry out a plan from its beginning and record it in the HDF5 file ``output``.

    Raises `ConfigurationError`, before anything starts, if plan and bench do not fit; `RecordingError` if the file exists or
    cannot be written; `rig.errors.DaqError` if the driver cannot be started. A run that ends early raises no error: the
    recording's last part says how it ended. A bench on which something physical moves must be armed (`rig.arming.arming`);
    otherwise `rig.errors.NotArmed` is raised.
    """
    plan.check(bench)
    check_length(plan, bench)
    options = options or RunOptions()
    seed = options.seed or 0
    _restore_backup(output, options.progress)
    prepare_output(output, options.overwrite)
    with _published(plan, bench, output, options) as live:
        with open_session(bench, seed, realtime=options.realtime) as session:
            facts = _facts(plan, bench, session, options, frozenset())
            header = Header(
                kind=plan.kind,
                configuration={
                    "bench": bench.model_dump(mode="json"),
                    "plan": plan.model_dump(mode="json"),
                },
                channels=[channel.model_dump(mode="json") for channel in bench.channels],
                row_dtype=recorded_row(len(bench.channels)),
                columns=[Column(**column) for column in ROW_COLUMNS],
                software_version=vibrolock.__version__,
                started=datetime.now(UTC).isoformat(timespec="seconds"),
                seed=seed,
            )
            _refuse_stopped(live)
            run = _Run(plan, bench, output, options, live)
            with back_up(output):
                journal = partial(JournalWriter.create, journal_path(output), header)
                execution = run.measure(session, journal, {"first_sample": 0, "seed": seed, "about": facts})
        return run.with_further_attempts(_whole(output, options.progress), execution, facts)


@ended_in_order()
def resume_run(
    output: Path,
    options: RunOptions | None = None,
    *,
    change: Plan | None = None,
    source: str | Path = "",
    retry_tripped: bool = False,
    trust_code: bool = False,
) -> Recording:
    """Finish an interrupted run: keep the accepted points and measure the remaining ones in a new part of the file.

    Points that failed are tried again. A ``change`` of the plan, read from ``source``, replaces the current plan from this part
    on; its points that were accepted before are not measured again. If none is missing, nothing is driven, and it is said. A
    complete recording without a change of plan is returned unchanged.

    Raises the same errors as `run_plan`. Also raises `ConfigurationError` for a plan that cannot follow the previous one; for
    a level that tripped or a higher one, unless ``retry_tripped``; and for a bench with functions of the user, unless
    ``trust_code``: the recording names the module to import, so the author of the file chooses the code.
    """
    options = options or RunOptions()
    progress = options.progress
    _restore_backup(output, progress)
    with Recording(output) as recording:
        for number, part in enumerate(recording.parts, 1):
            if part.dropped_reason:
                progress.remark(
                    f"part {number}: {part.dropped_reason}; points whose results are missing are measured again"
                )
        left = remaining(recording, change, source)
        # Each part has its own noise: with the same seed, a new part would repeat the noise of the first.
        drawn = (recording.seed or 0) + len(recording.parts) if options.seed is None else options.seed
        information: Information = {"first_sample": recording.n_rows, "seed": drawn, **left.information()}
        finished = recording.complete and not left.changed
        points = tuple(point_from(table, KINDS[left.plan.kind].result) for table in recording.points)
        before = MeasuredBefore(left.done, left.numbers, points)
        if not retry_tripped:
            refuse_tripped(recording, left.plan, left.to_measure)
        if left.to_measure:
            options = _with_earlier_facts(recording, left.bench, options)
    plan, bench = left.plan, left.bench
    if left.to_measure:
        if not trust_code:
            refuse_code(bench, output.name)
        with _published(plan, bench, output, options) as live:
            for point in points:
                live.line("point", stored(point))
            with open_session(bench, drawn, realtime=options.realtime) as session:
                facts = _facts(plan, bench, session, options, before.done)
                _refuse_stopped(live)
                run = _Run(plan, bench, output, options, live)
                execution = run.measure(session, run.further_journal, {**information, "about": facts}, before)
            return run.with_further_attempts(_whole(output, progress), execution, facts)
    count = "the one point" if len(left.done) == 1 else f"all {len(left.done)} points"
    end = "" if finished else "; its end is written to the file"
    progress.remark(f"nothing is missing: {count} of the plan accepted, nothing is driven{end}")
    if not finished:
        with continue_recording(output) as journal:
            journal.part({**information, "points_done": len(left.done), "device_flags": []})
            journal.end(end_without_measuring(bench))
    return _whole(output, progress) if journal_path(output).exists() else Recording(output)


def _with_earlier_facts(recording: Recording, bench: Bench, options: RunOptions) -> RunOptions:
    """Return the options with rehearsal and check of the last part, where neither they nor the memory of the bench have one."""
    about = recording.parts[-1].information.get("about", {}) if recording.parts else {}
    rehearsal = about.get("rehearsal")
    if options.rehearsal is None and isinstance(rehearsal, dict) and "digest" in rehearsal:
        try:
            options = replace(options, rehearsal=TypeAdapter(Rehearsed).validate_python(rehearsal))
        except ValidationError as error:
            fault = error.errors()[0]
            key = ".".join(str(part) for part in ("rehearsal", *fault["loc"]))
            raise RecordingError(
                f"{recording.path.name}: {key} of its last part: {fault['msg']}; give the rehearsal again"
            ) from None
    if options.check is None and memory_of(bench).check is None:
        options = replace(options, check=_checked(about))
    return options


@dataclass(frozen=True)
class _Run:
    """A plan on its way into a recording, part by part."""

    plan: Plan
    bench: Bench
    output: Path
    options: RunOptions
    live: Live

    def measure(
        self,
        session: Session,
        journal: Callable[[], JournalWriter],
        information: Information,
        before: MeasuredBefore | None = None,
    ) -> Execution:
        """Measure in a new part what ``before`` has left; ``information`` is what the part says of itself."""
        before = before or MeasuredBefore()
        checked = _checked(information["about"])
        segments = self.plan.segments(self.bench.sample_rate_hz, before.done | before.given_up)
        settings = tick_settings(self.plan, self.bench, segments, checked)
        folder = self.output.absolute().parent
        with _unless_empty(journal()) as writer, _started(session, settings, self.output) as loop:
            execution = Execution(
                self.plan,
                self.bench,
                loop,
                writer,
                self.options.progress,
                before,
                folder,
                self.live,
                checked,
                loop.images,
            )
            delay = loop.tick.arrays.loop[0]  # samples from an output to the input that responds to it
            lead_samples = float(delay["delay_whole"]) + float(delay["delay_fraction"])
            about: About = {**information["about"], "lead_samples": lead_samples, "device": session.identity}
            if loop.images:
                about["images"] = [[*image] for image in loop.images]
            execution.run({**information, "about": about})
        return execution

    def further_journal(self) -> JournalWriter:
        """Open the journal of a further part."""
        columns = [Column(**column) for column in ROW_COLUMNS]
        return continue_recording(self.output, row_dtype=recorded_row(len(self.bench.channels)), columns=columns)

    def with_further_attempts(self, recording: Recording, execution: Execution, facts: About) -> Recording:
        """Measure again, in a part of their own, the points that are worth it (`Execution.to_repeat`); return the recording.

        They are approached as the plan says, as in a resumed run, and after a lost lock more slowly. The run stays armed. It
        ends when no such point is left, or none with attempts left, and where the device has latched meanwhile: only a person
        clears that.
        """
        progress = self.options.progress
        while again := execution.to_repeat:
            if not self.live.another_part():
                progress.remark("nothing is measured again: a stop was requested")
                break
            with recording:
                before = execution.measured_before_repeat(recording.points)
                seed = (recording.seed or 0) + len(recording.parts)  # other noise than in the parts before
                first_sample = recording.n_rows
            with open_session(self.bench, seed, realtime=self.options.realtime) as session:
                if session.latched:
                    progress.remark(
                        f"nothing is measured again: {session.latched}; `rig resume {self.output}` continues once armed"
                    )
                    return Recording(self.output)
                if self.live.stop_requested:  # while the device was opened
                    return Recording(self.output)
                names = ", ".join(str(execution.numbers[number] + 1) for number in sorted(again))
                if execution.lost_lock:
                    progress.remark(f"point {names} once more: from the level before, with ramps of twice the length")
                else:
                    progress.remark(f"repeating point {names}: the disturbance may be over")
                try:
                    choice = settled_queue(self.plan, self.bench, session, self.options, before.done | before.given_up)
                except ConfigurationError as error:
                    progress.remark(f"nothing is measured again: {error}")
                    return Recording(self.output)
                about = with_queue({**facts, "device": session.identity}, choice)
                information: Information = {"first_sample": first_sample, "seed": seed, "about": about}
                run = replace(self, plan=slower(execution.plan)) if execution.lost_lock else self
                execution = run.measure(session, self.further_journal, information, before)
            recording = _whole(self.output, progress)
        return recording


def slower(plan: Plan) -> Plan:
    """Return a plan with ramps of twice the length, if it has ramps between levels."""
    periods = getattr(plan, "ramp_periods", None)
    return plan if periods is None else plan.model_copy(update={"ramp_periods": 2.0 * periods})


def _published(plan: Plan, bench: Bench, output: Path, options: RunOptions) -> AbstractContextManager[Live]:
    """Let the run be watched and stopped by other processes of the user, from before its device is opened."""
    started = datetime.now(UTC).isoformat(timespec="seconds")
    told = watched_facts(plan, bench, output, options.about.facts(), started)
    return published(told, len(bench.channels), options.progress.remark)


def _refuse_stopped(live: Live) -> None:
    """Raise `RigError` if a stop was requested before anything was driven."""
    if live.stop_requested:
        raise RigError("stopped by request before anything was driven; nothing was recorded")


def _restore_backup(output: Path, progress: Progress) -> None:
    if told := restore_backup(output):
        progress.remark(told)


def _whole(output: Path, progress: Progress) -> Recording:
    """Convert the journal to the recording's file and return it. A signal ends the program once nothing can be lost."""
    with deferred() as signals:
        damaged = finalise(journal_path(output), output, signals.check)
        forget_before(output)
        if damaged is not None:
            progress.remark(
                f"the journal was damaged and is kept as {damaged.name}; `rig show {output}` says what was lost"
            )
        signals.check(recorded=output)
    return Recording(output)


def _facts(plan: Plan, bench: Bench, session: Session, options: RunOptions, done: Set[int]) -> About:
    """Arm the bench and collect the facts recorded for a part: who armed it, operator, specimen, device, code.

    ``done``: points of the plan that are not measured.
    """
    purpose = options.about.purpose
    rehearsed = {} if purpose else rehearsal_facts(plan, bench, options.rehearsal, options.override_rehearsal)
    virtual = session.capabilities.virtual
    scale, unproven = known_scale(bench, session.identity, options.check, virtual=virtual)
    missing = [unproven, unproven_phase(bench, virtual=virtual)] if isinstance(plan, LockedPlan) else []
    arming, choice = armed_with_queue(plan, bench, session, options, done)
    remarks = [*calibration_remarks(bench, datetime.now(UTC).date()), *filter(None, missing)]
    facts: About = {
        **cast(About, options.about.facts()),
        **({} if scale is None else {"checked": asdict(scale)}),
        **({"rehearsal": rehearsed} if rehearsed else {}),
        "armed": arming,
        "device": session.identity,
        "remarks": remarks,
        "code": imported_code(bench),
    }
    for remark in remarks:
        options.progress.remark(remark)
    return with_queue(facts, choice)


def _checked(facts: About) -> CheckedScale | None:
    """Return the scale with which a part compares its own, of what is recorded of the part; None for what is no scale."""
    try:
        return TypeAdapter(CheckedScale).validate_python(facts["checked"]) if "checked" in facts else None
    except ValueError:
        return None


@contextmanager
def _unless_empty(journal: JournalWriter) -> Iterator[JournalWriter]:
    """Hold a journal open; remove it at the end if no part was begun, because then nothing has run."""
    try:
        with journal:
            yield journal
    finally:
        if journal.n_parts == 0:
            journal.path.unlink(missing_ok=True)


@contextmanager
def _started(session: Session, settings: TickSettings, output: Path) -> Iterator[RunningLoop]:
    """Start a loop and hold it. On a physical bench, remember first that it runs, and at the end whether it tripped.

    A campaign that never ends properly, or that can no longer write, thus leaves a message for the person who arms the next
    one.
    """
    if session.capabilities.virtual:
        yield session.start(settings)
        return
    bench, at = settings.bench, now()
    text = f"a run into {output.absolute()} was under way at {at} and its end was never recorded"
    remember(bench, trip=RememberedTrip(at, text, ""))
    try:
        loop = session.start(settings)
    except RigError:  # nothing but 0 V was put out
        remember(bench, trip=None)
        raise
    try:
        yield loop
    finally:
        _remember_end(bench, loop, output)


def _remember_end(bench: Bench, loop: RunningLoop, output: Path) -> None:
    """Remember a trip or a failure of the driver. After an orderly end, clear the note that a run was under way."""
    reason = EndReason(int(loop.tick.guard["reason"][0]))
    if loop.failure is not None or reason.is_trip:
        text = str(loop.failure) if loop.failure is not None else describe_end(loop.tick.guard, bench)
        remember(bench, trip=RememberedTrip(now(), text, str(output.absolute())))
    elif reason is not EndReason.NONE:
        remember(bench, trip=None)

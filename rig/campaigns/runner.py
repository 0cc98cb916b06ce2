"""The runner: carries out a plan on a bench and records it. Every way out brings the output to 0 V."""

import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from types import FrameType
from typing import Any, Protocol

import numpy as np

import vibrolock
from controller import LockState
from rig.bench import Bench
from rig.campaigns.backbone import BackbonePlan
from rig.campaigns.evaluate import failed_point, measured_point
from rig.configuration import validated
from rig.daq import DAQ
from rig.drivers import make_daq
from rig.errors import ConfigurationError, RecordingError
from rig.loop import Loop
from rig.recording.arrays import kind_of
from rig.recording.header import Column, Header
from rig.recording.journal import JournalWriter, journal_path
from rig.recording.locking import exclusive
from rig.recording.reader import Recording
from rig.recording.store import continue_recording, finalise
from rig.safety.layout import EndReason, GuardMode
from rig.safety.limits import describe_end
from rig.sequencer.layout import Outcome, SegmentKind
from rig.sequencer.segments import Segment
from rig.tick.layout import ROW_COLUMNS
from rig.tick.tick import Tick

__all__ = ["Progress", "carry_out", "take_up"]

OVER = {Outcome.DONE, Outcome.NOT_SETTLED, Outcome.DISTURBED, Outcome.LOST_LOCK, Outcome.UNREACHABLE}


class Progress(Protocol):
    """Whoever wants to watch a run."""

    def point(self, point: dict[str, Any], number: int, total: int) -> None:
        """A point is done, measured or failed; ``number`` of ``total``."""

    def advance(self, rows: np.ndarray, tick: Tick) -> None:
        """A chunk of telemetry has come in."""

    def remark(self, text: str) -> None:
        """The driver has something to say about the bench."""


class _Silent:
    def point(self, point: dict[str, Any], number: int, total: int) -> None:
        pass

    def advance(self, rows: np.ndarray, tick: Tick) -> None:
        pass

    def remark(self, text: str) -> None:
        pass


def carry_out(
    plan: BackbonePlan,
    bench: Bench,
    output: Path,
    *,
    seed: int = 0,
    realtime: bool = False,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> Recording:
    """Carry out a plan from its beginning and record it in the HDF5 file ``output``.

    Raises `ConfigurationError` before anything is started where plan and bench do not fit, `RecordingError` where the
    file exists or cannot be written, `rig.errors.DaqError` where the driver cannot be started. A run that ends early
    raises nothing: the recording's last part says how it ended.
    """
    check(plan, bench)
    make_way(output, overwrite)
    with _armable(bench, seed) as daq:
        daq.start(bench.block)
        tick = _tick(plan, bench, daq, plan.segments())
        header = Header(
            kind=plan.kind,
            configuration={"bench": bench.model_dump(mode="json"), "plan": plan.model_dump(mode="json")},
            channels=[channel.model_dump(mode="json") for channel in bench.channels],
            row_dtype=tick.row_dtype,
            columns=[Column(**column) for column in ROW_COLUMNS],
            software_version=vibrolock.__version__,
            started=datetime.now(UTC).isoformat(timespec="seconds"),
            seed=seed,
        )
        with _set_aside(output), JournalWriter.create(journal_path(output), header) as journal:
            _Run(plan, bench, daq, tick, journal, realtime, progress or _Silent()).go(first_sample=0)
    finalise(journal_path(output), output)
    return Recording(output)


def make_way(output: Path, overwrite: bool) -> None:
    """Refuse an output that cannot or should not be written: no folder, a folder, a file that exists."""
    if not output.parent.is_dir():
        raise RecordingError(f"{output.parent}: there is no such folder")
    if output.is_dir():
        raise RecordingError(f"{output}: is a folder, the name of a file is wanted")
    for path in (output, journal_path(output)):
        if path.exists() and not overwrite:
            raise RecordingError(f"{path}: exists already; choose another name, or --overwrite")
    if output.exists():
        kind_of(output)  # only what is ours is overwritten


@contextmanager
def _set_aside(output: Path) -> Iterator[None]:
    """Keep an earlier recording under another name until the new one has begun to be written, and put it back if it has not."""
    journal = journal_path(output)
    if journal.exists():
        with exclusive(journal):  # refuses while another run is writing it
            journal.unlink()
    aside = output.with_name(output.name + ".before")
    if output.exists():
        output.replace(aside)
    try:
        yield
    finally:
        if aside.exists():
            if journal.exists():
                aside.unlink()
            else:
                aside.replace(output)


def take_up(
    output: Path,
    *,
    realtime: bool = False,
    progress: Progress | None = None,
) -> Recording:
    """Finish a run that was interrupted: finished points stay, the others are measured in a further part of the file.

    Points that had failed are tried again. A recording that is complete is returned as it is.
    """
    with Recording(output) as recording:
        plan = validated(BackbonePlan, recording.configuration["plan"], f"{output}: plan")
        bench = validated(Bench, recording.configuration["bench"], f"{output}: bench")
        done = frozenset(int(point["number"]) for point in recording.points if point["accepted"])
        first_sample = recording.n_rows
        seed = recording.seed or 0
        parts = len(recording.parts)
    segments = plan.segments(done)
    if not segments:
        if journal_path(output).exists():
            finalise(journal_path(output), output)
        return Recording(output)
    # A further part draws its own noise: the same seed again would repeat the first part's.
    with _armable(bench, seed + parts) as daq:
        daq.start(bench.block)
        tick = _tick(plan, bench, daq, segments)
        with continue_recording(output) as journal:
            _Run(plan, bench, daq, tick, journal, realtime, progress or _Silent(), done).go(first_sample)
    finalise(journal_path(output), output)
    return Recording(output)


def check(plan: BackbonePlan, bench: Bench) -> None:
    """Refuse, before anything moves, what the bench cannot do."""
    name, unit = ("levels_v", "V") if plan.levels_v is not None else ("levels_n", "N")
    largest = bench.limits.voltage_v if plan.levels_v is not None else bench.limits.force_n
    for index, level in enumerate(plan.levels):
        if level > largest:
            raise ConfigurationError(
                f"{name}[{index}] = {level:g} {unit}: the bench {bench.name} allows up to {largest:g} {unit}"
            )
    window, allowed = plan.controller.frequency_window_hz, bench.limits.frequency_hz
    linear = bench.specimen.linear_frequency_hz
    if not window[0] < linear < window[1]:
        raise ConfigurationError(
            f"controller.frequency_window_hz = {list(window)}: allowed is a window around the tested mode's "
            f"specimen.linear_frequency_hz = {linear:g} of the bench {bench.name}"
        )
    highest = int(bench.sample_rate_hz / window[1] / 2.0) - 2
    if plan.harmonics > highest:
        raise ConfigurationError(
            f"harmonics = {plan.harmonics}: allowed is up to {highest} at {bench.sample_rate_hz:g} samples/s"
        )
    if window[0] < allowed[0] or window[1] > allowed[1]:
        raise ConfigurationError(
            f"controller.frequency_window_hz = {list(window)}: the bench {bench.name} allows {list(allowed)} Hz"
        )


def _armable(bench: Bench, seed: int) -> DAQ:
    """The bench's driver, not yet open; refused where something physical would move."""
    daq = make_daq(bench, seed)
    if not daq.capabilities.virtual:
        raise ConfigurationError(f"bench {bench.name}: only virtual rigs can be armed by this version")
    return daq


def _tick(plan: BackbonePlan, bench: Bench, daq: DAQ, segments: tuple[Segment, ...]) -> Tick:
    lead = bench.block + daq.latency_samples
    return Tick(bench, plan.controller, plan.amplitude_law, plan.settle, segments, lead)


class _Run:
    """One part of a recording: the loop, what is written of it, and the points that come out."""

    def __init__(
        self,
        plan: BackbonePlan,
        bench: Bench,
        daq: DAQ,
        tick: Tick,
        journal: JournalWriter,
        realtime: bool,
        progress: Progress,
        done: frozenset[int] = frozenset(),
    ) -> None:
        self.plan, self.bench, self.daq, self.tick = plan, bench, daq, tick
        self.journal, self.progress = journal, progress
        self.loop = Loop(daq, tick, paced=realtime)
        self.targets = plan.targets()
        self.finished = len(done)
        self.failed = 0
        self.next_segment = 0
        self.last = {"lock": int(LockState.SEARCHING), "guard": int(GuardMode.ARMED)}
        self.kept: deque[tuple[int, np.ndarray]] = deque()
        self.write_error: RecordingError | None = None
        self.failure: Exception | None = None

    def go(self, first_sample: int) -> None:
        """Run to the end of the plan or of what can be done of it; raises only what could not be recorded."""
        self._write(self.journal.part, {"first_sample": first_sample, "points_done": self.finished})
        for remark in self.daq.remarks:
            self._write(self.journal.event, {"sample": 0, "what": "remark", "text": remark})
            self._attempt(self.progress.remark, remark)
        with _stop_on_signals(self.tick):
            for rows in self.loop.run():
                self._write(self.journal.rows, rows)
                self._attempt(self._note_changes, rows)
                self._attempt(self._collect, rows)
                self._attempt(self.progress.advance, rows, self.tick)
        self._attempt(self._mark_interrupted)
        self._write(self.journal.end, self._end())
        if self.failure is not None:
            raise self.failure
        if self.write_error is not None:
            raise RecordingError(f"{self.write_error}; `rig resume` measures the rest once it can be written")

    def _attempt(self, step: Callable[..., None], *arguments: Any) -> None:
        """Do what is not the loop; where it fails, the rig is ramped down first and the failure raised at the end."""
        if self.failure is not None:
            return
        try:
            step(*arguments)
        except Exception as error:  # whatever it is: a driven rig is brought down before anything is said
            self.failure = error
            self.tick.request_stop()

    def _write(self, method: Any, what: Any) -> None:
        """Write, or else bring the rig down; the run goes on unrecorded until it stands still."""
        if self.write_error is not None:
            return
        try:
            method(what)
        except RecordingError as error:
            self.write_error = error
            self.tick.request_stop()

    def _note_changes(self, rows: np.ndarray) -> None:
        """Every change of lock state and guard becomes an event, with its sample."""
        first = self.tick.sample - rows.size
        events: list[dict[str, Any]] = []
        for name, kind in (("lock", LockState), ("guard", GuardMode)):
            values = np.concatenate([[self.last[name]], rows[name]])
            for index in np.flatnonzero(np.diff(values.astype(int))):
                state = kind(int(rows[name][index])).name.lower()
                events.append({"sample": first + int(index), "what": name, "state": state})
            self.last[name] = int(rows[name][-1])
        for event in sorted(events, key=lambda event: event["sample"]):
            self._write(self.journal.event, event)

    def _collect(self, rows: np.ndarray) -> None:
        """Keep the rows of the point under way, and evaluate the points that are over."""
        self.kept.append((self.tick.sample - rows.size, rows))
        outcomes, segments = self.tick.outcomes, self.tick.arrays.segments
        while self.next_segment < segments.size:
            entry, kind = outcomes[self.next_segment], int(segments[self.next_segment]["kind"])
            code = Outcome(int(entry["outcome"]))
            if code not in OVER and code is not Outcome.SKIPPED:
                break
            number = int(segments[self.next_segment]["point"])
            if number >= 0 and code is not Outcome.SKIPPED:
                if code is not Outcome.DONE:
                    self._report(failed_point(self.plan, self.targets[number], entry))
                elif kind == SegmentKind.RECORD:
                    rows_of = self._rows(int(entry["first_sample"]), int(entry["end_sample"]))
                    settling = outcomes[self.next_segment - 1]
                    self._report(measured_point(self.bench, self.plan, self.targets[number], rows_of, settling))
            self.next_segment += 1
        self._drop_rows_before(self._first_needed())

    def _first_needed(self) -> int:
        if self.next_segment < self.tick.outcomes.size:
            entry = self.tick.outcomes[self.next_segment]
            records = int(self.tick.arrays.segments[self.next_segment]["kind"]) == SegmentKind.RECORD
            if records and int(entry["outcome"]) == Outcome.RUNNING:
                return int(entry["first_sample"])
        return self.tick.sample

    def _rows(self, first: int, end: int) -> np.ndarray:
        return np.concatenate(
            [rows[max(0, first - start) : max(0, end - start)] for start, rows in self.kept if start < end]
        )

    def _drop_rows_before(self, sample: int) -> None:
        while self.kept and self.kept[0][0] + self.kept[0][1].size <= sample:
            self.kept.popleft()

    def _report(self, point: dict[str, Any]) -> None:
        self._write(self.journal.point, point)
        self.finished += 1
        self.failed += 0 if point["accepted"] else 1
        self.progress.point(point, self.finished, len(self.targets))

    def _mark_interrupted(self) -> None:
        for segment, entry in zip(self.tick.arrays.segments, self.tick.outcomes, strict=True):
            if int(entry["outcome"]) == Outcome.INTERRUPTED and int(segment["point"]) >= 0:
                self._report(failed_point(self.plan, self.targets[int(segment["point"])], entry))

    def _end(self) -> dict[str, Any]:
        guard = self.tick.guard
        reason = EndReason(int(guard["reason"][0]))
        text = describe_end(guard, self.bench)
        if self.loop.failure is not None:
            text = str(self.loop.failure)
        statistics = self.loop.statistics
        return {
            "completed": reason is EndReason.COMPLETED and self.failed == 0,
            "reason": reason.name.lower(),
            "text": text,
            "tripped": reason.is_trip,
            "loop": {
                **asdict(statistics),
                "periods": int(self.tick.arrays.loop["cycles"][0]),
                "realtime_factor": statistics.realtime_factor,
                "end_to_end_factor": statistics.end_to_end_factor,
            },
            "counters": self.daq.counters,
        }


@contextmanager
def _stop_on_signals(tick: Tick) -> Iterator[None]:
    """While the rig is driven, Ctrl-C, SIGTERM, a closed terminal and SIGQUIT ask for a ramp-down, and end nothing.

    Without effect outside the main thread, where Python delivers no signals.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def ask(number: int, frame: FrameType | None) -> None:
        tick.request_stop()

    names = ("SIGINT", "SIGTERM", "SIGHUP", "SIGQUIT")  # the last two not on every system
    numbers = [getattr(signal, name) for name in names if hasattr(signal, name)]
    before = {number: signal.signal(number, ask) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)

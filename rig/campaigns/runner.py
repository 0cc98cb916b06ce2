"""The runner: carries out a plan on a bench and records it. Every way out brings the output to 0 V."""

from datetime import UTC, datetime
from pathlib import Path

import vibrolock
from rig.bench import Bench
from rig.campaigns.continuation import what_is_left
from rig.campaigns.execution import Execution, Progress, Silent, nothing_left
from rig.campaigns.output import make_way, set_aside
from rig.campaigns.plan import Plan
from rig.errors import ConfigurationError
from rig.recording.header import Column, Header
from rig.recording.journal import JournalWriter, journal_path
from rig.recording.reader import Recording
from rig.recording.store import continue_recording, finalise
from rig.sequencer.segments import Segment
from rig.session import Session, TickSettings, open_session
from rig.tick.layout import ROW_COLUMNS

__all__ = ["carry_out", "take_up"]


def carry_out(
    plan: Plan,
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
    plan.check(bench)
    make_way(output, overwrite)
    with open_session(bench, seed, realtime=realtime) as session:
        _require_armed(bench, session)
        loop = session.start(_settings(plan, bench, plan.segments(bench.sample_rate_hz)))
        header = Header(
            kind=plan.kind,
            configuration={"bench": bench.model_dump(mode="json"), "plan": plan.model_dump(mode="json")},
            channels=[channel.model_dump(mode="json") for channel in bench.channels],
            row_dtype=loop.tick.row_dtype,
            columns=[Column(**column) for column in ROW_COLUMNS],
            software_version=vibrolock.__version__,
            started=datetime.now(UTC).isoformat(timespec="seconds"),
            seed=seed,
        )
        with set_aside(output), JournalWriter.create(journal_path(output), header) as journal:
            Execution(plan, bench, loop, journal, progress or Silent()).go({"first_sample": 0, "seed": seed})
    finalise(journal_path(output), output)
    return Recording(output)


def take_up(
    output: Path,
    *,
    change: Plan | None = None,
    source: str | Path = "",
    seed: int | None = None,
    realtime: bool = False,
    progress: Progress | None = None,
) -> Recording:
    """Finish a run that was interrupted: finished points stay, the others are measured in a further part of the file.

    Points that had failed are tried again. A ``change`` of the plan, read from ``source``, takes the place of the one in
    force with that part: what it asks for and was accepted before is not measured again. ``seed`` draws the noise of the
    part. A recording that is complete and asked for nothing new is returned as it is.

    Raises as `carry_out`, and `ConfigurationError` for a plan that cannot follow on the one before.
    """
    with Recording(output) as recording:
        left = what_is_left(recording, change, source)
        # A further part draws its own noise: the same seed again would repeat the first part's.
        drawn = (recording.seed or 0) + len(recording.parts) if seed is None else seed
        information = {"first_sample": recording.n_rows, "seed": drawn, **left.information()}
        finished = recording.complete and not left.changed
    plan, bench = left.plan, left.bench
    segments = plan.segments(bench.sample_rate_hz, left.done)
    if segments:
        with open_session(bench, drawn, realtime=realtime) as session:
            _require_armed(bench, session)
            loop = session.start(_settings(plan, bench, segments))
            columns = [Column(**column) for column in ROW_COLUMNS]
            with continue_recording(output, row_dtype=loop.tick.row_dtype, columns=columns) as journal:
                Execution(plan, bench, loop, journal, progress or Silent(), left.done, left.numbers).go(information)
    elif not finished:
        with continue_recording(output) as journal:
            journal.part({**information, "points_done": len(left.done), "device_flags": []})
            journal.end(nothing_left(bench))
    if journal_path(output).exists():
        finalise(journal_path(output), output)
    return Recording(output)


def _require_armed(bench: Bench, session: Session) -> None:
    """Refuse where something physical would move."""
    if not session.capabilities.virtual:
        raise ConfigurationError(f"bench {bench.name}: only virtual rigs can be armed by this version")


def _settings(plan: Plan, bench: Bench, segments: tuple[Segment, ...]) -> TickSettings:
    return TickSettings(
        bench, plan.law, plan.amplitude_law, plan.settle_rule, segments, plan.waveforms(bench.sample_rate_hz)
    )

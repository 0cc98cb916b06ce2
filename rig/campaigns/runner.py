"""The runner: carries out a plan on a bench and records it. Every way out brings the output to 0 V."""

from datetime import UTC, datetime
from pathlib import Path

import vibrolock
from rig.bench import Bench
from rig.campaigns.backbone import BackbonePlan
from rig.campaigns.execution import Execution, Progress, Silent
from rig.campaigns.output import make_way, set_aside
from rig.configuration import validated
from rig.daq import DAQ
from rig.drivers import make_daq
from rig.errors import ConfigurationError
from rig.recording.header import Column, Header
from rig.recording.journal import JournalWriter, journal_path
from rig.recording.reader import Recording
from rig.recording.store import continue_recording, finalise
from rig.sequencer.segments import Segment
from rig.tick.layout import ROW_COLUMNS
from rig.tick.tick import Tick

__all__ = ["carry_out", "check", "take_up"]


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
        with set_aside(output), JournalWriter.create(journal_path(output), header) as journal:
            Execution(plan, bench, daq, tick, journal, realtime, progress or Silent()).go(first_sample=0)
    finalise(journal_path(output), output)
    return Recording(output)


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
            Execution(plan, bench, daq, tick, journal, realtime, progress or Silent(), done).go(first_sample)
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

"""Recorded sweeps as a nonlinear state-space model simulates them, demodulated by the recording's own oscillator."""

from collections.abc import Iterator
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from identification import (
    Channel,
    Experiment,
    IdentificationError,
    PnlssModel,
    Simulation,
    SweepPrediction,
    Transient,
    compare_sweep,
    demodulate,
)
from identification.channels import MOTION_ORDER, find_role
from identification.prediction.simulated_runs import estimated_initial_state
from rig.campaigns.gaps import bridged, lost_rows
from rig.errors import RecordingError
from rig.experiments.build import rows_from_rest
from rig.experiments.records import sweep_pieces
from rig.experiments.signals import Signals
from rig.measurements import bench_of_recording, point_rows, sweeps
from rig.models.predict_sweeps import Swept, force_and_drive
from rig.recording.reader import Recording
from rig.tick.layout import SAMPLE_LOST

__all__ = ["pnlss_sweeps"]

_SHOWN = 10.0
"""Of an unbounded run is shown what is below this many times the largest recorded amplitude."""


def pnlss_sweeps(path: Path, model: PnlssModel) -> Iterator[Swept]:
    """Every accepted sweep of a recording, simulated from rest with the model's own input as it was recorded.

    The fundamentals are those of the predicted drive point, and of the force: imposed, or predicted where the voltage is.
    Raises `RecordingError` where the file holds something else, `identification.IdentificationError` where the model has
    no drive point or no force.
    """
    find_role(model.outputs, "drive")
    with Recording(path) as recording:
        if recording.kind != "sweep":
            raise RecordingError(f"{path}: holds a {recording.kind}, wanted is a sweep recording")
        bench = bench_of_recording(recording)
        same = model.specimen in ("", bench.specimen.name)
        notes = (
            ()
            if same
            else (f"the model is of {model.specimen}, {path} of {bench.specimen.name}: not the same specimen",)
        )
        recorded = sweeps(recording)
        for number, sweep in recorded.items():
            name = path.stem if len(recorded) == 1 else f"{path.stem} [{number}]"
            experiment, theta, more = _record(recording, number, model)
            predicted = _predicted(model, experiment, theta, sweep)
            yield Swept(predicted, force_and_drive(sweep), compare_sweep(predicted, sweep, name=name), (*notes, *more))


def _record(recording: Recording, number: int, model: PnlssModel) -> tuple[Experiment, np.ndarray, tuple[str, ...]]:
    """A sweep at the model's rate, with the oscillator's phase at its counted samples; gaps are bridged."""
    bench = bench_of_recording(recording)
    signals = Signals.chosen(bench, [c.name for c in model.inputs], [c.name for c in model.outputs])
    fs, rate_hz = bench.sample_rate_hz, model.sample_rate_hz
    own = point_rows(recording, number)
    lead = rows_from_rest(recording, number, Fraction(rate_hz / fs))
    rows = np.concatenate([lead, own])
    lost = int(np.count_nonzero(lost_rows(rows)))
    if lost:
        rows["inputs"] = bridged(rows)
        rows["flags"] &= ~np.uint32(SAMPLE_LOST)
    point = dict(recording.latest[number])
    start_hz = float(recording.configuration["plan"]["start_hz"])
    pieces = sweep_pieces(signals, point, rows, lead.size, start_hz=start_hz, rate_hz=rate_hz, name=f"sweep {number}")
    found = next(pieces, None)
    if found is None:
        raise IdentificationError(f"{recording.path}: sweep {number} is too short to be predicted")
    turned = np.unwrap(own["theta_rad"].astype(float))
    theta = np.interp(np.arange(found.counted) * fs / rate_hz, np.arange(turned.size), turned)
    said = (f"{recording.path}: {lost} samples of sweep {number} were lost and are bridged",) if lost else ()
    return found, theta, said


def _predicted(model: PnlssModel, experiment: Experiment, theta: np.ndarray, sweep: Transient) -> SweepPrediction:
    """The simulated sweep as fundamentals; of an unbounded one what came before."""
    begin = estimated_initial_state(model, experiment) if experiment.initial_state == "estimated" else None
    run = model.simulate(experiment.inputs, initial_state=begin)
    first = experiment.counted_from
    force, force_channel = _force(model, experiment, run)
    row = find_role(model.outputs, "drive")
    signals = np.vstack([force, run.outputs[row]])[:, first:]
    stop, notes = signals.shape[1], []
    if run.unbounded_at is not None:
        recorded = float(np.abs(experiment.outputs[row]).max())
        beyond = np.flatnonzero(~(np.abs(signals[1]) <= _SHOWN * recorded))
        stop = int(beyond[0]) if beyond.size else stop
        notes.append(
            f"the run left all bounds {max(run.unbounded_at - first, 0) / model.sample_rate_hz:.2f} s into the sweep: "
            "no errors are given"
        )
    elif run.range_use > 1.0:
        notes.append(f"states or input reach {run.range_use:.2f} times the training data: extrapolated")
    found = _fundamentals(theta[:stop], signals[:, :stop], (force_channel, model.outputs[row]), model, sweep)
    order = MOTION_ORDER[model.outputs[row].motion]
    s = 2j * np.pi * found.frequency_hz
    drive_m = found.fundamentals[1] / s**order
    return SweepPrediction(
        time_s=found.time_s,
        frequency_hz=found.frequency_hz,
        modal_amplitude=np.full(found.time_s.size, complex(np.nan)),
        drive_m=drive_m,
        drive_m_s=s * drive_m,
        drive_m_s2=s**2 * drive_m,
        force=found.fundamentals[0],
        largest_identified=float("nan"),
        window_periods=found.window_periods,
        origin=f"the recorded {', '.join(channel.name for channel in model.inputs)}",
        notes=tuple(notes),
        simulated_range_use=run.range_use,
        unbounded_at_s=None if run.unbounded_at is None else max(run.unbounded_at - first, 0) / model.sample_rate_hz,
    )


def _force(model: PnlssModel, experiment: Experiment, run: Simulation) -> tuple[Any, Channel]:
    """The force at the drive point: imposed, or predicted."""
    for channels, values in ((model.inputs, experiment.inputs), (model.outputs, run.outputs)):
        for channel, row in zip(channels, values, strict=True):
            if channel.role == "force":
                return row, channel
    raise IdentificationError(
        "model: has the force neither among its inputs nor its outputs; identify it with the force"
    )


def _fundamentals(
    theta: np.ndarray, signals: np.ndarray, channels: tuple[Channel, Channel], model: PnlssModel, sweep: Transient
) -> Transient:
    """Demodulated as the recording was; a single instant at rest where a run ended before there was a period to see."""
    try:
        return demodulate(theta, signals, channels, sample_rate_hz=model.sample_rate_hz)
    except IdentificationError:
        if theta.size >= 0.5 * sweep.time_s[-1] * model.sample_rate_hz:
            raise
        nothing = np.zeros((2, 1), dtype=np.complex128)
        return Transient(channels, np.zeros(1), sweep.frequency_hz[:1], nothing, sweep.window_periods)

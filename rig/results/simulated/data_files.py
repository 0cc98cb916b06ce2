"""Files from which experiments are made, recordings and time data of others, and fingerprints that identify their data."""

import hashlib
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from identification import Experiment, IdentificationError, TimeRecords, time_experiments
from identification.experiments import suitable_rate_hz
from rig.measurements import bench_of_recording
from rig.measurements.experiments import default_rate_hz, experiments
from rig.measurements.experiments.build import kinds_with_experiments
from rig.measurements.points_left_out import points_left_out
from rig.recording.arrays import kind_of
from rig.recording.reader import Recording
from rig.results.files import load_as

KINDS = (*kinds_with_experiments(), "time-data")
"""Kinds of files from which experiments are made."""


def time_records_in(path: Path) -> TimeRecords:
    """Load time data."""
    return load_as(TimeRecords, path)


def experiments_in(
    path: Path, rate_hz: float, inputs: Sequence[str], outputs: Sequence[str] | None
) -> tuple[tuple[Experiment, ...], tuple[str, ...]]:
    """Return the experiments in a file, and notes on what is missing.

    Experiments of time data are named after the file and the record. Raises `RecordingError` or `IdentificationError` if there
    are none.
    """
    if kind_of(path) != "time-data":
        with Recording(path) as recording:
            return experiments(recording, rate_hz=rate_hz, inputs=inputs, outputs=outputs), points_left_out(recording)
    try:
        found = time_experiments(time_records_in(path), rate_hz=rate_hz, inputs=inputs, outputs=outputs)
    except IdentificationError as error:
        raise IdentificationError(f"{path}: {error}") from None
    return tuple(replace(one, name=f"{path.stem}, {one.name}") for one in found), ()


def rates_hz_in(path: Path) -> tuple[float, float]:
    """Return the sample rate that suits the data in a file, and the one at which they were recorded, Hz."""
    if kind_of(path) == "time-data":
        records = time_records_in(path)
        return suitable_rate_hz(records), records.sample_rate_hz
    with Recording(path) as recording:
        return default_rate_hz(recording), float(recording.configuration["bench"]["sample_rate_hz"])


def specimen_in(path: Path) -> str:
    """Return the name of the specimen; empty if it has none."""
    if kind_of(path) == "time-data":
        return time_records_in(path).specimen
    with Recording(path) as recording:
        return bench_of_recording(recording).specimen.name


def exciter_in(path: Path) -> str:
    """Return what names the exciter of a test: the bench, or the file of time data."""
    if kind_of(path) == "time-data":
        return path.name
    with Recording(path) as recording:
        return bench_of_recording(recording).name


def features_of(experiment: Experiment) -> str:
    """Describe the data of an experiment to six digits, without its weight, names and files."""
    signals = np.vstack([experiment.inputs, experiment.outputs])
    sizes = [np.sqrt(np.mean(values**2)) for rows in (signals, np.diff(signals)) for values in rows]
    shape = f"{signals.shape} {experiment.counted_from} {experiment.period_samples} {experiment.initial_state}"
    return f"{shape} {[f'{size:.5e}' for size in sizes]}"


def fingerprint(experiment: Experiment) -> str:
    """Return a short text that identifies the data of an experiment."""
    return hashlib.sha256(features_of(experiment).encode()).hexdigest()[:16]


def uses_of(training: Sequence[Experiment], validation: Sequence[Experiment]) -> dict[str, str]:
    """Return the use of experiments in a model, ``training`` or ``validation``, by their fingerprints."""
    return {fingerprint(one): "validation" for one in validation} | {fingerprint(one): "training" for one in training}

"""Evaluate free decays in recordings."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from identification import Channel, DecayBackbone, decay_backbone
from rig.campaigns.evaluation.point import point_name
from rig.campaigns.evaluation.stored_point import point_from
from rig.campaigns.evaluation.vibrations import channels_of
from rig.campaigns.kinds import KINDS as CAMPAIGNS, kinds_that_yield
from rig.errors import ConfigurationError, RecordingError
from rig.measurements import bench_of_recording, decays, point_rows
from rig.recording.arrays import kind_of
from rig.recording.reader import Recording
from rig.results.decay_backbone.options import DecayOptions
from rig.results.kind import Progress

_Record = tuple[NDArray[np.float64], tuple[Channel, ...], float, str]
"""Samples float[n_channels, n] in SI units, channels, sample rate (Hz), and name of the specimen."""


def identify(paths: Sequence[Path], options: DecayOptions, progress: Progress | None = None) -> DecayBackbone:
    """Evaluate the decay in one recorded point of a recording, or in one record of time data.

    The mode shape at the drive point is taken as given in the options; without it a force that acts during the decay, as that
    of an exciter which stays attached, is not taken out.
    """
    if len(paths) != 1:
        raise ConfigurationError(f"`kind` decay: {len(paths)} files given, allowed is one")
    if kind_of(paths[0]) in kinds_that_yield(DecayBackbone):
        return _measured(paths[0], options)
    read = _record_of if kind_of(paths[0]) == "time-data" else _recorded
    samples, channels, sample_rate_hz, specimen = read(paths[0], options.point)
    return decay_backbone(
        samples,
        channels,
        sample_rate_hz=sample_rate_hz,
        near_hz=options.near or None,
        start_s=options.start_s,
        stop_s=options.stop_s,
        drive_mode_shape=options.drive_mode_shape,
        specimen=specimen,
        number=options.levels,
    )


def _measured(path: Path, options: DecayOptions) -> DecayBackbone:
    """Return a decay of a decay campaign: of the given point, or of the one with the largest amplitude."""
    given = [name for name in type(options).model_fields if name in options.model_fields_set - {"point"}]
    if given:
        raise ConfigurationError(f"`{given[0]}`: a decay campaign knows it from its plan; leave it out")
    with Recording(path) as recording:
        found = decays(recording)
    if options.point is not None and options.point - 1 not in found:
        known = ", ".join(str(number + 1) for number in found)
        raise RecordingError(f"{path}: {point_name(options.point - 1)}: holds no decay; points {known} do")
    if options.point is not None:
        return found[options.point - 1]
    return max(found.values(), key=lambda one: float(one.mode().amplitude_m[0]))


def _record_of(path: Path, point: int | None) -> _Record:
    from rig.results.simulated.data_files import time_records_in  # loads what recordings need not wait for

    found = time_records_in(path)
    if point is None and len(found.records) > 1:
        raise ConfigurationError(
            f"`point`: is missing, {path} has {len(found.records)} records; allowed are their numbers"
        )
    if point is not None and point > len(found.records):
        raise ConfigurationError(
            f"`point` = {point}: {path} has {len(found.records)} records, allowed are their numbers"
        )
    samples = found.records[(point or 1) - 1].samples
    return samples, found.channels, found.sample_rate_hz, found.specimen


def _recorded(path: Path, point: int | None) -> _Record:
    kind = kind_of(path)
    if kind not in CAMPAIGNS:
        raise RecordingError(f"{path}: holds a {kind}; a decay comes from a recording or from time data")
    with Recording(path) as recording:
        known = sorted({one.number for one in map(point_from, recording.points) if one.rows is not None})
        if not known:
            raise RecordingError(f"{path}: holds no samples of any point")
        if point is None and len(known) > 1:
            listed = ", ".join(str(number + 1) for number in known)
            raise ConfigurationError(f"`point`: is missing, {path} has samples of points {listed}")
        number = known[0] if point is None else point - 1
        if number not in known:
            raise RecordingError(f"{path}: {point_name(number)}: nothing was recorded of it")
        bench = bench_of_recording(recording)
        rows = point_rows(recording, number)
    samples = np.asarray(rows["inputs"].T, np.float64)
    if np.isnan(samples).any():
        raise RecordingError(f"{path}: {point_name(number)}: samples were lost; a decay needs all of them")
    return samples, channels_of(bench), bench.sample_rate_hz, bench.specimen.name

"""What a file of ours holds, as objects that can be exchanged."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from identification import ModalAnalysis
from rig.campaigns.evaluation.point import point_name
from rig.campaigns.evaluation.stored_point import point_from
from rig.campaigns.evaluation.vibrations import VOLTAGE, channels_of
from rig.campaigns.kinds import KINDS as CAMPAIGNS
from rig.errors import ConfigurationError, RecordingError
from rig.exchange.time_data import TimeData
from rig.measurements import bench_of_recording, point_rows
from rig.models.files.files import load
from rig.models.files.force_surface import MeasuredSurface
from rig.models.files.pnlss import IdentifiedPnlss
from rig.recording.arrays import kind_of
from rig.recording.reader import Recording

__all__ = ["DATA", "read_objects"]

DATA = ("results", "time")
"""What can be taken from a recording."""


def read_objects(path: Path, data: str = "results", points: Sequence[int] = ()) -> list[Any]:
    """The objects in a file of ours: one, but for the levels of a multisine, sweeps, time data by point, modes with responses.

    Parameters
    ----------
    path
        A recording, model or imported measurement.
    data
        ``results`` (what `rig.measurements` makes of a recording) or ``time`` (the samples of its points).
    points
        Stored numbers, from 0, of the points whose samples are wanted; all that were recorded if empty.

    Raises
    ------
    RecordingError
        If the file cannot be read, holds no such point or nothing of that kind.
    """
    if data not in DATA:
        raise ConfigurationError(f"`data` = {data!r}: allowed is {' or '.join(DATA)}")
    kind = kind_of(path)
    if kind in CAMPAIGNS:
        with Recording(path) as recording:
            return _time_data(recording, points) if data == "time" else CAMPAIGNS[kind].exchanged(recording)
    if data == "time" or points:
        raise RecordingError(f"{path}: holds a {kind}; samples of points are in recordings")
    found = load(path)
    if isinstance(found, MeasuredSurface):
        return [found.responses]
    if isinstance(found, IdentifiedPnlss):
        return [found.model]
    if isinstance(found, ModalAnalysis):
        return [found.modes] if found.responses is None else [found.modes, found.responses]
    return [found]


def _time_data(recording: Recording, points: Sequence[int]) -> list[Any]:
    """Samples of points in SI as they were recorded, with the output's voltage as the last channel."""
    bench = bench_of_recording(recording)
    known = sorted({point.number for point in map(point_from, recording.points) if point.rows is not None})
    if unknown := sorted(set(points) - set(known)):
        there = ", ".join(str(number + 1) for number in known)
        raise RecordingError(f"{point_name(unknown[0])}: nothing was recorded of it; there are {there}")
    empty = TimeData((*channels_of(bench), VOLTAGE), np.zeros((len(bench.channels) + 1, 1)), bench.sample_rate_hz)
    out = []
    for number in points or known:
        rows = point_rows(recording, number)
        samples = np.vstack([rows["inputs"].T, rows["output_v"][None]])
        out.append(replace(empty, samples=samples, point=number, specimen=bench.specimen.name))
    if not out:
        raise RecordingError("the recording holds no samples of any point")
    return out

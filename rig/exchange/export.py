"""Reads the objects in a file of the bench and writes them for other programs."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from identification import IdentificationError, ModalAnalysis
from rig.campaigns.evaluation.point import point_name
from rig.campaigns.evaluation.stored_point import point_from
from rig.campaigns.evaluation.vibrations import VOLTAGE, channels_of
from rig.campaigns.kinds import KINDS as CAMPAIGNS
from rig.errors import ConfigurationError, RecordingError, RigError
from rig.exchange.csv import write_csv
from rig.exchange.kinds import taken_apart
from rig.exchange.mat import write_mat
from rig.exchange.time_data import TimeData
from rig.exchange.uff.writing import write_uff
from rig.measurements import bench_of_recording, point_rows
from rig.models.files.files import load
from rig.models.files.force_surface import MeasuredSurface
from rig.models.files.pnlss import IdentifiedPnlss
from rig.recording.arrays import kind_of
from rig.recording.reader import Recording
from rig.system.whole_file import whole_file
from rig.text.contents import Contents

__all__ = ["DATA", "export_file", "read_objects", "write_contents"]

DATA = ("results", "time")
"""Choices of what is taken from a recording."""


def read_objects(path: Path, data: str = "results", points: Sequence[int] = ()) -> list[Any]:
    """The objects in a file of the bench: one, or several (levels of a multisine, sweeps, time data, modes with responses).

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


_WRITERS = {"mat": write_mat, "uff": write_uff, "csv": write_csv}


def export_file(
    source: Path, output: Path, format_: str, *, data: str = "results", points: tuple[int, ...] = (), item: int = 0
) -> list[Contents]:
    """Write the objects in ``source`` (see `read_objects`), or one of them by its number from 1, in another format.

    Returns what was written. Raises `RecordingError` where it cannot be read or written; ``output`` is then as it was.
    """
    try:
        found = [taken_apart(value) for value in read_objects(source, data, points)]
    except IdentificationError as error:
        raise RecordingError(f"{source}: {error}") from None
    if item and not 1 <= item <= len(found):
        raise RecordingError(f"`item` = {item}: {source} holds 1 to {len(found)}")
    chosen = [found[item - 1]] if item else found
    loose = next((one for one in chosen if not one.rows), None)
    if loose is not None and format_ != "mat":
        raise RecordingError(
            f"{source}: {loose.kind} is matrices and no table, for which {format_} has no place; use mat"
        )
    write_contents(chosen, output, format_)
    return chosen


def write_contents(items: list[Contents], output: Path, format_: str) -> None:
    """Write contents in a format, whole or not at all."""
    with whole_file(output) as part:
        try:
            _WRITERS[format_](items, part)
        except RigError as error:
            raise type(error)(f"{output}: {error}") from None

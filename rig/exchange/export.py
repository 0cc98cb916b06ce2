"""Read the objects in a file of this program and write them for other programs."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from identification import IdentificationError
from rig.campaigns.evaluation.point import point_name
from rig.campaigns.evaluation.stored_point import point_from
from rig.campaigns.evaluation.vibrations import VOLTAGE, channels_of
from rig.campaigns.kinds import KINDS as CAMPAIGNS
from rig.errors import ConfigurationError, RecordingError, RigError
from rig.exchange.conversion import encoded
from rig.exchange.csv import write_csv
from rig.exchange.mat import write_mat
from rig.exchange.uff.writing import write_uff
from rig.measurements import bench_of_recording, point_rows
from rig.recording.arrays import kind_of
from rig.recording.reader import Recording
from rig.results.files import load
from rig.results.kinds import KINDS
from rig.results.time_data.series import TimeData
from rig.system.whole_file import whole_file
from rig.text.contents import Contents

DATA = ("results", "time")
"""Choices of data to take from a recording."""
ENCODINGS = ("ascii", "binary")
"""Choices of the encoding of functions in a universal file."""


def read_objects(path: Path, data: str = "results", points: Sequence[int] = ()) -> list[Any]:
    """Return the objects in a file: one or several (levels of a multisine, sweeps, time data, modes with responses).

    ``path`` is a recording, model or imported measurement. ``data`` is ``results`` (measurements of a recording, see
    `rig.measurements`) or ``time``: the samples of its ``points`` by their stored numbers, from 0; if empty, of all recorded.
    Raises `RecordingError` if the file cannot be read, or does not contain such points or data.
    """
    ConfigurationError.unless_one_of("data", data, DATA)
    kind = kind_of(path)
    if kind in CAMPAIGNS:
        with Recording(path) as recording:
            return _time_data(recording, points) if data == "time" else CAMPAIGNS[kind].exchanged(recording)
    if data == "time" or points:
        raise RecordingError(f"{path}: holds a {kind}; samples of points are in recordings")
    return KINDS[kind].objects_of(load(path))


def _time_data(recording: Recording, points: Sequence[int]) -> list[Any]:
    """Return the samples of points in SI units as recorded, with the output voltage as the last channel."""
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


def export_file(
    source: Path,
    output: Path,
    format_: str,
    *,
    data: str = "results",
    points: tuple[int, ...] = (),
    item: int = 0,
    encoding: str = "",
) -> list[Contents]:
    """Write the objects in ``source`` (see `read_objects`), or one of them by its number from 1, in another format.

    ``encoding`` of a universal file is ``ascii`` or ``binary``; by default its time data are binary and all else is ASCII.
    Returns the written contents. Raises `RecordingError` if reading or writing fails; ``output`` is then unchanged.
    """
    try:
        found = [encoded(value) for value in read_objects(source, data, points)]
    except IdentificationError as error:
        raise RecordingError.of(error, where=source) from None
    if item and not 1 <= item <= len(found):
        raise RecordingError(f"{source} holds 1 to {len(found)}", field="item", value=item)
    chosen = [found[item - 1]] if item else found
    loose = next((one for one in chosen if not one.rows), None)
    if loose is not None and format_ != "mat":
        raise RecordingError(
            f"{source}: {loose.kind} is matrices and no table, for which {format_} has no place; use mat"
        )
    write_contents(chosen, output, format_, encoding)
    return chosen


def write_contents(items: list[Contents], output: Path, format_: str, encoding: str = "") -> None:
    """Write contents in a format, a universal file in an encoding. The file is written completely or not at all."""
    if encoding and (encoding not in ENCODINGS or format_ != "uff"):
        raise ConfigurationError(field="encoding", value=encoding, allowed=f"{' or '.join(ENCODINGS)}, of format uff")
    with whole_file(output) as part:
        try:
            if format_ == "uff":
                write_uff(items, part, encoding)
            else:
                (write_mat if format_ == "mat" else write_csv)(items, part)
        except RigError as error:
            raise type(error)(f"{output}: {error}") from None

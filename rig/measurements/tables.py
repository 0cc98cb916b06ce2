"""Recordings as tables of pandas and xarray, with units. Both libraries are optional: ``pip install 'vibrolock[tables]'``."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from rig.campaigns.evaluation.point import Point
from rig.campaigns.evaluation.stored_point import point_from, value_of
from rig.campaigns.evaluation.stored_samples import StoredSamples
from rig.campaigns.kinds import KINDS
from rig.errors import RecordingError
from rig.recording.parts import Part
from rig.recording.reader import Recording
from vibrolock.units import unit_of

if TYPE_CHECKING:
    import pandas
    import xarray

ABOUT = ("direction", "repeat", "settled", "quality", "reason")
"""What is known of a point of any kind besides its level and results."""


def points_table(recording: Recording) -> "pandas.DataFrame":
    """Return the points of the plan in force as a table: one row a point, the columns of its kind of campaign.

    The index is the number of the point as people count it, from 1. Numbers are in the units in which they are stored, which
    ``attrs["units"]`` gives by column (``"1"`` for a ratio); a missing number is NaN. Refused points are included: ``accepted``
    and ``quality`` say it. ``attrs`` also has ``kind``, ``bench`` and ``specimen``.

    Raises ImportError without pandas.
    """
    try:
        import pandas
    except ImportError:
        raise _missing("pandas") from None
    campaign = KINDS[recording.kind]
    points: list[Point[object]] = [point_from(table, campaign.result) for table in recording.latest.values()]
    columns = {
        column.key: np.array([value_of(point, column.key) for point in points], float) for column in campaign.columns
    }
    table = {
        "level": [point.level for point in points],
        **{name: [getattr(point, name) for point in points] for name in ABOUT},
        "accepted": [point.quality.accepted for point in points],
        "warnings": ["; ".join(point.warnings or ()) for point in points],
        "part": [int(stored["part"]) + 1 for stored in recording.latest.values()],
        **columns,
    }
    frame = pandas.DataFrame(table, index=pandas.Index([point.number + 1 for point in points], name="point"))
    units = {  # as stored: tables for people show some in another
        column.key: unit_of(column.key) or "1" if column.scale != 1.0 else column.unit or "1"
        for column in campaign.columns
    }
    bench = recording.configuration["bench"]
    frame.attrs = {
        "kind": recording.kind,
        "bench": bench["name"],
        "specimen": bench["specimen"]["name"],
        "units": {"level": points[0].level_unit if points else "", **units},
    }
    return frame


def telemetry(
    recording: Recording,
    *,
    columns: Sequence[str] | None = None,
    part: int | None = None,
    point: int | None = None,
    from_s: float | None = None,
    to_s: float | None = None,
    every: int = 1,
) -> "xarray.Dataset":
    """Return recorded rows over time: input channels by their names, and the other columns of the rows.

    The dimension is ``time`` (s from the beginning of the part; not evenly spaced where the plan stores one row of several).
    Every variable has ``units`` and ``long_name``, channels also ``role``. Lost samples are NaN in the channels.

    Raises `RecordingError` for a column, part, point or number that there is not, ImportError without xarray.

    Parameters
    ----------
    recording
        The open recording.
    columns
        Names of channels and columns; by default all.
    part
        Number of the part, from 1; by default the last.
    point
        Number of a point, from 1: its record alone, in the part that it was last measured in.
    from_s, to_s
        Time from the beginning of the part, s; ``to_s`` itself is left out.
    every
        One row of so many. It is not filtered: what vibrates faster than half of the remaining rate aliases.
    """
    try:
        import xarray
    except ImportError:
        raise _missing("xarray") from None
    number, samples, found = selected_rows(recording, columns, part, point, from_s, to_s, every)
    rate_hz = float(recording.configuration["bench"]["sample_rate_hz"])
    variables = {name: ("time", values, attributes) for name, values, attributes in found}
    coordinate = ("time", samples / rate_hz, {"units": "s", "long_name": "time from the beginning of the part"})
    facts = {"kind": recording.kind, "part": number, "sample_rate_hz": rate_hz, "started": recording.started}
    return xarray.Dataset(variables, {"time": coordinate}, facts)


def selected_rows(
    recording: Recording,
    columns: Sequence[str] | None,
    part: int | None,
    point: int | None,
    from_s: float | None,
    to_s: float | None,
    every: int = 1,
) -> tuple[int, np.ndarray, list[tuple[str, np.ndarray, dict[str, str]]]]:
    """Return the number of the part, the samples of the rows from its beginning, and name, values and attributes.

    Arguments and errors are those of `telemetry`.
    """
    RecordingError.unless_at_least("every", every, 1)
    number, first, end = _stretch(recording, part, point)
    stored = recording.parts[number]
    rate_hz = float(recording.configuration["bench"]["sample_rate_hz"])
    places = StoredSamples(stored)
    start = max(first, places.rows_before(_sample(from_s, rate_hz)))
    stop = end if to_s is None else min(end, places.rows_before(_sample(to_s, rate_hz)))
    samples = places.samples(np.arange(start, max(start, stop), every))
    return number + 1, samples, _variables(recording, stored, columns, slice(start, stop), every)


def _sample(time_s: float | None, rate_hz: float) -> int:
    return 0 if time_s is None else max(0, int(np.ceil(time_s * rate_hz - 1e-6)))


def _stretch(recording: Recording, part: int | None, point: int | None) -> tuple[int, int, int]:
    """Return the number of the part from 0, and the first row and the one behind the last that are wanted."""
    if point is None:
        count = len(recording.parts)
        number = (count if part is None else part) - 1
        if not 0 <= number < count:
            raise RecordingError(f"{recording.path} has {count} parts, counted from 1", field="part", value=part)
        return number, 0, recording.parts[number].n_rows
    table = recording.latest.get(point - 1)
    if table is None:
        raise RecordingError(
            f"{recording.path} has {', '.join(str(n + 1) for n in recording.latest)}", field="point", value=point
        )
    number = int(table["part"])
    if part is not None and part != number + 1:
        raise RecordingError(f"point {point} is in part {number + 1}", field="part", value=part)
    if table.get("first_sample") is None or table.get("end_sample") is None:
        raise RecordingError(f"it was not recorded ({table['reason']})", field="point", value=point)
    return number, int(table["first_sample"]), int(table["end_sample"])  # numbers of rows


def _variables(
    recording: Recording, part: Part, columns: Sequence[str] | None, rows: slice, every: int
) -> list[tuple[str, np.ndarray, dict[str, str]]]:
    channels = {str(channel["name"]): index for index, channel in enumerate(recording.channels)}
    scalars = {column.name: column for column in part.columns if column.name != "inputs"}
    known = [*channels, *(name for name in scalars if name not in channels)]
    if unknown := [name for name in columns or () if name not in known]:
        raise RecordingError(f"there are {', '.join(known)}", field="columns", value=unknown[0])
    wanted = known if columns is None else list(dict.fromkeys(columns))
    read = range(rows.start, max(rows.start, rows.stop))
    inputs = part.rows("inputs", read.start, read.stop)[::every] if channels.keys() & set(wanted) else None
    out = []
    for name in wanted:
        if name in channels and inputs is not None:
            facts = recording.channels[channels[name]]
            attributes = {"units": facts["unit"], "long_name": f"channel {name}", "role": facts["role"]}
            out.append((name, inputs[:, channels[name]], attributes))
        else:
            attributes = {"units": scalars[name].unit, "long_name": scalars[name].description}
            out.append((name, part.rows(name, read.start, read.stop)[::every], attributes))
    return out


def _missing(library: str) -> ImportError:
    return ImportError(f"{library} is not installed, and tables need it: pip install 'vibrolock[tables]'")

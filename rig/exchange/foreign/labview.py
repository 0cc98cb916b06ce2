"""LabVIEW measurement files (LVM), as National Instruments' specification of the format describes them.

A file has a head of tags, then segments, each with a head of tags for each column and rows of numbers. Segments that follow
each other without a gap are one record; others of equal lengths are records, as columns. Source: "Specification for the LabVIEW
Measurement File (.lvm)", https://www.ni.com/tutorial/4139/en.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from itertools import pairwise
from pathlib import Path

import numpy as np

from rig.exchange.file_data import ChannelFacts, FileData, Value
from rig.exchange.tables.text import blocks, encoding_of
from vibrolock.arrays import Float

_MAGIC, _END = "LabVIEW Measurement", "***End_of_Header***"
_SPECIAL, _END_SPECIAL = "***Start_Special***", "***End_Special***"
_X, _COMMENT = "X_Value", "Comment"
_PRINTED_S = 1e-6  # last digit of instants that LabVIEW prints, s
_GAP = 0.05  # part of a step by which segments that follow each other may be apart; chosen
_SAME = 1e-3  # part of a step by which instants, rates and beginnings may differ; chosen


@dataclass(frozen=True)
class _Column:
    """A channel in one segment."""

    name: str
    values: Float
    unit: str
    step_s: float | None
    """Time between samples; None if the segment gives none, or its instants say otherwise."""
    start_s: float
    """First instant, s, from the beginning of the first day."""

    def precedes(self, other: "_Column") -> bool:
        """Return whether another begins where this one ends."""
        if self.step_s is None:
            return False
        return abs(other.start_s - self.start_s - self.step_s * self.values.size) <= _GAP * self.step_s


@dataclass
class _Segment:
    """Tags and rows of a segment; texts of a tag are in the column that they are about."""

    tags: dict[str, list[str]] = field(default_factory=dict)
    names: list[str] = field(default_factory=list)
    columns: list[list[float]] = field(default_factory=list)


def read_lvm(path: Path) -> FileData:
    """Return the channels by name, with units, rates and starts; raise ValueError if the file cannot be read.

    Instants are among the channels only where they are no even steps of ``Delta_X``.
    """
    lines = (line for _, block in blocks(path, encoding_of(path)) for line in block.split("\n"))
    head = _tags(lines)
    stored = list(_segments(lines, head))
    days = (_day(text) for segment in stored for text in segment.tags.get("Date", []))
    day = next((one for one in days if one is not None), datetime.min)
    segments = [found for segment in stored if (found := _columns(segment, head, day))]
    if not segments:
        raise ValueError("it holds no segment with numbers")
    return _data(segments)


def _tags(lines: Iterator[str]) -> dict[str, str]:
    """Return the tags at the beginning of a file, and ``sign``, the character that separates columns."""
    first = next(lines, "")
    if not first.startswith(_MAGIC):
        raise ValueError(f"it does not begin with '{_MAGIC}'")
    separator = first[len(_MAGIC) : len(_MAGIC) + 1] or "\t"
    tags = {"sign": separator}
    for line in lines:
        key, _, value = line.partition(separator)
        if key == _END:
            return tags
        tags[key] = value.strip(f"{separator} ")
    raise ValueError(f"its head has no end, {_END}")


def _segments(lines: Iterator[str], head: dict[str, str]) -> Iterator[_Segment]:
    separator, decimal = head["sign"], head.get("Decimal_Separator", ".") or "."
    segment, special = _Segment(), False
    for number, line in enumerate(lines, 1):
        cells = line.split(separator)
        if cells[0] in (_SPECIAL, _END_SPECIAL):
            special = cells[0] == _SPECIAL
        elif special or not line.strip(f"{separator} "):
            continue
        elif segment.names and cells[0] == "Channels":  # the head of the next one
            yield segment
            segment = _Segment(tags={cells[0]: cells})
        elif segment.names:
            _add_row(segment, cells, decimal, number)
        elif cells[0].strip() == _X:
            segment.names = [cell.strip() for cell in cells if cell.strip() != _COMMENT]
            segment.columns = [[] for _ in segment.names]
        elif cells[0] != _END:
            segment.tags[cells[0]] = cells
    yield segment


def _add_row(segment: _Segment, cells: Sequence[str], decimal: str, number: int) -> None:
    """Add the numbers of a row; a column ends at its first empty cell."""
    for at, (cell, column) in enumerate(zip(cells, segment.columns, strict=False)):
        if not cell.strip():
            continue
        try:
            value = float(cell.replace(decimal, "."))
        except ValueError:
            raise ValueError(
                f"line {number} after its head, column '{segment.names[at]}': '{cell[:40]}' is not a number"
            ) from None
        if column and len(column) < len(segment.columns[0]) - 1 and at:
            raise ValueError(
                f"line {number} after its head, column '{segment.names[at]}': a number after an empty cell"
            )
        column.append(value)


def _columns(segment: _Segment, head: dict[str, str], day: datetime) -> list[_Column]:
    """Return the channels of a segment, and its instants where they are no even steps."""
    found: list[_Column] = []
    instants: tuple[str, Float] | None = None
    agreed = False  # whether instants that are those of the first channel alone agree with its head
    for at, (name, numbers) in enumerate(zip(segment.names, segment.columns, strict=True)):
        values = np.array(numbers, np.float64)
        if name == _X:
            instants = (name, values) if values.size else None
            continue
        if not values.size:
            continue
        step, start = _number(segment, "Delta_X", at, head), _number(segment, "X0", at, head)
        timed = _text(segment, "X_Dimension", at) in ("", "Time")
        if instants is not None and not agreed and not _even(instants[1][: values.size], step, start):
            found += (
                [] if any(one.values is instants[1] for one in found) else [_Column(*instants, "s" * timed, None, 0.0)]
            )
            step = None
        agreed = agreed or (instants is not None and step is not None and head.get("X_Columns") == "One")
        unit = _text(segment, "Y_Unit_Label", at)
        began = _instant(_text(segment, "Date", at), _text(segment, "Time", at), day)
        found.append(_Column(name, values, unit, step if timed else None, began + (start or 0.0)))
    return found


def _text(segment: _Segment, tag: str, at: int) -> str:
    cells = segment.tags.get(tag, [])
    return cells[at].strip() if at < len(cells) else ""


def _number(segment: _Segment, tag: str, at: int, head: dict[str, str]) -> float | None:
    text = _text(segment, tag, at).replace(head.get("Decimal_Separator", ".") or ".", ".")
    return float(text) if text else None


def _even(instants: Float, step: float | None, start: float | None) -> bool:
    """Return whether instants as they are printed are even steps from the start, as the head says."""
    if step is None or not step > 0.0:
        return False
    said = (start or 0.0) + step * np.arange(instants.size)
    off = np.abs(instants - instants[:1] - (said - said[:1]))
    return bool(np.all(off <= _PRINTED_S + _SAME * step + 1e-6 * np.abs(said)))


def _day(text: str) -> datetime | None:
    try:
        return datetime.strptime(text.strip(), "%Y/%m/%d")
    except ValueError:
        return None


def _instant(date: str, time: str, since: datetime) -> float:
    """Return the time since the beginning of a day, s; 0 if date or time are missing."""
    day, (clock, _, fraction) = _day(date), time.replace(",", ".").partition(".")
    try:
        at = datetime.strptime(clock, "%H:%M:%S")
        part = float(f"0.{fraction or 0}")
    except ValueError:
        return 0.0
    if day is None:
        return 0.0
    return (day - since).total_seconds() + at.hour * 3600.0 + at.minute * 60.0 + at.second + part


def _data(segments: list[list[_Column]]) -> FileData:
    """Return the channels of all segments by name; a name that occurs again is followed by ``#`` and its number."""
    named = [_numbered(segment) for segment in segments]
    names = list(named[0])
    if any(list(one) != names for one in named):
        raise ValueError(f"its segments have different channels ({', '.join(names)}, and others); save them as files")
    values: dict[str, Value] = {}
    facts: dict[str, ChannelFacts] = {}
    earliest = min(one.start_s for one in named[0].values())
    for name in names:
        columns = [one[name] for one in named]
        first = columns[0]
        for key, several in (
            ("Y_Unit_Label", {one.unit for one in columns}),
            ("Delta_X", {one.step_s for one in columns}),
        ):
            if len(several) > 1:
                raise ValueError(f"channel '{name}' has another {key} in each segment; save them as files")
        values[name] = _joined(name, columns)
        facts[name] = ChannelFacts(
            name=first.name,
            unit=first.unit,
            sample_rate_hz=None if first.step_s is None else 1.0 / first.step_s,
            start_s=None if first.step_s is None else first.start_s - earliest,
        )
    return FileData(values=values, channels=facts)


def _joined(name: str, columns: Sequence[_Column]) -> Float:
    """Return one record of segments without gaps, else a column for each: float64[n] or float64[n, n_segments]."""
    if all(one.precedes(two) for one, two in pairwise(columns)):
        return np.concatenate([one.values for one in columns])
    if len({one.values.size for one in columns}) > 1:
        raise ValueError(f"channel '{name}' has segments of unequal lengths with gaps between them; save them as files")
    return np.stack([one.values for one in columns], axis=1)


def _numbered(segment: Sequence[_Column]) -> dict[str, _Column]:
    found: dict[str, _Column] = {}
    for one in segment:
        count = sum(1 for other in found.values() if other.name == one.name)
        found[f"{one.name}#{count + 1}" if count else one.name] = one
    return found

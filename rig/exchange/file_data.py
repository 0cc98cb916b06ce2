"""Content of a file of another program: the one form in which every reader returns it."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from vibrolock.arrays import Float

_EVEN = 1e-3
"""Relative difference of a step from the mean up to which instants are even; chosen: that of time stamps in milliseconds."""

Value = (
    None
    | bool
    | int
    | float
    | complex
    | str
    | bytes
    | np.generic
    | NDArray[np.generic]
    | list["Value"]
    | dict[str, "Value"]
)
"""Value in a file: number, text, array (of objects where it holds cells), list or structure."""


@dataclass(frozen=True, kw_only=True)
class ChannelFacts:
    """What a file says of one of its channels."""

    name: str = ""
    """Name as the file has it; empty where it is the name of the value."""
    unit: str = ""
    """Unit; empty if the file gives none."""
    in_si: bool = False
    """Whether the reader has converted the values to SI, and ``unit`` is that of the converted ones."""
    scale: float | None = None
    """Factor that the file applies to the stored numbers; None if it gives none."""
    offset: float | None = None
    """Offset that the file adds to the scaled numbers; None if it gives none."""
    sample_rate_hz: float | None = None
    """Sample rate of this channel, Hz; None if the file gives none."""
    start_s: float | None = None
    """Time of the first sample, s; None if the file gives none."""


@dataclass(frozen=True, eq=False, kw_only=True)
class FileData:
    """Values in a file, and what the file says of them."""

    values: dict[str, Value]
    """Values by name; a structure has values of its own."""
    channels: dict[str, ChannelFacts] = field(default_factory=dict)
    """What the file says of its channels, by the name of the value."""
    sample_rate_hz: float | None = None
    """Sample rate of all channels, Hz; None if the file gives none."""

    def unit(self, path: str) -> str:
        """Return the unit that the file gives for a value; empty if it gives none."""
        return self.channels[path].unit if path in self.channels else ""

    def for_mapping(self) -> dict[str, object]:
        """Return the values with the facts on sampling, as `identification` maps them."""
        out: dict[str, object] = dict(self.values)
        if self.sample_rate_hz is not None:
            out["sample_rate_hz"] = self.sample_rate_hz
        if any(channel.in_si for channel in self.channels.values()):
            out["units"] = {name: channel.unit for name, channel in self.channels.items()}
        rates = {name: one.sample_rate_hz for name, one in self.channels.items() if one.sample_rate_hz is not None}
        starts = {name: one.start_s for name, one in self.channels.items() if one.start_s is not None}
        return out | ({"__rates_hz__": rates} if rates else {}) | ({"__starts_s__": starts} if starts else {})


@dataclass(frozen=True, eq=False)
class StoredObject:
    """An object of this program as a MAT or CSV file holds it: its kind, its arrays by name, and everything else."""

    kind: str
    arrays: dict[str, NDArray[np.generic]]
    attributes: dict[str, object]


def from_variables(values: dict[str, Value], units: Mapping[str, Value] | None = None) -> FileData:
    """Return the content of a file of named variables.

    ``units`` are those that the file gives by the names of its values. Variables called ``units`` (a structure of texts) and
    ``sample_rate_hz`` (a number) count as what the file says of all others.
    """
    stored = values.get("units")
    given = {**(stored if isinstance(stored, dict) else {}), **(units or {})}
    rate = values.get("sample_rate_hz")
    return FileData(
        values=values,
        channels={name: ChannelFacts(unit=unit) for name, unit in given.items() if isinstance(unit, str) and unit},
        sample_rate_hz=rate if isinstance(rate, float) else None,
    )


def even_step(instants: Float) -> float | None:
    """Return the time between evenly spaced instants, s; None if they are uneven or do not increase."""
    steps = np.diff(instants)
    step = float(steps.mean())
    return step if step > 0.0 and np.all(np.abs(steps - step) <= _EVEN * step) else None


def side_by_side(records: Sequence[Float]) -> Float:
    """Return records as float64[n, n_records], cut to the length of the shortest."""
    shortest = min(map(len, records))
    return np.column_stack([record[:shortest] for record in records])


def in_full(group: Mapping[str, Value], before: str = "") -> Iterator[tuple[str, Value]]:
    """Yield the values within groups by their full names, joined by ``/``; those at the top are left out."""
    for name, value in group.items():
        if isinstance(value, dict):
            yield from in_full(value, f"{before}{name}/")
        elif before:
            yield f"{before}{name}", value


@dataclass(frozen=True)
class MappingText:
    """Proposed mapping: TOML with comments, and the keys that are left to be filled in."""

    text: str
    missing: tuple[str, ...]

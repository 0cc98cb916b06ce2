"""Content of a file of another program: the one form in which every reader returns it."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from vibrolock.arrays import Float
from vibrolock.quantities import SIGNALS, quantity

_IN_BRACKETS = re.compile(r"\s*[\[(]([^\[\]()]*[^\[\]()\d][^\[\]()]*)[\])]$")
_ANYWHERE = re.compile(r"[\[({<]([^\[\](){}<>]*[^\[\](){}<>\d][^\[\](){}<>]*)[\])}>]")
_BEHIND = re.compile(r".*\S(?:\s+/\s*|,\s*|:\s+|\s+in\s+)(\S[^,]*)$")  # Force / kN; Force, kN; Force in kN
_LAST_WORD = re.compile(r".*[^\W_](?:[_ /:]|\s)(ms|us|µs|μs|ns|msec|usec|kN|mN|lbf|mV|mm|um|µm|μm)$")  # force_kN
_ENTRY = re.compile(r"(.+)\[(\d+)\]")
_IN_NAMES = (*SIGNALS, "s")
_READ = 200  # letters of a name in which a unit is sought; chosen: the patterns' time grows with their square

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
    """What a file says of one of its channels, in the words of its format.

    Readers fill in what the file says and change no number; `rig.exchange.facts` uses all of it, in one place. A reader that
    cannot follow what the file says puts that into ``unread``.
    """

    name: str = ""
    """Name as the file has it; empty where it is the name of the value."""
    unit: str = ""
    """Unit; empty if the file gives none."""
    columns: Sequence[str] = ()
    """Units along the dimension of that length, where the value holds several channels; empty if the file gives none."""
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
    reversed: bool = False
    """Whether the file says that the values count in the opposite direction."""
    node: int | None = None
    """Number of the node at which it was measured; None if the file gives none."""
    direction: str = ""
    """Direction at the node, such as ``+Z``; empty if the file gives none."""
    unread: str = ""
    """What the file says of this channel that cannot be followed, in words; a mapping that takes the channel is refused."""

    def __post_init__(self) -> None:
        """Keep the units of columns as a tuple, also where they come as a list."""
        object.__setattr__(self, "columns", tuple(self.columns))


@dataclass(frozen=True, eq=False, kw_only=True)
class FileData:
    """Values in a file, and what the file says of them."""

    values: dict[str, Value]
    """Values by name; a structure has values of its own."""
    channels: dict[str, ChannelFacts] = field(default_factory=dict)
    """What the file says of its channels, by the name of the value."""
    sample_rate_hz: float | None = None
    """Sample rate of all channels, Hz; None if the file gives none."""
    notes: tuple[str, ...] = ()
    """Remarks on what was read and what was left out, one line each."""
    repeated: tuple[str, ...] = ()
    """Names of values that hold others once more; they can be mapped, and are not proposed."""
    begins_s: float | None = None
    """Instant from which the start times of the channels count, s since 1970 (UTC); None if the file gives none."""

    def facts(self, path: str) -> ChannelFacts:
        """Return what the file says of the channel at a path, which may be written with dots for the groups of the file.

        An entry of a value, ``name[2]``, has what the file says of the whole.
        """
        if path in self.channels:
            return self.channels[path]
        whole = next((name for name in self.channels if "/" in name and name.replace("/", ".") == path), "")
        if whole or not (entry := _ENTRY.fullmatch(path)):
            return self.channels.get(whole) or ChannelFacts()
        found, at = self.facts(entry[1]), int(entry[2])
        return replace(found, unit=found.columns[at], columns=()) if at < len(found.columns) else found

    def unit(self, path: str) -> str:
        """Return the unit that the file gives for a value, also in brackets at the end of its name; empty if it gives none."""
        facts = self.facts(path)
        return facts.unit or (facts.columns[0] if len({*facts.columns}) == 1 else "") or unit_in_name(path)


@dataclass(frozen=True, eq=False)
class StoredObject:
    """An object of this program as a MAT or CSV file holds it: its kind, its arrays by name, and everything else."""

    kind: str
    arrays: dict[str, NDArray[np.generic]]
    attributes: dict[str, object]


def from_variables(values: dict[str, Value], facts: Mapping[str, ChannelFacts] | None = None) -> FileData:
    """Return the content of a file of named variables.

    ``facts`` are what the file says of its values, by name. Variables called ``units`` (a structure of texts) and
    ``sample_rate_hz`` (a number) count as what the file says of all others.
    """
    rate, stored = values.get("sample_rate_hz"), values.get("units")
    units = stored if isinstance(stored, dict) else {}
    given = {name: ChannelFacts(unit=unit) for name, unit in units.items() if isinstance(unit, str) and unit}
    return FileData(
        values=values,
        channels={**given, **(facts or {})},
        sample_rate_hz=rate if isinstance(rate, float) else None,
    )


def unit_in_name(name: str) -> str:
    """Return a unit of a signal or of time in a name; empty without one.

    It is in brackets, ``Force [N]``, behind a sign or a word, ``Force / kN``, ``Force, kN``, ``Force in kN``, or one of several
    letters that nothing else means, ``force_kN``, ``time_ms``. Of a long name the last `_READ` letters are looked at.
    """
    name = name[-_READ:]
    last = [found for pattern in (_IN_BRACKETS, _BEHIND, _LAST_WORD) if (found := pattern.search(name)) is not None]
    for text in (*(found[1] for found in last), *_ANYWHERE.findall(name)):
        known = quantity(text)
        if known is not None and known.si in _IN_NAMES:
            return str(text).strip()
    return ""


def without_unit(name: str) -> str:
    """Return a name without a text in brackets at its end."""
    return (name[:-_READ] + _IN_BRACKETS.sub("", name[-_READ:])).strip() or name


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

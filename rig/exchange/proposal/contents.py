"""Contents of a file of another program: arrays by path, single numbers, lists of structures."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from rig.exchange.facts import meant
from rig.exchange.file_data import FileData, Value, without_unit

_NO_DATA = ("sample_rate_hz", "units")  # variables by which a file tells of its data
_MAX_DEPTH = 8  # levels of structures that are listed; chosen
_MAX_VALUES = 2000  # values that are listed; chosen


@dataclass(frozen=True, eq=False)
class Leaf:
    """An array of real numbers."""

    path: str
    """Path as a mapping takes it; relative to the structures of a list if the file has one."""
    values: NDArray[np.generic]
    """The array without dimensions of length 1."""
    unit: str = ""
    """Unit that the file tells; empty if it tells none."""
    file: str = ""
    """Name of the file, if it is a further one."""
    called: str = ""
    """Name that the file gives in another place than the path; empty if it gives none."""

    columns: Sequence[str] = ()
    """Units of its columns, where it holds several channels."""

    @property
    def name(self) -> str:
        """Name that the file gives, or else the last part of the path, without a unit in brackets."""
        if self.called:
            return self.called
        last = self.path.rpartition("/")[2] if "/" in self.path else self.path.rpartition(".")[2]
        return without_unit(last) or self.path


@dataclass(frozen=True, eq=False)
class FileContents:
    """Contents of a file."""

    arrays: tuple[Leaf, ...]
    """Arrays of two numbers and more."""
    single: Mapping[str, float]
    """Single numbers by path."""
    others: Mapping[str, str]
    """Paths of everything else, with what it is."""
    records: str = ""
    """Path of the list of structures in which the arrays are; empty if there is none."""
    rate_hz: float | None = None
    """Sample rate that the file tells; None if it tells none."""
    beside: "FileContents | None" = None
    """What lies beside the list of structures; None without one."""


def contents_of(data: FileData, file: str = "") -> FileContents:
    """Return the contents of what `rig.exchange.sources.read_data` has read; ``file`` is the name of a further file."""
    full_names = any("/" in key for key in data.values)
    top = {
        key: value
        for key, value in meant(data).items()
        if key not in (*_NO_DATA, *data.repeated)
        and not key.startswith("__")
        and not (full_names and isinstance(value, dict))
    }
    records, inside = _list_of_records(top, data.channels)
    arrays: list[Leaf] = []
    single, others = dict[str, float](), dict[str, str]()
    for path, value in islice(_leaves(inside if records else top, "", 0), _MAX_VALUES):
        if unread := data.facts(path).unread:
            others[path] = unread
            continue
        array = np.squeeze(np.asarray(value)) if isinstance(value, np.ndarray | np.generic | int | float) else None
        if array is None or array.dtype.kind not in "biuf":
            others[path] = _what(value)
        elif array.size == 1:
            single[path] = float(array)
        elif array.size:
            facts = data.channels.get(path)
            columns = facts.columns if facts else ()
            called = records.rpartition(".")[2] if path == "." else facts.name if facts else ""
            arrays.append(Leaf(path, array, "" if len(columns) > 1 else data.unit(path), file, called, columns))
    others |= {name: one.unread for name, one in data.channels.items() if one.unread and name not in data.values}
    rate = _rate(data, [leaf.path for leaf in arrays])
    beside = _beside(top, records) if records else None
    return FileContents(tuple(arrays), single, others, records, rate, beside)


def _beside(top: Mapping[str, Value], records: str) -> FileContents:
    """Return the contents of a file beside its list of records."""

    def without(group: Mapping[str, Value], above: str) -> dict[str, Value]:
        paths = {key: f"{above}.{key}" if above else key for key in group}
        kept = {key: value for key, value in group.items() if paths[key] != records}
        return {key: without(value, paths[key]) if isinstance(value, dict) else value for key, value in kept.items()}

    return contents_of(FileData(values=without(top, "")))


def _list_of_records(
    group: Mapping[str, Value], described: Collection[str], above: str = "", depth: int = 0
) -> tuple[str, Mapping[str, Value]]:
    """Return path and first entry of a list of structures or of arrays, one for each record, or an empty path.

    A list of signals is none: the file describes each, by its path in ``described``, or describes signals beside it.
    """
    for key, value in group.items():
        path = f"{above}.{key}" if above else key
        if isinstance(value, dict):
            inside = _list_of_records(value, described, path, depth + 1) if depth + 1 < _MAX_DEPTH else ("", {})
            if inside[0]:
                return inside
            continue
        entries = [] if any(one.startswith(f"{path}[") for one in described) else _entries(value)
        first = entries[0] if entries else None
        if isinstance(first, dict) and all(isinstance(entry, dict) for entry in entries):
            return path, first
        elif (
            len(entries) > 1
            and not any(name in group for name in described)
            and all(_is_long(entry) and _width(entry) == _width(first) for entry in entries)
        ):
            return path, {".": first}
    return "", {}


def _is_long(value: Value) -> bool:
    return isinstance(value, np.ndarray) and value.dtype.kind in "biuf" and value.size > 2


def _width(value: Value) -> tuple[int, ...]:
    return value.shape[1:] if isinstance(value, np.ndarray) else ()


def _leaves(structure: Mapping[str, Value], above: str, depth: int) -> Iterator[tuple[str, Value]]:
    for key, value in structure.items():
        path = f"{above}{'' if key.startswith('[') else '.'}{key}" if above else str(key)
        if isinstance(value, dict) and depth + 1 < _MAX_DEPTH:
            yield from _leaves(value, path, depth + 1)
        elif depth + 1 < _MAX_DEPTH and (entries := _entries(value)):
            yield from _leaves({f"[{index}]": entry for index, entry in enumerate(entries)}, path, depth + 1)
        elif path:
            yield path, value


def _entries(value: Value) -> list[Value]:
    """Return the entries of a list of structures or arrays; none for anything else."""
    if not isinstance(value, list) and not (
        isinstance(value, np.ndarray) and value.dtype.kind == "O" and value.ndim == 1
    ):
        return []
    entries: list[Value] = list(value)
    return entries if all(isinstance(one, dict | np.ndarray) for one in entries) else []


def _what(value: Value) -> str:
    if isinstance(value, str):
        return f"text '{value[:40]}'"
    if isinstance(value, np.ndarray):
        return f"{'complex numbers' if value.dtype.kind == 'c' else 'a list'}, {' x '.join(map(str, value.shape))}"
    return "a list" if isinstance(value, list | tuple) else f"a {type(value).__name__}"


def _rate(data: FileData, paths: list[str]) -> float | None:
    """Return the sample rate of the file, or else the commonest one of its channels."""
    if data.sample_rate_hz is not None:
        return data.sample_rate_hz
    rates = [data.channels[path].sample_rate_hz for path in paths if path in data.channels]
    known = [rate for rate in rates if rate is not None]
    return max(set(known), key=known.count) if known else None

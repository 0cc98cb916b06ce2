"""What a file of somebody else holds: arrays by path, single numbers, lists of structures."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification import IdentificationError
from identification.mapping import si_of

_TOLD = ("sample_rate_hz", "__rates_hz__", "__starts_s__", "units", "__file_units__")
"""Keys by which readers tell of the data; they are no data."""
_IN_BRACKETS = re.compile(r"\s*[\[(]([^\[\]()]+)[\])]$")
_DEEPEST = 8
_MOST = 2000


@dataclass(frozen=True, eq=False)
class Leaf:
    """An array of real numbers.

    Parameters
    ----------
    path
        Path as a mapping takes it; relative to the structures of a list if the file has one.
    values
        The array without dimensions of length 1.
    unit
        Unit that the file tells; empty if it tells none.
    file
        Name of the file, if it is a further one.
    """

    path: str
    values: NDArray[Any]
    unit: str = ""
    file: str = ""

    @property
    def name(self) -> str:
        """Last part of the path, without a unit in brackets."""
        last = self.path.rpartition("/")[2] if "/" in self.path else self.path.rpartition(".")[2]
        return _IN_BRACKETS.sub("", last).strip() or self.path


@dataclass(frozen=True, eq=False)
class FileContents:
    """Contents of a file.

    Parameters
    ----------
    arrays
        Arrays of two numbers and more.
    single
        Single numbers by path.
    others
        Paths of everything else, with what it is.
    records
        Path of the list of structures in which the arrays are; empty if there is none.
    rate_hz
        Sample rate that the file tells; None if it tells none.
    """

    arrays: tuple[Leaf, ...]
    single: Mapping[str, float]
    others: Mapping[str, str]
    records: str = ""
    rate_hz: float | None = None


def contents_of(data: Mapping[str, Any], file: str = "") -> FileContents:
    """Return the contents of what `rig.exchange.sources.read_data` has read; ``file`` is the name of a further file."""
    told = {key: data[key] for key in _TOLD if key in data}
    units: dict[str, Any] = {}
    for key in ("units", "__file_units__"):
        units |= told[key] if isinstance(told.get(key), Mapping) else {}
    in_full = any("/" in key for key in data)
    top = {
        key: value
        for key, value in data.items()
        if key not in told and not key.startswith("__") and not (in_full and isinstance(value, Mapping))
    }
    records, inside = _list_of_structures(top)
    arrays, single, others = [], {}, {}
    for number, (path, value) in enumerate(_leaves(inside if records else top, "", 0)):
        if number >= _MOST:
            break
        array = np.squeeze(value) if isinstance(value, np.ndarray | np.generic | int | float) else None
        if array is None or array.dtype.kind not in "biuf":
            others[path] = _what(value)
        elif array.size == 1:
            single[path] = float(array)
        elif array.size:
            unit = units.get(path) or _unit_in(path)
            arrays.append(Leaf(path, array, unit if isinstance(unit, str) else "", file))
    return FileContents(tuple(arrays), single, others, records, _rate(told, [leaf.path for leaf in arrays]))


def _list_of_structures(top: Mapping[str, Any]) -> tuple[str, Any]:
    """Return path and first entry of a list of structures that holds the only arrays of a file, or an empty path."""
    for key, value in top.items():
        entries = list(value) if isinstance(value, list | np.ndarray) and not _is_numbers(value) else []
        if entries and all(isinstance(entry, Mapping) for entry in entries):
            return key, entries[0]
    return "", {}


def _is_numbers(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.dtype.kind in "biufc"


def _leaves(value: Any, path: str, depth: int) -> Iterator[tuple[str, Any]]:
    if isinstance(value, Mapping) and depth < _DEEPEST:
        for key, item in value.items():
            yield from _leaves(item, f"{path}.{key}" if path else str(key), depth + 1)
    elif path:
        yield path, value


def _unit_in(path: str) -> str:
    """Return a unit in brackets at the end of a name, if it is understood: ``Force [N]``."""
    found = _IN_BRACKETS.search(path)
    try:
        return "" if found is None else found[1].strip() if si_of(found[1], path) else ""
    except IdentificationError:
        return ""


def _what(value: Any) -> str:
    if isinstance(value, str):
        return f"text '{value[:40]}'"
    if isinstance(value, np.ndarray):
        return f"{'complex numbers' if value.dtype.kind == 'c' else 'a list'}, {' x '.join(map(str, value.shape))}"
    return "a list" if isinstance(value, list | tuple) else f"a {type(value).__name__}"


def _rate(told: Mapping[str, Any], paths: list[str]) -> float | None:
    if isinstance(rate := told.get("sample_rate_hz"), float):
        return rate
    rates = told.get("__rates_hz__")
    known = [rates[path] for path in paths if path in rates] if isinstance(rates, Mapping) else []
    return max(set(known), key=known.count) if known else None

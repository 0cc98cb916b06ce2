"""NumPy archives (``.npz``, ``.npy``) and sheets of Excel workbooks (by the package openpyxl) as named arrays."""

import io
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import closing
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.exchange.beside import facts_beside
from rig.exchange.child_values import TooMuchData, most_bytes
from rig.exchange.file_data import ChannelFacts, FileData, Value, from_variables, in_full
from rig.exchange.tables.heading import are_units_above, is_units
from vibrolock.arrays import Float

_MOST_HEAD = 100  # rows that may stand above the names; chosen
_LARGEST_SHEET = 400_000_000  # bytes of unpacked text in a workbook, which becomes more in memory; chosen


def read_npz(path: Path) -> FileData:
    """Return the arrays by name; raise ValueError for objects, which would run code of the file, and damaged ones."""
    most, values = most_bytes(path), dict[str, Value]()
    with zipfile.ZipFile(path) as archive:
        for entry in archive.infolist():
            most -= entry.file_size
            if most < 0:
                raise TooMuchData(most_bytes(path))
            if entry.filename.endswith(".npy"):
                stored = io.BytesIO(archive.read(entry))
                values[entry.filename.removesuffix(".npy")] = _plain(np.load(stored, allow_pickle=False))
    full = {**dict(in_full(values)), **values}
    return from_variables(values, facts_beside(full))


def _plain(array: NDArray[Any]) -> Value:
    if array.dtype.names:
        return {name: _plain(array[name]) for name in array.dtype.names}
    if array.dtype.kind in "US":
        texts = [str(text) for text in array.reshape(-1)]
        return texts[0] if array.ndim == 0 else [*texts]
    if array.dtype.kind not in "biufc":
        return f"<{array.dtype}>"
    return array[()] if array.ndim == 0 else array


def read_workbook(path: Path) -> FileData:
    """Return the columns of the sheets by name: of the only sheet with numbers, or of all by ``sheet/name``.

    A row of names, one of units below or above it, which may be missing, and rows of numbers make a sheet. Raises
    ValueError, with the cell, for what is no number, ImportError without openpyxl.
    """
    from openpyxl import load_workbook

    with zipfile.ZipFile(path) as archive:
        size = sum(entry.file_size for entry in archive.infolist())
    if size > _LARGEST_SHEET:
        raise TooMuchData(_LARGEST_SHEET)
    book = load_workbook(path, read_only=True, data_only=True, keep_links=False)
    try:
        sheets = {}
        for sheet in book.worksheets:
            with closing(
                sheet.iter_rows(values_only=True)
            ) as rows:  # else the sheet stays open where a cell is refused
                sheets[sheet.title] = _sheet(sheet.title, rows)
    finally:
        book.close()
    found = {title: sheet for title, sheet in sheets.items() if sheet[0]}
    if not found:
        raise ValueError("it holds no sheet with names above rows of numbers")
    several = len(found) > 1
    values: dict[str, Value] = {}
    facts: dict[str, ChannelFacts] = {}
    for title, (columns, told) in found.items():
        before = f"{title}/" if several else ""
        values |= {f"{before}{name}": column for name, column in columns.items()}
        facts |= {f"{before}{name}": ChannelFacts(unit=unit) for name, unit in told.items()}
    return from_variables(values, facts)


Row = Sequence[object]
"""Cells of a row of a sheet."""


def _sheet(title: str, rows: Iterator[Row]) -> tuple[dict[str, Float], dict[str, str]]:
    """Return columns and units of a sheet; nothing if there are no names above rows of numbers."""
    above: list[Row] = []
    first: Row | None = None
    for row in islice(rows, _MOST_HEAD):
        if len(_numbers(row)) and len(_numbers(row)) == len(_filled(row)):
            first = row
            break
        above.append(row)
    heads = [row for row in above if _filled(row)]
    if first is None or not heads:
        return {}, {}
    units: list[str] = []
    if len(heads) > 1 and are_units_above(*map(_texts, heads[-2:])):
        units = _texts(heads.pop(-2))
    elif len(heads) > 1 and is_units(_texts(heads[-1])) and len(_filled(heads[-2])) >= len(_filled(heads[-1])):
        units = _texts(heads.pop())
    names = _texts(heads[-1])
    places = [at for at, name in enumerate(names) if name]
    if len({names[at] for at in places}) < len(places) or not places:
        raise ValueError(f"sheet '{title}': its columns do not all have different names: {', '.join(names)[:80]}")
    data = [_values(title, row, number, places) for number, row in _numbered(first, rows, len(above) + 1)]
    columns = np.array(data, np.float64).reshape(-1, len(places))
    told = {names[at]: units[at].strip("[]() ") for at in places if at < len(units) and units[at]}
    return {names[at]: np.ascontiguousarray(columns[:, i]) for i, at in enumerate(places)}, told


def _numbered(first: Row, rows: Iterator[Row], number: int) -> Iterator[tuple[int, Row]]:
    yield number, first
    for further, row in enumerate(rows, number + 1):
        if _filled(row):
            yield further, row


def _values(title: str, row: Row, number: int, places: Sequence[int]) -> list[float]:
    out = []
    for at in places:
        cell = row[at] if at < len(row) else None
        if not isinstance(cell, int | float) or isinstance(cell, bool):
            from openpyxl.utils import get_column_letter

            said = "is empty" if cell is None else f"'{str(cell)[:40]}' is not a number"
            raise ValueError(f"sheet '{title}', cell {get_column_letter(at + 1)}{number}: {said}")
        out.append(float(cell))
    return out


def _filled(row: Row) -> list[object]:
    return [cell for cell in row if cell is not None and str(cell).strip()]


def _numbers(row: Row) -> list[object]:
    return [cell for cell in _filled(row) if isinstance(cell, int | float) and not isinstance(cell, bool)]


def _texts(row: Row) -> list[str]:
    return ["" if cell is None else str(cell).strip() for cell in row]

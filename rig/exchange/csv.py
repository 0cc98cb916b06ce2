"""CSV files: two comment lines, a line of names, a line of units, one row of numbers per line.

The comments contain the kind and, as JSON, everything that is not in the table. Numbers are written with enough digits to be
read back exactly.
"""

import csv
import json
import re
from array import array
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import chain, islice
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from rig.errors import RecordingError
from rig.exchange.child_reading import NOT_OURS, ImportFailed
from rig.exchange.file_data import FileData, StoredObject, from_variables
from rig.system.text_files import read_text
from rig.text.contents import Array, Contents
from vibrolock.arrays import Float

if TYPE_CHECKING:
    from identification.mapping import CsvLayout

LARGEST_BYTES = 1_000_000_000  # largest file that is read, bytes; chosen
_DIGIT_FIRST = re.compile(r"\s*[+-]?[.,]?\d")
_KIND, _OTHERS = "# vibrolock: ", "# others: "


def write_csv(items: Sequence[Contents], path: Path) -> None:
    """Write the one table; raise `RecordingError` if there are several."""
    if len(items) > 1:
        titles = "; ".join(f"{number} ({item.kind}, {item.title})" for number, item in enumerate(items, 1))
        raise RecordingError(f"a CSV file holds one table, here are {len(items)}: choose by `item` one of {titles}")
    item = items[0]
    columns = [column for name in item.arrays if name in item.rows for column in item.columns(name)]
    with path.open("w", newline="", encoding="utf-8") as stream:
        stream.write(f"{_KIND}{item.kind}\n{_OTHERS}{json.dumps(_others(item))}\n")
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow([name for name, _, _ in columns])
        writer.writerow([unit for _, unit, _ in columns])
        writer.writerows(zip(*(values.tolist() for _, _, values in columns), strict=True))


def _others(item: Contents) -> dict[str, object]:
    """Return everything that is not in the table, and how its columns form arrays."""
    loose = {
        name: {"complex": bool(np.iscomplexobj(values)), "values": _pairs(values).tolist()}
        for name, values in item.arrays.items()
        if name not in item.rows
    }
    table = {
        name: {
            "axis": item.rows[name],
            "shape": list(np.shape(values)),
            "complex": bool(np.iscomplexobj(values)),
        }
        for name, values in item.arrays.items()
        if name in item.rows
    }
    return {"attributes": dict(item.attributes), "table": table, "arrays": loose}


def _pairs(values: Array) -> Array:
    """Return real values as they are, complex ones with real and imaginary parts along a further axis."""
    return np.stack([np.real(values), np.imag(values)], -1) if np.iscomplexobj(values) else np.asarray(values)


def columns_in(path: Path, layout: Mapping[str, object] | None = None) -> FileData:
    """Return the columns of any CSV file by name, and their units where a line after the names has them.

    ``layout`` holds the keys of a `identification.mapping.CsvLayout`. Raises `ImportFailed`.
    """
    from identification.mapping import CsvLayout

    if layout is not None:
        return from_variables({**read_csv(path, CsvLayout.model_validate(layout))})
    own = table_of_ours(path) is not None
    return from_variables({**read_csv(path)}, {} if own else {**units_of_csv(path)})


def stored_table(path: Path) -> StoredObject:
    """Return the object in a file that `write_csv` wrote; raise `ImportFailed` for any other file."""
    found = table_of_ours(path)
    if found is None:
        raise ImportFailed(f"{path}: {NOT_OURS}")
    return found


def table_of_ours(path: Path) -> StoredObject | None:
    """Return the object in a file that `write_csv` wrote; None for other files.

    Raises `ImportFailed` if the file is damaged.
    """
    lines = _lines(path)
    first = next(lines, "")
    if not first.startswith(_KIND):
        return None
    try:
        others = json.loads(next(lines, "").removeprefix(_OTHERS))
        rows = _matrix(csv.reader(islice(lines, 2, None)))
        arrays: dict[str, Array] = {}
        column = 0
        for name, stored in others["table"].items():
            shape = list(stored["shape"])
            axis = stored["axis"]
            trailing = [size for dimension, size in enumerate(shape) if dimension != axis]
            width = int(np.prod(trailing, dtype=int)) * (2 if stored["complex"] else 1)
            block = rows[:, column : column + width]
            column += width
            if stored["complex"]:
                block = block[:, ::2] + 1j * block[:, 1::2]
            arrays[name] = np.moveaxis(block.reshape(len(rows), *trailing), 0, axis)
        if column != rows.shape[1]:
            raise ValueError(f"{rows.shape[1]} columns, the comment tells of {column}")
        arrays |= {name: _loose(stored) for name, stored in others["arrays"].items()}
        return StoredObject(first.removeprefix(_KIND).strip(), arrays, others["attributes"])
    except (ValueError, KeyError, IndexError, TypeError, AttributeError, RecursionError, csv.Error) as error:
        raise ImportFailed(f"{path}: is a damaged or changed CSV file of ours ({error})") from None


def _matrix(rows: Iterable[Sequence[str]]) -> Float:
    """float64[n_rows, n_columns] of rows of numbers; raise ValueError if their lengths differ."""
    found = array("d")
    width = count = 0
    for count, row in enumerate(rows, 1):
        width = width or len(row)
        if len(row) != width:
            raise ValueError(f"row {count}: {len(row)} values, the first has {width}")
        found.extend(map(float, row))
    return np.frombuffer(found).reshape(count, width)


def _loose(stored: Mapping[str, object]) -> Array:
    values = np.array(stored["values"])
    return values[..., 0] + 1j * values[..., 1] if stored["complex"] else values


def _lines(path: Path) -> Iterator[str]:
    """Yield the lines, as `str.splitlines` does, without all of them in memory beside the text."""
    text = read_text(path, LARGEST_BYTES, ImportFailed)
    start = 0
    while start < len(text):
        stop = text.find("\n", start) + 1 or len(text)
        yield from text[start:stop].splitlines()
        start = stop


def read_csv(path: Path, layout: "CsvLayout | None" = None) -> dict[str, Float]:
    """Read the columns of any CSV file, by name.

    Without a ``layout``, separators are comma, semicolon or tab, and the first line contains the names. Lines that begin with
    ``#`` are skipped, and so are lines of units right after the names (texts, or a 1). Raises `ImportFailed`, with the line,
    for anything that is not a number, for rows of unequal length, and for decimal commas unless the layout has them.
    """
    from identification.mapping import CsvLayout

    layout = layout or CsvLayout()
    lines = islice(table_lines(path), layout.skip_lines, None)
    first = list(islice(lines, 2 if layout.names is None else 1))
    if len(first) < (2 if layout.names is None else 1):
        raise ImportFailed(f"{path}: holds no table; wanted is a line of names, then rows of numbers")
    comma = _separator(first, layout)
    names = [name.strip() for name in (_cells(first[0][1], comma) if layout.names is None else layout.names)]
    if layout.names is None and (len(set(names)) < len(names) or any(_number(name) is not None for name in names)):
        raise ImportFailed(
            f"{path}: the first line must name every column, each differently; it is '{first[0][1][:60]}'"
        )
    rows = array("d")
    for number, line in chain(first[1 if layout.names is None else 0 :], lines):
        cells = _cells(line, comma)
        values = [_number(cell if layout.decimal == "." else cell.replace(",", ".")) for cell in cells]
        if not rows and _is_units(cells, values):
            continue
        if len(cells) != len(names) or None in values:
            wrong = next((cell for cell, value in zip(cells, values, strict=True) if value is None), None)
            what = f"{len(cells)} values for {len(names)} names" if wrong is None else f"'{wrong[:60]}' is no number"
            hint = "; write decimals with a point" if wrong is not None and "," in wrong else ""
            raise ImportFailed(f"{path}, line {number}: {what}{hint}")
        rows.extend(value for value in values if value is not None)
    if not rows:
        raise ImportFailed(f"{path}: holds names, but no row of numbers")
    return dict(zip(names, np.frombuffer(rows).reshape(-1, len(names)).T, strict=True))


def units_of_csv(path: Path) -> dict[str, str]:
    """Return the units of the columns of any CSV file, by name, if a line of units follows the names."""
    lines = list(islice(table_lines(path), 2))
    if len(lines) < 2:
        return {}
    comma = _separator(lines)
    names, cells = (_cells(line, comma) for _, line in lines[:2])
    if len(names) != len(cells) or not _is_units(cells, [_number(cell) for cell in cells]):
        return {}
    return {name.strip(): cell.strip() for name, cell in zip(names, cells, strict=True) if cell.strip()}


def table_lines(path: Path) -> Iterator[tuple[int, str]]:
    """Yield the lines that are neither empty nor comments, with their numbers."""
    return ((number, line) for number, line in enumerate(_lines(path), 1) if line.strip() and not line.startswith("#"))


def _separator(lines: Sequence[tuple[int, str]], layout: "CsvLayout | None" = None) -> str:
    if layout is not None and layout.separator is not None:
        return layout.separator
    known = ";\t" if layout is not None and layout.decimal == "," else ",;\t"
    return max(known, key=lines[0][1].count)


def _cells(line: str, separator: str) -> list[str]:
    """Return the cells of a line; raise `ImportFailed` for one that is no line of a table."""
    try:
        return line.split() if separator == " " else next(csv.reader([line], delimiter=separator))
    except csv.Error as error:
        raise ImportFailed(
            f"the line '{line[:40]} ...' of {len(line)} characters is no line of a table ({error})"
        ) from None


def _is_units(cells: Sequence[str], values: Sequence[float | None]) -> bool:
    """Return whether a row holds units: texts that do not begin like a number, or a 1."""
    return None in values and all(
        cell.strip() == "1" if value is not None else not _DIGIT_FIRST.match(cell)
        for cell, value in zip(cells, values, strict=True)
    )


def _number(cell: str) -> float | None:
    try:
        return float(cell)
    except ValueError:
        return None

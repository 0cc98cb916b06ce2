"""CSV files: two comment lines, a line of names, a line of units, one row of numbers per line.

The comments contain the kind and, as JSON, everything that is not in the table. Numbers are written with enough digits to be
read back exactly.
"""

import csv
import json
from array import array
from collections.abc import Iterable, Mapping, Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from rig.errors import RecordingError
from rig.exchange.child_reading import NOT_OURS, ImportFailed
from rig.exchange.file_data import FileData, StoredObject, from_variables
from rig.exchange.tables.text import LARGEST_BYTES, blocks, encoding_of
from rig.system.text_files import open_regular
from rig.text.contents import Array, Contents
from vibrolock.arrays import Float

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
    from rig.exchange.tables.reading import read_table

    with open_regular(path, LARGEST_BYTES, ImportFailed) as stream:
        ours = stream.read(len(_KIND)) == _KIND.encode() and table_of_ours(path) is not None
    found = read_table(path, None if layout is None else CsvLayout.model_validate(layout))
    return from_variables(found.values) if ours else found


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
    lines = (line for _, block in blocks(path, encoding_of(path)) for line in block.splitlines())
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
            raise ValueError(f"{rows.shape[1]} columns, the comment names {column}")
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

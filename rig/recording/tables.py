"""JSON objects in HDF5: one as a text, many as a table of texts with a column beside it for every plain key."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rig.recording import jsontext

__all__ = ["read_object", "read_table", "write_object", "write_table"]

_COLUMN = re.compile(r"[A-Za-z_][A-Za-z0-9_]*\Z")
_INT64 = np.iinfo(np.int64)


def write_object(group: Any, name: str, value: Mapping[str, Any]) -> None:
    """Write ``value`` as the scalar text dataset ``name`` (indented, UTF-8)."""
    import h5py

    text = jsontext.encode(value, what=name, indent=2)
    group.create_dataset(name, data=text, dtype=h5py.string_dtype("utf-8"))


def read_object(group: Any, name: str) -> dict[str, Any]:
    """Read back what ``write_object`` wrote."""
    return jsontext.decode(group[name][()])


def write_table(parent: Any, name: str, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write the group ``name``: dataset ``json`` with one text per row, and one dataset per key that makes a column.

    A key makes a column where its values are all numbers (float64, NaN for what is missing), all integers (int64),
    all booleans or all texts (empty for what is missing). Everything is in ``json``, nested values only there.
    """
    import h5py

    group = parent.create_group(name)
    texts = [jsontext.encode(row, what=name) for row in rows]
    group.create_dataset("json", shape=(len(rows),), data=texts or None, dtype=h5py.string_dtype("utf-8"))
    plain = [jsontext.decode(text) for text in texts]
    for key in dict.fromkeys(key for row in plain for key in row):
        column = _column([row.get(key) for row in plain])
        if column is not None and _COLUMN.match(key) and key != "json":
            group.create_dataset(key, data=column, dtype=h5py.string_dtype("utf-8") if column.dtype == object else None)


def read_table(parent: Any, name: str) -> list[dict[str, Any]]:
    """Read back what ``write_table`` wrote."""
    return [jsontext.decode(text) for text in parent[name]["json"][()]]


def _column(values: list[Any]) -> NDArray[Any] | None:
    present = [value for value in values if value is not None]
    whole = len(present) == len(values)
    if all(isinstance(value, str) for value in present):
        printable = all(value.isprintable() for value in present)
        return np.array([value or "" for value in values], dtype=object) if present and printable else None
    if all(isinstance(value, bool) for value in present):
        return np.array(present) if whole else None
    if not all(type(value) in (int, float) for value in present):
        return None
    if not all(_INT64.min <= value <= _INT64.max for value in present if isinstance(value, int)):
        return None
    if whole and all(isinstance(value, int) for value in present):
        return np.array(present, dtype=np.int64)
    return np.array([np.nan if value is None else value for value in values], dtype=np.float64)

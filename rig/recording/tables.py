"""JSON objects in HDF5: one as a text; many as a table of texts, with a column for every plain key."""

import re
from collections.abc import Iterator, Mapping, Sequence
from math import prod
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from rig.errors import RecordingError
from rig.recording import jsontext
from rig.text.json_values import JsonValue

if TYPE_CHECKING:
    import h5py

LARGEST_TEXT_BYTES = 16 * 2**20
"""Length of one JSON text, as of a block of a journal."""
LARGEST_TEXTS_BYTES = 128 * 2**20
"""Length of all texts of a file together; in memory JSON takes 4 to 30 times that."""

_COLUMN = re.compile(r"[A-Za-z_][A-Za-z0-9_]*\Z")
_INT64 = np.iinfo(np.int64)


def write_object(group: "h5py.Group", name: str, value: Mapping[str, object]) -> None:
    """Write ``value`` as the scalar text dataset ``name`` (indented, UTF-8)."""
    import h5py

    text = jsontext.encode(value, what=name, indent=2)
    if len(text) > LARGEST_TEXT_BYTES:
        text = jsontext.encode(value, what=name)
    if len(text) > LARGEST_TEXT_BYTES:
        raise RecordingError(f"{name}: {len(text)} bytes of JSON; allowed are {LARGEST_TEXT_BYTES}")
    group.create_dataset(name, data=text, dtype=h5py.string_dtype("utf-8"))


def write_table(parent: "h5py.Group", name: str, rows: Sequence[Mapping[str, object]]) -> None:
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


class StoredTexts:
    """Reads the texts of one open file of ``size`` bytes, and no more of them than is allowed.

    Raises:
        RecordingError: on reading: a text, or all of them, too long, or no texts; without the file's name.
    """

    def __init__(self, size: int) -> None:
        # HDF5 tells no length before it reads; a text is no longer than the file, but many rows may share one.
        self._at_once = max(1, LARGEST_TEXTS_BYTES // max(size, 1))
        self._left = LARGEST_TEXTS_BYTES

    def object(self, group: "h5py.Group", name: str) -> dict[str, Any]:
        """Read back what ``write_object`` wrote."""
        return jsontext.decode(self._allowed(group[name], self._texts(group[name])[()]))

    def table(self, parent: "h5py.Group", name: str) -> list[dict[str, Any]]:
        """Read back what ``write_table`` wrote."""
        return [jsontext.decode(text) for text in self._read(parent[name]["json"])]

    def array(self, dataset: "h5py.Dataset") -> NDArray[np.str_]:
        """An array of texts of any shape."""
        if dataset.shape == ():
            return np.asarray(self._allowed(dataset, self._texts(dataset)[()]), dtype=np.str_)
        texts = list(self._read(dataset))
        if len(texts) * max(map(len, texts), default=0) > LARGEST_TEXTS_BYTES:
            raise RecordingError(f"{dataset.name}: one of its {len(texts)} texts is too long for an array of them")
        return np.asarray(texts, dtype=np.str_).reshape(dataset.shape)

    def _texts(self, dataset: "h5py.Dataset") -> "h5py.Dataset":
        if dataset.dtype.kind not in "SO":
            raise RecordingError("texts are expected", field=dataset.name, value=dataset.dtype)
        return dataset.asstr()

    def _read(self, dataset: "h5py.Dataset") -> Iterator[str]:
        texts, width = self._texts(dataset), prod(dataset.shape[1:])
        step = max(1, self._at_once // max(width, 1))
        for start in range(0, dataset.shape[0] if width else 0, step):
            for text in texts[start : start + step].reshape(-1):
                yield self._allowed(dataset, text)

    def _allowed(self, dataset: "h5py.Dataset", text: str) -> str:
        self._left -= len(text)
        if len(text) > LARGEST_TEXT_BYTES or self._left < 0:
            raise RecordingError(
                f"{dataset.name}: its texts are too long; allowed are {LARGEST_TEXT_BYTES / 2**20:g} MiB each and "
                f"{LARGEST_TEXTS_BYTES / 2**20:g} MiB in a file"
            )
        return text


def _column(values: Sequence[JsonValue]) -> np.ndarray | None:
    present = [value for value in values if value is not None]
    whole = len(present) == len(values)
    texts = [value for value in present if isinstance(value, str)]
    if len(texts) == len(present):
        printable = all(text.isprintable() for text in texts)
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

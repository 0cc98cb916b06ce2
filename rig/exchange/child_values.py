"""Values that a child process has read: written into a folder as a JSON document and a file of raw bytes, and read back."""

import json
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from rig.errors import RigError
from rig.recording.examination import LARGEST_RATIO, SMALL_BYTES
from rig.system.child import MEMORY_BYTES

MOST_BYTES = 2_000_000_000
"""Data of a file of any size."""
_ITEM_BYTES = 100
"""What a text, a number or a table takes in memory beside its content, about."""
_TREE, _NUMBERS = "tree.json", "numbers.bin"
_PLAIN = "biufcUS"


def most_bytes(path: Path) -> int:
    """Return the memory that the contents of a file may take, bytes: as much more than the file as for files of ours."""
    return min(MOST_BYTES, max(SMALL_BYTES, LARGEST_RATIO * path.stat().st_size))


def write_values(value: Any, folder: Path, most: int = MOST_BYTES) -> None:
    """Write ``value`` into ``folder``; values other than numbers, texts and containers become the name of their type.

    Raises `TooMuchData` for values that take more than ``most`` bytes of memory when they are read back.
    """
    with (folder / _NUMBERS).open("wb") as numbers:
        tree = _Taking(numbers, most).apart(value)
    (folder / _TREE).write_text(json.dumps(tree), encoding="ascii")


def read_values(folder: Path) -> Any:
    """Read back the value that `write_values` wrote."""
    with (folder / _NUMBERS).open("rb") as numbers:
        return _put_together(json.loads((folder / _TREE).read_text(encoding="ascii")), numbers)


class TooMuchData(RigError):  # noqa: N818 (says what happened)
    """The contents of a file take more memory than is allowed for a file of its size."""

    def __init__(self, most: int) -> None:
        super().__init__(f"holds more than {most} bytes of data, which are allowed in a file of this size")


class _Taking:
    """Takes values apart into a tree and numbers, as long as they are not too large."""

    def __init__(self, numbers: BinaryIO, most: int) -> None:
        self._numbers, self._most, self._left = numbers, most, most

    def apart(self, value: Any) -> Any:
        """Return the tree of a value, with places among the numbers in place of arrays."""
        self._spend(_ITEM_BYTES)
        if value is None or isinstance(value, bool):
            return value
        if isinstance(value, str):
            self._spend(len(value))
            return value
        if isinstance(value, bytes):
            self._spend(len(value))
            return {"bytes": value.decode("latin-1")}
        if isinstance(value, dict):
            return {"table": [[str(key), self.apart(item)] for key, item in value.items()]}
        if isinstance(value, list | tuple):
            return {"list": [self.apart(item) for item in value]}
        if type(value) is np.ndarray and value.dtype.kind == "O":
            return {"cells": list(value.shape), "items": [self.apart(item) for item in value.reshape(-1)]}
        if type(value) is np.ndarray or isinstance(value, np.generic | int | float | complex):
            array = np.asarray(value)
            if array.dtype.kind in _PLAIN:
                return {"array": [array.dtype.str, list(array.shape), self._written(array)], "as": _kind(value)}
        return f"<{type(value).__name__}>"

    def _written(self, array: Any) -> int:
        self._spend(array.nbytes)
        place = self._numbers.tell()
        self._numbers.write(np.ascontiguousarray(array).data if array.nbytes else b"")
        return place

    def _spend(self, size: int) -> None:
        self._left -= size
        if self._left < 0:
            raise TooMuchData(self._most)


def _kind(value: Any) -> str:
    if isinstance(value, np.ndarray):
        return "array"
    return "scalar" if isinstance(value, np.generic) else "number"


def _put_together(tree: Any, numbers: BinaryIO) -> Any:
    if not isinstance(tree, dict):
        return tree
    if "bytes" in tree:
        return tree["bytes"].encode("latin-1")
    if "table" in tree:
        return {key: _put_together(item, numbers) for key, item in tree["table"]}
    if "list" in tree:
        return [_put_together(item, numbers) for item in tree["list"]]
    if "cells" in tree:
        cells = np.empty(len(tree["items"]), dtype=object)
        for index, item in enumerate(tree["items"]):
            cells[index] = _put_together(item, numbers)
        return cells.reshape(tree["cells"])
    dtype, shape, place = tree["array"]
    array = np.empty(shape, dtype)
    if array.nbytes:
        numbers.seek(place)
        numbers.readinto(array.reshape(-1).view(np.uint8).data)  # type: ignore[attr-defined]
    if tree["as"] == "array":
        return array
    return array[()] if tree["as"] == "scalar" else array.item()


def reason(error: Exception, what: str) -> str:
    """Return in words why a file is not read."""
    if isinstance(error, MemoryError):
        return f"takes more than {MEMORY_BYTES / 2**30:g} GiB of memory, or is damaged"
    if isinstance(error, OSError) and error.errno:
        return f"cannot be read ({error.strerror or error})"
    return f"is no {what}, or a damaged one ({' '.join(str(error).split()) or type(error).__name__})"

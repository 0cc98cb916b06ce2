"""Values that a child process has read: written into a folder as a JSON document and a file of raw bytes, and read back."""

import json
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from rig.system.child import MEMORY_BYTES

__all__ = ["read_values", "reason", "write_values"]

_TREE, _NUMBERS = "tree.json", "numbers.bin"
_PLAIN = "biufcUS"


def write_values(value: Any, folder: Path) -> None:
    """Write ``value`` into ``folder``; values other than numbers, texts and containers become the name of their type."""
    with (folder / _NUMBERS).open("wb") as numbers:
        tree = _taken_apart(value, numbers)
    (folder / _TREE).write_text(json.dumps(tree), encoding="ascii")


def read_values(folder: Path) -> Any:
    """Read back the value that `write_values` wrote."""
    with (folder / _NUMBERS).open("rb") as numbers:
        return _put_together(json.loads((folder / _TREE).read_text(encoding="ascii")), numbers)


def _taken_apart(value: Any, numbers: BinaryIO) -> Any:
    if value is None or isinstance(value, str | bool):
        return value
    if isinstance(value, bytes):
        return {"bytes": value.decode("latin-1")}
    if isinstance(value, dict):
        return {"table": [[str(key), _taken_apart(item, numbers)] for key, item in value.items()]}
    if isinstance(value, list | tuple):
        return {"list": [_taken_apart(item, numbers) for item in value]}
    if type(value) is np.ndarray and value.dtype.kind == "O":
        return {"cells": list(value.shape), "items": [_taken_apart(item, numbers) for item in value.reshape(-1)]}
    if type(value) is np.ndarray or isinstance(value, np.generic | int | float | complex):
        array = np.asarray(value)
        if array.dtype.kind in _PLAIN:
            place = numbers.tell()
            numbers.write(array.tobytes())
            return {
                "array": [array.dtype.str, list(array.shape), place],
                "as": "array"
                if isinstance(value, np.ndarray)
                else "scalar"
                if isinstance(value, np.generic)
                else "number",
            }
    return f"<{type(value).__name__}>"


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

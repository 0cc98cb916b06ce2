"""Nested dictionaries, lists and arrays as one JSON document and one file of plain bytes, between two processes."""

import json
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

__all__ = ["read_values", "write_values"]

_TREE, _NUMBERS = "tree.json", "numbers.bin"
_PLAIN = "biufcUS"


def write_values(value: Any, folder: Path) -> None:
    """Write ``value`` into ``folder``; what is neither number, text nor a container of them becomes its type's name."""
    with (folder / _NUMBERS).open("wb") as numbers:
        tree = _taken_apart(value, numbers)
    (folder / _TREE).write_text(json.dumps(tree), encoding="ascii")


def read_values(folder: Path) -> Any:
    """What `write_values` wrote there."""
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

"""A MAT file read by a child process: its values go into a folder, as one JSON document and one file of plain bytes."""

import json
import sys
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from rig.system.child import MEMORY_BYTES, confine

__all__ = ["main", "read_values", "write_values"]

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


def main(path: Path, folder: Path) -> str:
    """Read ``path`` into ``folder``; return why it cannot be read, or an empty text."""
    from scipy.io import loadmat

    try:
        write_values(loadmat(str(path), simplify_cells=True, appendmat=False), folder)
    except NotImplementedError:
        return "is a MAT file of version 7.3; save it in MATLAB with save(..., '-v7')"
    except OSError as error:
        return f"cannot be read ({error.strerror or error})"
    except MemoryError:
        return f"takes more than {MEMORY_BYTES / 2**30:g} GiB of memory, or is damaged"
    except Exception as error:  # the parser fails on damaged bytes in many ways, of no common class
        return f"is no MAT file, or a damaged one ({' '.join(str(error).split())})"
    return ""


if __name__ == "__main__":
    confine(float(sys.argv[3]))
    sys.stdout.buffer.write(main(Path(sys.argv[1]), Path(sys.argv[2])).encode("utf-8", "backslashreplace"))

"""Values that a child process has read, as a JSON document and a file of raw bytes in a folder."""

import json
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, TypeGuard

import numpy as np
from numpy.typing import NDArray

from rig.errors import RigError
from rig.exchange.file_data import ChannelFacts, FileData, MappingText, StoredObject
from rig.exchange.universal_file import Axis, Function, ModeShape, UnitSystem, UniversalFile
from rig.recording.examination import LARGEST_RATIO, SMALL_BYTES
from rig.system.child import MEMORY_BYTES

if TYPE_CHECKING:
    from pydantic import JsonValue

MOST_BYTES = 2_000_000_000
"""Most memory that the contents of a file of any size may take, bytes; chosen: half of what the child may use."""
_ITEM_BYTES = 100  # memory of a text, a number or a structure beside its content, bytes; measured, roughly, in CPython
_TREE, _NUMBERS = "tree.json", "numbers.bin"
_PLAIN = "biufcUS"  # kinds of dtypes that are written as bytes
_RECORDS = {
    one.__name__: one
    for one in (Axis, ChannelFacts, FileData, Function, MappingText, ModeShape, StoredObject, UnitSystem, UniversalFile)
}
"""Dataclasses that readers return, by name."""


def most_bytes(path: Path) -> int:
    """Return the memory that the contents of a file may take, bytes: as much more than the file as for files of ours."""
    return min(MOST_BYTES, max(SMALL_BYTES, LARGEST_RATIO * path.stat().st_size))


def write_values(value: object, folder: Path, most: int = MOST_BYTES) -> None:
    """Write ``value`` into ``folder``; values other than records, numbers, texts and containers become their type's name.

    Raises `TooMuchData` for values that take more than ``most`` bytes of memory when they are read back.
    """
    with (folder / _NUMBERS).open("wb") as numbers:
        tree = _Encoder(numbers, most).encode(value)
    (folder / _TREE).write_text(json.dumps(tree), encoding="ascii")


def read_values(folder: Path) -> object:
    """Read back the value that `write_values` wrote."""
    with (folder / _NUMBERS).open("rb") as numbers:
        return _decode(json.loads((folder / _TREE).read_text(encoding="ascii")), numbers)


class TooMuchData(RigError):  # noqa: N818 (says what happened)
    """The contents of a file take more memory than is allowed for a file of its size."""

    def __init__(self, most: int) -> None:
        super().__init__(f"holds more than {most} bytes of data, which are allowed in a file of this size")


class _Encoder:
    def __init__(self, numbers: BinaryIO, most: int) -> None:
        self._numbers, self._most, self._left = numbers, most, most

    def encode(self, value: object) -> "JsonValue":
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
        if is_dataclass(value) and not isinstance(value, type):
            entries = {one.name: getattr(value, one.name) for one in fields(value)}
            return {"record": type(value).__name__, "fields": self.encode(entries)}
        if isinstance(value, dict):
            return {"keys": [*map(str, value)], "values": [self.encode(item) for item in value.values()]}
        if isinstance(value, list | tuple):
            return {"list": [self.encode(item) for item in value]}
        if _is_array(value) and value.dtype.kind == "O":
            return {"cells": list(value.shape), "items": [self.encode(item) for item in value.reshape(-1)]}
        if _is_array(value) or isinstance(value, np.generic | int | float | complex):
            array = np.asarray(value)
            if array.dtype.kind in _PLAIN:
                kind = "array" if value is array else "scalar" if isinstance(value, np.generic) else "number"
                return {"array": [array.dtype.str, list(array.shape), self._written(array)], "as": kind}
        return f"<{type(value).__name__}>"

    def _written(self, array: NDArray[np.generic]) -> int:
        self._spend(array.nbytes)
        place = self._numbers.tell()
        self._numbers.write(np.ascontiguousarray(array).data if array.nbytes else b"")
        return place

    def _spend(self, size: int) -> None:
        self._left -= size
        if self._left < 0:
            raise TooMuchData(self._most)


def _is_array(value: object) -> TypeGuard[NDArray[np.generic]]:
    """Return whether a value is an array, and of no subclass, such as a matrix."""
    return type(value) is np.ndarray


def _decode(tree: Any, numbers: BinaryIO) -> Any:
    match tree:
        case {"bytes": text}:
            return text.encode("latin-1")
        case {"record": name, "fields": entries}:
            return _RECORDS[name](**_decode(entries, numbers))
        case {"keys": keys, "values": values}:
            return {key: _decode(item, numbers) for key, item in zip(keys, values, strict=True)}
        case {"list": items}:
            return [_decode(item, numbers) for item in items]
        case {"cells": shape, "items": items}:
            cells = np.empty(len(items), dtype=object)
            for index, item in enumerate(items):
                cells[index] = _decode(item, numbers)
            return cells.reshape(shape)
        case {"array": [dtype, shape, place], "as": kind}:
            array = np.empty(shape, dtype)
            if array.nbytes:
                numbers.seek(place)
                numbers.readinto(array.reshape(-1).view(np.uint8).data)  # type: ignore[attr-defined]
            return array if kind == "array" else array[()] if kind == "scalar" else array.item()
    return tree


def reason(error: Exception, what: str) -> str:
    """Return in words why a file cannot be read."""
    if isinstance(error, MemoryError):
        return f"takes more than {MEMORY_BYTES / 2**30:g} GiB of memory, or is damaged"
    if isinstance(error, OSError) and error.errno:
        return f"cannot be read ({error.strerror or error})"
    return f"is no {what}, or a damaged one ({' '.join(str(error).split()) or type(error).__name__})"

"""Finding values by path in nested dictionaries, lists and arrays."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError

__all__ = ["as_levels", "numbers", "value_at"]

_STEP = re.compile(r"([^.\[\]]+)|\[(\d+)\]")
_PATH = re.compile(r"([^.\[\]]+|\[\d+\])(\.[^.\[\]]+|\[\d+\])*")


def value_at(data: Any, path: str, where: str) -> Any:
    """Value at ``path`` (``a.b[2].c``) in ``data``; raises `IdentificationError` with ``where`` and what is there."""
    if isinstance(data, Mapping) and path in data:
        return data[path]  # a name with dots or brackets of its own
    if not _PATH.fullmatch(path):
        raise IdentificationError(
            f"{where}: '{path}' is no path; write names joined by dots, with [0] for list entries"
        )
    value = data
    walked = ""
    for match in _STEP.finditer(path):
        name, index = match.groups()
        if name is not None:
            value = _member(value, name, walked, path, where)
            walked += f"{walked and '.'}{name}"
        else:
            value = _entry(value, int(index), walked, path, where)
            walked += f"[{index}]"
    return value


def _member(value: Any, name: str, walked: str, path: str, where: str) -> Any:
    here = f"'{walked}'" if walked else "the top"
    if not isinstance(value, Mapping):
        raise IdentificationError(f"{where}: path '{path}': {here} is {_kind(value)}, has no '{name}'")
    if name not in value:
        there = ", ".join(str(key) for key in value if not str(key).startswith("__")) or "nothing"
        raise IdentificationError(f"{where}: path '{path}': no '{name}' at {here}, which has {there}")
    return value[name]


def _entry(value: Any, index: int, walked: str, path: str, where: str) -> Any:
    here = f"'{walked}'" if walked else "the top"
    if not _is_list(value):
        raise IdentificationError(f"{where}: path '{path}': {here} is {_kind(value)}, has no [{index}]")
    if index >= len(value):
        raise IdentificationError(f"{where}: path '{path}': no [{index}] at {here}, which has {len(value)} entries")
    return value[index]


def as_levels(value: Any, where: str) -> Sequence[Any]:
    """``value`` as a list of structures; a single structure is a list of one (MATLAB does not tell them apart)."""
    if isinstance(value, Mapping):
        return [value]
    if not _is_list(value):
        raise IdentificationError(f"{where}: is {_kind(value)}, needs a list of structures")
    if not len(value):
        raise IdentificationError(f"{where}: is empty, needs at least one level")
    return list(value)


def numbers(value: Any, ndim: int, where: str) -> NDArray[Any]:
    """Numeric array with ``ndim`` dimensions (1: a vector, whichever way it lies; 2: one column per level)."""
    try:
        array = np.asarray(value)
    except ValueError:
        raise IdentificationError(f"{where}: is a list of unequal lengths, needs numbers") from None
    if array.dtype.kind not in "iufc":
        raise IdentificationError(f"{where}: is {_kind(value)}, needs numbers")
    if ndim == 1 and array.ndim <= 2 and array.size == max(array.shape, default=1):
        return array.reshape(-1)
    if ndim == 2 and array.ndim <= 1:
        return array.reshape(-1, 1)
    if ndim == 2 and array.ndim == 2:
        return array.T if array.shape[0] == 1 else array
    raise IdentificationError(f"{where}: has shape {array.shape}, needs {'a vector' if ndim == 1 else 'a matrix'}")


def _is_list(value: Any) -> bool:
    return value.ndim > 0 if isinstance(value, np.ndarray) else isinstance(value, list | tuple)


def _kind(value: Any) -> str:
    if isinstance(value, Mapping):
        return "a structure"
    if isinstance(value, str | bytes):
        return "text"
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape}" if value.dtype.kind in "iufc" else "a list"
    return f"a {type(value).__name__}"

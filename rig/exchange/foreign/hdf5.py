"""HDF5 files of any layout as nested dictionaries; ``name@attribute`` beside a name holds its attributes.

Links to other files, virtual and external datasets are not followed: a file from somebody else must not read other files.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from rig.exchange.child_values import TooMuchData, most_bytes

DEEPEST = 32
_MOST_ITEMS = 100_000
_TEXT_BYTES = 100
_PLAIN = "biufc"


class Budget:
    """Bytes and items that may still be read; `spend` raises TooMuchData or ValueError beyond them."""

    def __init__(self, path: Path) -> None:
        self._most = self._bytes = most_bytes(path)
        self._items = _MOST_ITEMS

    def spend(self, size: int) -> None:
        """Count one item of ``size`` bytes."""
        self._bytes, self._items = self._bytes - size, self._items - 1
        if self._bytes < 0:
            raise TooMuchData(self._most)
        if self._items < 0:
            raise ValueError(f"it holds more than {_MOST_ITEMS} items")


def read_hdf5(path: Path) -> dict[str, Any]:
    """Return the groups and datasets of a file; raise OSError, ValueError or errors of h5py if it cannot be read."""
    import h5py

    with h5py.File(path, "r") as file:
        return {**dict(_attributes(file, "")), **_group(file, Budget(path), ())}


def _group(group: Any, budget: Budget, above: tuple[Any, ...]) -> dict[str, Any]:
    import h5py

    found: dict[str, Any] = {}
    for name in group:
        budget.spend(0)
        if isinstance(group.get(name, getlink=True), h5py.ExternalLink):
            found[name] = "<link to another file>"
            continue
        item = group.get(name)
        if item is None:
            found[name] = "<broken link>"
        elif isinstance(item, h5py.Group):
            inside = any(item.id == one for one in above) or len(above) >= DEEPEST
            found[name] = "<group above>" if inside else _group(item, budget, (*above, item.id))
        elif isinstance(item, h5py.Dataset):
            found[name] = plain_dataset(item, budget)
        else:
            found[name] = f"<{type(item).__name__}>"
            continue
        found |= dict(_attributes(item, name))
    return found


def plain_dataset(item: Any, budget: Budget) -> Any:
    """Return numbers, texts, or the columns of a table; the name of its type for what is none of these."""
    if item.is_virtual or item.external:
        return "<data in another file>"
    if item.shape is None:
        return np.zeros(0)
    if not _is_plain(item.dtype):
        return f"<{item.dtype}>"
    budget.spend(int(np.prod(item.shape, dtype=float)) * _size(item.dtype))
    return _plain(item[()], item.dtype)


def _is_plain(dtype: Any) -> bool:
    """Return whether a type has numbers or texts, at least in one column: others are not read, lists could be of any length."""
    import h5py

    if dtype.names:
        return any(_is_plain(dtype[name]) for name in dtype.names)
    return dtype.kind in f"{_PLAIN}S" or h5py.check_string_dtype(dtype) is not None


def _size(dtype: Any) -> int:
    """Return the memory of one value, bytes; each text becomes an object."""
    if dtype.names:
        return sum(_size(dtype[name]) for name in dtype.names)
    return int(dtype.itemsize) + (_TEXT_BYTES if dtype.kind in "SO" else 0)


def _plain(value: Any, dtype: Any) -> Any:
    import h5py

    if dtype.names:
        return {name: _plain(value[name], dtype[name]) for name in dtype.names}
    if h5py.check_string_dtype(dtype) is not None:
        texts = [one.decode("utf-8", "replace") if isinstance(one, bytes) else str(one) for one in np.ravel(value)]
        return texts[0] if np.ndim(value) == 0 else texts
    if dtype.kind == "S":
        return [one.decode("utf-8", "replace") for one in np.ravel(value)]
    return np.asarray(value) if dtype.kind in _PLAIN else f"<{dtype}>"


def _attributes(item: Any, name: str) -> Iterator[tuple[str, Any]]:
    """Yield the attributes that are numbers or texts."""
    for key in item.attrs:
        try:
            value = item.attrs[key]
        except (OSError, TypeError, ValueError):
            continue  # of a type that h5py does not know
        if isinstance(value, bytes):
            value = value.decode("utf-8", "replace")
        if isinstance(value, str) or (isinstance(value, np.generic | np.ndarray) and value.dtype.kind in _PLAIN):
            yield f"{name}@{key}", value

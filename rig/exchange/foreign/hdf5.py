"""HDF5 and NetCDF files of any layout as nested dictionaries; ``name@attribute`` beside a name holds its attributes.

Links to other files, virtual and external datasets are not followed: a file from another program must not read other files.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from rig.exchange.child_values import TooMuchData, most_bytes
from rig.exchange.file_data import FileData, Value, from_variables
from rig.exchange.foreign.netcdf import MAGIC, of_rattlesnake, read_classic

if TYPE_CHECKING:
    import h5py

Type = np.dtype[np.void]
"""Type of the values of a dataset."""
MAX_DEPTH = 32  # levels of groups that are read; chosen: deeper ones are links in a circle
_MAX_ITEMS = 100_000  # groups and datasets that are read; chosen
_TEXT_BYTES = 100  # memory of a text, bytes, about
_PLAIN = "biufc"  # kinds of dtypes that are numbers


class Budget:
    """Bytes and items that may still be read; `spend` raises TooMuchData or ValueError beyond them."""

    def __init__(self, path: Path) -> None:
        self._most = self._bytes = most_bytes(path)
        self._items = _MAX_ITEMS

    def spend(self, size: int) -> None:
        """Count one item of ``size`` bytes."""
        self._bytes, self._items = self._bytes - size, self._items - 1
        if self._bytes < 0:
            raise TooMuchData(self._most)
        if self._items < 0:
            raise ValueError(f"it holds more than {_MAX_ITEMS} items")


def read_hdf5(path: Path) -> FileData:
    """Return the groups and datasets of a file; raise OSError, ValueError or errors of h5py if it cannot be read."""
    import h5py

    with path.open("rb") as stream:
        classic = stream.read(len(MAGIC)) == MAGIC
    if classic:
        return from_variables(read_classic(path))
    with h5py.File(path, "r") as file:
        values = {**dict(_attributes(file, "")), **_group(file, Budget(path), ())}
    values, channels, rate = of_rattlesnake(values)
    found = from_variables(values)
    return replace(found, channels={**found.channels, **channels}, sample_rate_hz=rate or found.sample_rate_hz)


def _group(group: "h5py.Group", budget: Budget, above: "tuple[h5py.h5g.GroupID, ...]") -> dict[str, Value]:
    import h5py

    found: dict[str, Value] = {}
    for name in group:
        budget.spend(0)
        if is_link_out(group, name):
            found[name] = "<link to another file>"
            continue
        item = group.get(name)
        if item is None:
            found[name] = "<broken link>"
        elif isinstance(item, h5py.Group):
            inside = any(item.id == one for one in above) or len(above) >= MAX_DEPTH
            found[name] = "<group above>" if inside else _group(item, budget, (*above, item.id))
        elif isinstance(item, h5py.Dataset):
            found[name] = _dataset(item, budget)
        else:
            found[name] = f"<{type(item).__name__}>"
            continue
        found |= dict(_attributes(item, name))
    return found


def is_link_out(group: "h5py.Group", name: str) -> bool:
    """Return whether a name in a group is a link to another file."""
    import h5py

    return isinstance(group.get(name, getlink=True), h5py.ExternalLink)


def _dataset(item: "h5py.Dataset", budget: Budget) -> Value:
    """Return numbers, texts, or the columns of a table; the name of its type for what is none of these."""
    if item.is_virtual or item.external:
        return "<data in another file>"
    if item.shape is None:
        return np.zeros(0)
    if not _is_plain(item.dtype):
        return f"<{item.dtype}>"
    budget.spend(int(np.prod(item.shape, dtype=float)) * _size(item.dtype))
    return _plain(item[()], item.dtype)


def _is_plain(dtype: Type) -> bool:
    """Return whether a type has numbers or texts, at least in one column: others are not read, lists could be of any length."""
    import h5py

    if dtype.names:
        return any(_is_plain(dtype[name]) for name in dtype.names)
    return dtype.kind in f"{_PLAIN}S" or h5py.check_string_dtype(dtype) is not None


def _size(dtype: Type) -> int:
    """Return the memory of one value, bytes; each text becomes an object."""
    if dtype.names:
        return sum(_size(dtype[name]) for name in dtype.names)
    return int(dtype.itemsize) + (_TEXT_BYTES if dtype.kind in "SO" else 0)


def _plain(value: NDArray[np.void], dtype: Type) -> Value:
    import h5py

    if dtype.names:
        return {name: _plain(value[name], dtype[name]) for name in dtype.names}
    string = h5py.check_string_dtype(dtype) is not None
    if string or dtype.kind == "S":
        texts: list[Value] = [
            one.decode("utf-8", "replace") if isinstance(one, bytes) else str(one) for one in np.ravel(value).tolist()
        ]
        return texts[0] if string and np.ndim(value) == 0 else texts
    return np.asarray(value) if dtype.kind in _PLAIN else f"<{dtype}>"


def _attributes(item: "h5py.Group | h5py.Dataset", name: str) -> Iterator[tuple[str, Value]]:
    """Yield the attributes that are numbers or texts; an array of one text is that text, of several a list."""
    for key in item.attrs:
        try:
            value = item.attrs[key]
        except (OSError, TypeError, ValueError):
            continue  # of a type that h5py does not know
        value = value.decode("utf-8", "replace") if isinstance(value, bytes) else value
        if isinstance(value, np.ndarray) and value.dtype.kind in "OS":
            texts: list[Value] = [
                one.decode("utf-8", "replace") if isinstance(one, bytes) else one
                for one in value.reshape(-1)
                if isinstance(one, str | bytes)
            ]
            if texts and len(texts) == value.size:
                yield f"{name}@{key}", texts[0] if len(texts) == 1 else texts
        elif isinstance(value, str) or (isinstance(value, np.generic | np.ndarray) and value.dtype.kind in _PLAIN):
            yield f"{name}@{key}", value

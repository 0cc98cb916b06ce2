"""Refuses HDF5 files, before any value is read, that link to other files or declare sizes without data."""

from collections.abc import Iterator
from math import ceil, prod
from typing import TYPE_CHECKING

import numpy as np

from rig.errors import RecordingError

if TYPE_CHECKING:
    import h5py

MOST_OBJECTS = 200_000
"""Groups and datasets of a file; a recording of 1000 parts has about 60 000."""
LARGEST_RATIO = 200
"""Bytes that the datasets may declare per byte of the file; the compression used (LZF) reaches 88 on zeros."""

SMALL_BYTES = 2**26
"""Bytes that the datasets of any file may declare."""
_LARGEST_CHUNK_BYTES = 2**28  # of a dataset, held in memory to read it; chosen
_LARGEST_ATTRIBUTE_BYTES = 2**16  # HDF5 stores no longer one beside its object
_MOST_ATTRIBUTES = 1000  # of an object; chosen: ours have a handful
_MOST_TEXTS = 2**22  # of a file; chosen


def examine(file: "h5py.File", size: int) -> None:
    """Check every object of an open HDF5 file of ``size`` bytes without reading values.

    Raises:
        RecordingError: it names the object, what it holds and what is allowed; without the file's name.
    """
    declared = texts = 0
    for item in objects_in(file):
        check_attributes(item)
        if hasattr(item, "shape"):
            dtype = item.dtype  # each look takes time
            _check_storage(item, dtype)
            if dtype.kind == "O":
                texts += item.size
            else:
                declared += item.size * dtype.itemsize
    if declared > max(SMALL_BYTES, LARGEST_RATIO * size):
        raise RecordingError(
            f"its datasets declare {declared} bytes in a file of {size}; allowed are {LARGEST_RATIO} times its size"
        )
    if texts > min(_MOST_TEXTS, size):
        raise RecordingError(f"its datasets declare {texts} texts; allowed are {min(_MOST_TEXTS, size)}")


def objects_in(file: "h5py.File") -> "Iterator[h5py.Group | h5py.Dataset]":
    """Yield every group and dataset, the root first.

    Raises:
        RecordingError: a link that is not a plain one, an object with two names, or too many of them.
    """
    import h5py

    seen, waiting = {h5py.h5o.get_info(file.id).addr}, [file["/"]]
    while waiting:
        group = waiting.pop()
        yield group
        path = group.name.rstrip("/")
        for name in group:
            where = f"{path}/{name}"
            if group.id.links.get_info(name.encode("utf-8", "surrogateescape")).type != h5py.h5l.TYPE_HARD:
                raise RecordingError(
                    f"{where} is a link to elsewhere; a file of its own is expected, without soft links"
                )
            item = group[name]
            address = h5py.h5o.get_info(item.id).addr
            if address in seen:
                raise RecordingError(f"{where} is another name of an object; allowed is one name for each")
            seen.add(address)
            if len(seen) > MOST_OBJECTS:
                raise RecordingError(f"it holds more than {MOST_OBJECTS} groups and datasets")
            if isinstance(item, h5py.Group):
                waiting.append(item)
            elif isinstance(item, h5py.Dataset):
                yield item
            else:
                raise RecordingError(f"{where} is a {type(item).__name__}; allowed are groups and datasets")


def check_attributes(item: "h5py.Group | h5py.Dataset") -> None:
    """Refuse an object with too many or too large attributes by `RecordingError`, before one of them is read."""
    attributes = item.attrs
    if len(attributes) > _MOST_ATTRIBUTES:
        raise RecordingError(f"{item.name} has {len(attributes)} attributes; allowed are {_MOST_ATTRIBUTES}")
    for name in attributes:
        stored = attributes.get_id(name)
        if prod(stored.shape) * stored.dtype.itemsize > _LARGEST_ATTRIBUTE_BYTES:
            raise RecordingError(f"{item.name}: its attribute {name!r} is longer than {_LARGEST_ATTRIBUTE_BYTES} bytes")


def _check_storage(dataset: "h5py.Dataset", dtype: np.dtype) -> None:
    """Refuse values stored in other files or not stored at all, and types other than numbers and texts."""
    import h5py

    if dataset.is_virtual or dataset.external:
        raise RecordingError(f"{dataset.name} keeps its values in another file; allowed are values of its own")
    if dataset.shape is None or dtype.kind not in "biufcSO":
        raise RecordingError("numbers or texts are expected", field=dataset.name, value=dtype)
    if dtype.kind == "O" and h5py.check_string_dtype(dtype) is None:
        raise RecordingError(f"{dataset.name} holds lists or references; numbers or texts are expected")
    if dataset.size == 0:
        return
    if dataset.chunks is None:
        if dtype.kind != "O" and dataset.id.get_storage_size() < dataset.nbytes:
            raise RecordingError(
                f"{dataset.name} declares {dataset.nbytes} bytes and stores {dataset.id.get_storage_size()}"
            )
        return
    if prod(dataset.chunks) * dtype.itemsize > _LARGEST_CHUNK_BYTES:
        raise RecordingError(f"{dataset.name} has chunks of {dataset.chunks}; allowed are {_LARGEST_CHUNK_BYTES} bytes")
    chunks = prod(ceil(length / chunk) for length, chunk in zip(dataset.shape, dataset.chunks, strict=True))
    if dataset.id.get_num_chunks() != chunks:
        raise RecordingError(f"{dataset.name} declares {chunks} chunks and stores {dataset.id.get_num_chunks()}")

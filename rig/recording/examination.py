"""Refuses HDF5 files, before any value is read, that link to other files or declare sizes without data."""

import os
import time
from collections.abc import Iterator
from math import ceil, prod
from typing import TYPE_CHECKING

from rig.errors import RecordingError

if TYPE_CHECKING:
    import h5py
    import numpy as np

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


_REMEMBERED = 256
"""Files that have been examined and need not be again. Chosen: some times what a command opens."""
_SETTLED_S = 0.1
"""s for which a file must not have changed to be remembered: times of files are whole ticks of the system's clock."""
_examined: set[tuple[int, ...]] = set()


def examine_once(file: "h5py.File") -> None:
    """Do as `examine`, unless this process has examined the same file since it was changed last."""
    now_s, found = time.time(), os.fstat(file.id.get_vfd_handle())
    which = found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns, found.st_ctime_ns
    if which in _examined:
        return
    examine(file, found.st_size)
    if now_s - 1e-9 * max(found.st_mtime_ns, found.st_ctime_ns) > _SETTLED_S:
        if len(_examined) >= _REMEMBERED:
            _examined.clear()
        _examined.add(which)


def examine(file: "h5py.File", size: int) -> None:
    """Check every object of an open HDF5 file of ``size`` bytes without reading values.

    Raises:
        RecordingError: it names the object, what it holds and what is allowed; without the file's name.
    """
    import h5py

    declared = texts = 0
    for name, item in objects_in(file):
        check_attributes(item, name)
        if isinstance(item, h5py.h5d.DatasetID):
            dtype = item.dtype
            values = _values_in(item, dtype, name)
            if dtype.kind == "O":
                texts += values
            else:
                declared += values * dtype.itemsize
    if declared > max(SMALL_BYTES, LARGEST_RATIO * size):
        raise RecordingError(
            f"its datasets declare {declared} bytes in a file of {size}; allowed are {LARGEST_RATIO} times its size"
        )
    if texts > min(_MOST_TEXTS, size):
        raise RecordingError(f"its datasets declare {texts} texts; allowed are {min(_MOST_TEXTS, size)}")


def objects_in(file: "h5py.File") -> "Iterator[tuple[str, h5py.h5g.GroupID | h5py.h5d.DatasetID]]":
    """Yield the name and HDF5's own identifier of every group and dataset, the root first.

    Making h5py's objects of them would take three times as long.

    Raises:
        RecordingError: a link that is not a plain one, an object with two names, or too many of them.
    """
    import h5py

    seen, waiting = {h5py.h5o.get_info(file.id).addr}, [("", file["/"].id)]
    while waiting:
        path, group = waiting.pop()
        yield path or "/", group
        links: dict[bytes, int] = {}
        group.links.iterate(lambda name, link, found=links: found.update({name: link.type}), info=True)
        for name, link in links.items():
            where = f"{path}/{_text(name)}"
            if link != h5py.h5l.TYPE_HARD:
                raise RecordingError(
                    f"{where} is a link to elsewhere; a file of its own is expected, without soft links"
                )
            item = h5py.h5o.open(group, name)
            address = h5py.h5o.get_info(item).addr
            if address in seen:
                raise RecordingError(f"{where} is another name of an object; allowed is one name for each")
            seen.add(address)
            if len(seen) > MOST_OBJECTS:
                raise RecordingError(f"it holds more than {MOST_OBJECTS} groups and datasets")
            if isinstance(item, h5py.h5g.GroupID):
                waiting.append((where, item))
            elif isinstance(item, h5py.h5d.DatasetID):
                yield where, item
            else:
                raise RecordingError(f"{where} is a Datatype; allowed are groups and datasets")


def check_attributes(item: "h5py.h5g.GroupID | h5py.h5d.DatasetID", name: str = "/") -> None:
    """Refuse an object with too many or too large attributes by `RecordingError`, before one of them is read."""
    import h5py

    count = h5py.h5a.get_num_attrs(item)
    if count > _MOST_ATTRIBUTES:
        raise RecordingError(f"{name} has {count} attributes; allowed are {_MOST_ATTRIBUTES}")
    for number in range(count):
        stored = h5py.h5a.open(item, index=number)
        if prod(stored.shape) * stored.dtype.itemsize > _LARGEST_ATTRIBUTE_BYTES:
            raise RecordingError(
                f"{name}: its attribute {_text(stored.name)!r} is longer than {_LARGEST_ATTRIBUTE_BYTES} bytes"
            )


def _text(name: bytes) -> str:
    return name.decode("utf-8", "surrogateescape")


def _values_in(stored: "h5py.h5d.DatasetID", dtype: "np.dtype", name: str) -> int:
    """Return how many values a dataset has.

    Refuses those stored in other files or not stored at all, and types other than numbers and texts, by `RecordingError`.
    """
    import h5py

    shape, created = stored.shape, stored.get_create_plist()
    layout = created.get_layout()
    if layout == h5py.h5d.VIRTUAL or created.get_external_count():
        raise RecordingError(f"{name} keeps its values in another file; allowed are values of its own")
    if shape is None or dtype.kind not in "biufcSO":
        raise RecordingError("numbers or texts are expected", field=name, value=dtype)
    if dtype.kind == "O" and h5py.check_string_dtype(dtype) is None:
        raise RecordingError(f"{name} holds lists or references; numbers or texts are expected")
    size: int = prod(shape)
    if size == 0:
        return 0
    if layout != h5py.h5d.CHUNKED:
        if dtype.kind != "O" and stored.get_storage_size() < size * dtype.itemsize:
            raise RecordingError(
                f"{name} declares {size * dtype.itemsize} bytes and stores {stored.get_storage_size()}"
            )
        return size
    chunk = created.get_chunk()
    if prod(chunk) * dtype.itemsize > _LARGEST_CHUNK_BYTES:
        raise RecordingError(f"{name} has chunks of {chunk}; allowed are {_LARGEST_CHUNK_BYTES} bytes")
    chunks = prod(ceil(length / part) for length, part in zip(shape, chunk, strict=True))
    if stored.get_num_chunks() != chunks:
        raise RecordingError(f"{name} declares {chunks} chunks and stores {stored.get_num_chunks()}")
    return size

"""Rows of a point: an array, or columns in files where a record is too long for memory; both are evaluated in stretches."""

import math
from collections.abc import Iterable, Iterator, Mapping
from io import FileIO
from pathlib import Path
from tempfile import TemporaryFile
from threading import Lock
from typing import Any, Protocol

import numpy as np

from identification.signals import spans, unwrapped

_TURN = 2.0 * math.pi  # rad


class Rows(Protocol):
    """What an evaluation may do with rows: ``rows["theta_rad"]`` is a column, ``rows[a:b]`` are rows again."""

    @property
    def size(self) -> int:
        """Number of rows."""

    def __getitem__(self, key: Any, /) -> Any: ...


class Spool:
    """Rows on their way into unnamed files, one for each column, in a folder that holds recordings.

    Raises:
        OSError: on construction and by `add`, if the files cannot be written.
    """

    def __init__(self, dtype: np.dtype, folder: Path | None = None) -> None:
        self.dtype, self.size = dtype, 0
        self._lock = Lock()  # an evaluation reads while rows are added
        self._files: Mapping[str, FileIO] = {
            name: TemporaryFile(dir=folder, buffering=0)  # noqa: SIM115
            for name in dtype.names or ()
        }

    def add(self, rows: np.ndarray) -> None:
        """Append rows."""
        with self._lock:
            for name, file in self._files.items():
                column = np.ascontiguousarray(rows[name]).reshape(-1).view(np.uint8).data
                file.seek(self.size * self.dtype[name].itemsize)
                while column:
                    column = column[file.write(column) :]
            self.size += rows.size

    def column(self, name: str, start: int, stop: int) -> np.ndarray:
        """Read one column of rows ``start`` to ``stop``."""
        values = np.empty(stop - start, self.dtype[name])
        view = values.reshape(-1).view(np.uint8).data
        with self._lock:
            file = self._files[name]
            file.seek(start * self.dtype[name].itemsize)
            while view:
                got = file.readinto(view)
                if not got:
                    raise OSError(f"rows {start} to {stop}: the file of {name} has become shorter")
                view = view[got:]
        return values

    def __del__(self) -> None:
        for file in getattr(self, "_files", {}).values():
            file.close()


class LongRows:
    """Rows ``first`` to ``end`` of a `Spool`. Only what is asked for is read, and nothing is kept."""

    def __init__(self, spool: Spool, first: int, end: int) -> None:
        self._spool, self._first = spool, first
        self.size = end - first

    def __getitem__(self, key: str | slice) -> Any:
        if isinstance(key, str):
            return self._spool.column(key, self._first, self._first + self.size)
        start, stop, step = key.indices(self.size)
        if step != 1:
            raise IndexError(f"rows: step = {step}: must be 1")
        return LongRows(self._spool, self._first + start, self._first + max(start, stop))

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> np.ndarray:
        """Return `whole`, where numpy joins rows."""
        return self.whole() if dtype is None else self.whole().astype(dtype)

    def whole(self) -> np.ndarray:
        """Return all columns as one structured array."""
        out = np.empty(self.size, self._spool.dtype)
        for name in self._spool.dtype.names or ():
            out[name] = self[name]
        return out


def stretches(rows: Rows) -> Iterator[Any]:
    """Yield rows in stretches that can be evaluated in memory; a record of less than 65536 rows is one."""
    for start, stop in spans(rows.size):
        yield rows[start:stop]


def phases(rows: Rows) -> Iterator[tuple[int, np.ndarray]]:
    """Yield the unwrapped phase of the oscillator, rad, in stretches, each with the number of its first row.

    Each stretch but the first begins with the last row of the one before.
    """
    last = 0.0
    for start, stop in spans(rows.size):
        before = max(0, start - 1)
        theta = unwrapped(rows[before:stop]["theta_rad"].astype(float))
        if start:
            theta += _TURN * np.rint((last - theta[0]) / _TURN)
        last = float(theta[-1])
        yield before, theta


def turned_rad(rows: Rows) -> float:
    """Angle by which the oscillator turned from the first to the last row."""
    first = last = math.nan
    for start, theta in phases(rows):
        first, last = (first if start else float(theta[0])), float(theta[-1])
    return last - first


def mean_of(parts: Iterable[np.ndarray]) -> float:
    """Mean of values that come in stretches; NaN without any."""
    return _moments(parts)[0]


def std_of(parts: Iterable[np.ndarray]) -> float:
    """Standard deviation of values that come in stretches; NaN without any."""
    return _moments(parts)[1]


def _moments(parts: Iterable[np.ndarray]) -> tuple[float, float]:
    """Return mean and standard deviation; of a single stretch, those of numpy to the last bit."""
    count, mean, squares = 0, 0.0, 0.0
    for values in parts:
        if values.size:
            own = float(values.mean())
            total, away = count + values.size, own - mean
            squares += float(((values - own) ** 2).sum()) + away**2 * count * values.size / total
            mean += away * (values.size / total)
            count = total
    return (mean, math.sqrt(squares / count)) if count else (math.nan, math.nan)

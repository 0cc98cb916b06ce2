"""`Part`: the interface of a part of a recording, in a journal or in an HDF5 file."""

from abc import ABC, abstractmethod
from collections.abc import Sequence

import numpy as np

from rig.errors import RecordingError
from rig.recording.header import Column
from rig.recording.stored import End, Event, Information, StoredTable


def rows_at_once(row_dtype: np.dtype) -> int:
    """Return how many rows are held in memory while reading or converting, and make one chunk of an HDF5 dataset."""
    return max(min(16384, 2**22 // row_dtype.itemsize), 1)


def missing_rows(n_rows: int, row_dtype: np.dtype) -> np.ndarray:
    """Return rows that take the place of lost ones: NaN where a field can hold it, else zero."""
    rows = np.zeros(n_rows, row_dtype)
    for name in row_dtype.names or ():
        if rows[name].dtype.kind in "fc":
            rows[name] = np.nan
    return rows


class Part(ABC):
    """One uninterrupted stretch of a recording, from its beginning to its end, a kill or a change of plan."""

    information: Information
    """Information given when the part began."""
    points: list[StoredTable]
    """Results per point, in the order in which they were completed."""
    events: list[Event]
    """Events, in the order in which they happened."""
    end: End | None
    """How the part ended, with its counters; ``None`` where it was cut short."""
    n_rows: int
    """Number of rows."""
    row_dtype: np.dtype
    """Structured dtype of its rows."""
    columns: Sequence[Column]
    """Unit and meaning of each field of its rows."""
    dropped_bytes: int
    """Bytes of its journal that could not be read; above 0 only for a torn or damaged journal."""
    dropped_reason: str
    """Where they are, why they could not be read, and which rows were lost with them; empty where none were."""

    @property
    def first_sample(self) -> int | None:
        """Number of the sample of the first row, where the part's ``information`` says it."""
        first = self.information.get("first_sample")
        return None if first is None else int(first)

    @property
    def complete(self) -> bool:
        """Whether the part's end says ``"completed": true``."""
        return self.end is not None and self.end.get("completed") is True

    def rows(self, field: str, start: int = 0, stop: int | None = None) -> np.ndarray:
        """Read one field of the rows ``start`` to ``stop``, which count as in a slice; nothing is kept between calls.

        Returns:
            Array of shape ``(rows,)``, or ``(rows, k)`` for a field of k numbers, in the field's stored type.

        Raises:
            RecordingError: no such field, or the file cannot be read any more.
        """
        names = self.row_dtype.names or ()
        if field not in names:
            raise RecordingError(f"no field {field!r} in the rows; there are {', '.join(names)}")
        first, last, _ = slice(start, stop).indices(self.n_rows)
        return self._read_field(field, first, max(first, last))

    def read(self, start: int, stop: int) -> np.ndarray:
        """Read rows ``start`` to ``stop``: a structured array, ``(stop - start,)``.

        Raises:
            RecordingError: there are no such rows, or the file cannot be read any more.
        """
        if not 0 <= start <= stop <= self.n_rows:
            raise RecordingError(f"rows {start} to {stop}: allowed are 0 <= start <= end <= {self.n_rows}")
        return self._read_rows(start, stop)

    @abstractmethod
    def _read_rows(self, start: int, stop: int) -> np.ndarray: ...

    @abstractmethod
    def _read_field(self, field: str, start: int, stop: int) -> np.ndarray: ...

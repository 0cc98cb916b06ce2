"""Types of arrays, as annotations name them; shapes stand in docstrings."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Float = NDArray[np.float64]
Complex = NDArray[np.complex128]
Int = NDArray[np.int64]
Bool = NDArray[np.bool_]


def record(*arrays: tuple[Any, ...], **scalars: str) -> np.dtype[np.void]:
    """Return the dtype of a record: names of its scalars by type, and its arrays or inner records as numpy takes them.

    ``record(("means", "f8", (4,)), i8="count state", f8="mean")``
    """
    return np.dtype([*((name, kind) for kind, names in scalars.items() for name in names.split()), *arrays])


def undivided(rows: np.ndarray) -> np.ndarray:
    """Return a view of contiguous rows whose elements are bytes: numpy copies them some ten times as quickly as field by field.

    ``rows`` [n] of a structured dtype, or [n, k] of numbers, one element a row.
    """
    size = rows.dtype.itemsize * (rows.shape[1] if rows.ndim == 2 else 1)
    return rows.view(f"V{size}").reshape(rows.shape[0])

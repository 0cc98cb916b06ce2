"""Compiled products of a matrix and a vector, in vectors of eight."""

import numpy as np
from numpy.typing import NDArray

from vibrolock.compiled import kernel
from vibrolock.lanes import load, spread, store
from vibrolock.width import WIDTH


@kernel
def combine(columns: NDArray[np.float64], weights: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    """Compute ``out = sum_j weights[j] columns[j]``; the number of columns is even, their length a multiple of `WIDTH`."""
    n_column, n_row = columns.shape
    for i in range(0, n_row, WIDTH):
        even, odd = spread(0.0), spread(0.0)
        for j in range(0, n_column, 2):
            even = even + spread(weights[j]) * load(columns, j * n_row + i)
            odd = odd + spread(weights[j + 1]) * load(columns, (j + 1) * n_row + i)
        store(out, i, even + odd)


@kernel
def add_columns(columns: NDArray[np.float64], weights: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    """Compute ``out += sum_j weights[j] columns[j]``, for any number of columns."""
    n_column, n_row = columns.shape
    for i in range(0, n_row, WIDTH):
        total = load(out, i)
        for j in range(n_column):
            total = total + spread(weights[j]) * load(columns, j * n_row + i)
        store(out, i, total)

"""Compiled products of a matrix and a vector, in vectors of eight."""

import numpy as np
from numpy.typing import NDArray

from vibrolock.compiled import kernel
from vibrolock.lanes import load, multiply_add, spread, store
from vibrolock.width import WIDTH


@kernel
def combine(columns: NDArray[np.float64], weights: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    """Compute ``out = sum_j weights[j] columns[j]``; the number of columns is even, their length a multiple of `WIDTH`.

    Even and odd columns have sums of their own, and two vectors of rows are summed at a time: a sum waits for its last term.
    """
    n_column, n_row = columns.shape
    pairs = n_row // (2 * WIDTH) * (2 * WIDTH)
    for i in range(0, pairs, 2 * WIDTH):
        even, odd, next_even, next_odd = spread(0.0), spread(0.0), spread(0.0), spread(0.0)
        for j in range(0, n_column, 2):
            first, second = spread(weights[j]), spread(weights[j + 1])
            even = multiply_add(first, load(columns, j * n_row + i), even)
            next_even = multiply_add(first, load(columns, j * n_row + i + WIDTH), next_even)
            odd = multiply_add(second, load(columns, (j + 1) * n_row + i), odd)
            next_odd = multiply_add(second, load(columns, (j + 1) * n_row + i + WIDTH), next_odd)
        store(out, i, even + odd)
        store(out, i + WIDTH, next_even + next_odd)
    for i in range(pairs, n_row, WIDTH):
        even, odd = spread(0.0), spread(0.0)
        for j in range(0, n_column, 2):
            even = multiply_add(spread(weights[j]), load(columns, j * n_row + i), even)
            odd = multiply_add(spread(weights[j + 1]), load(columns, (j + 1) * n_row + i), odd)
        store(out, i, even + odd)


@kernel
def add_columns(columns: NDArray[np.float64], weights: NDArray[np.float64], out: NDArray[np.float64]) -> None:
    """Compute ``out += sum_j weights[j] columns[j]``, for any number of columns."""
    n_column, n_row = columns.shape
    for i in range(0, n_row, WIDTH):
        total = load(out, i)
        for j in range(n_column):
            total = multiply_add(spread(weights[j]), load(columns, j * n_row + i), total)
        store(out, i, total)

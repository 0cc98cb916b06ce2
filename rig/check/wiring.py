"""Which channel is which: the assignment of channels to what is known of them that fits best."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

__all__ = ["ALIKE", "best_assignment", "by_magnitude", "by_shape"]

Float = NDArray[np.float64]
ALIKE = 0.03  # log ratio below which two channels cannot be told apart
BETTER = 0.5  # of the misfit as wired: what another assignment must come down to
WRONG = 0.05  # RMS log ratio from which on the wiring is in doubt at all


def by_magnitude(found: Float, expected: Float) -> Float:
    """Cost [n, n] of taking channel i for j: squared log ratio of sizes [n] in sensor volts."""
    return np.asarray((np.log(found)[:, None] - np.log(expected)[None, :]) ** 2)


def by_shape(found: NDArray[np.complex128], expected: NDArray[np.complex128]) -> Float:
    """Cost [n, n] of taking response i for j over all lines [n, n_lines]: mean squared log ratio of their sizes."""
    sizes, known = np.log(np.abs(found)), np.log(np.abs(expected))
    return np.asarray(np.mean((sizes[:, None] - known[None]) ** 2, axis=-1))


def best_assignment(cost: Float) -> tuple[int, ...] | None:
    """What each channel really is where that fits far better than the wiring as declared; None where it does not."""
    rows, columns = linear_sum_assignment(cost)
    as_wired, best = float(np.mean(np.diag(cost))), float(np.mean(cost[rows, columns]))
    if as_wired < WRONG**2 or best > BETTER**2 * as_wired or np.array_equal(rows, columns):
        return None
    return tuple(int(column) for column in columns)

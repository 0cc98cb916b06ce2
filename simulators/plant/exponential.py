"""Matrix exponential of balanced matrices.

Unlike `scipy.linalg.expm` it balances; and `scipy.linalg` takes longer to import than all else in building a rig.
"""

import math

import numpy as np
from numpy.typing import NDArray

__all__ = ["balancing", "exponential"]

Matrix = NDArray[np.float64]

_LARGEST = 0.5  # norm of the matrix in the series
_TERMS = 16  # 0.5^17 / 17! is 2e-20


def exponential(matrix: Matrix) -> Matrix:
    """Return ``e^matrix`` [n, n] from its Taylor series by scaling and squaring (Moler and Van Loan 2003, method 3).

    The matrix is balanced first. Deflections, velocities and currents differ by orders of magnitude; as it stands, the matrix
    of a step that turns the fastest mode by 1 rad would be halved 15 times, and every squaring would cost digits.
    """
    scale = balancing(matrix)
    balanced = matrix * scale / scale[:, None]
    norm = float(np.linalg.norm(balanced, 1))
    halvings = math.ceil(math.log2(max(1.0, norm / _LARGEST)))
    small = balanced / 2.0**halvings
    one = np.eye(len(matrix))
    total = one
    for k in range(_TERMS, 0, -1):
        total = one + small @ total / k
    for _ in range(halvings):
        total = total @ total
    return total * scale[:, None] / scale


def balancing(matrix: Matrix) -> Matrix:
    """Return powers of two ``d`` [n] for which rows and columns of ``D^-1 A D`` have like norms (Parlett and Reinsch 1969)."""
    off = np.abs(matrix)
    np.fill_diagonal(off, 0.0)
    scale = np.ones(len(off))
    changed = True
    while changed:
        changed = False
        for i in range(len(off)):
            row, column = off[i].sum(), off[:, i].sum()
            factor = 2.0 ** round(0.5 * math.log2(row / column)) if row > 0.0 and column > 0.0 else 1.0
            if factor != 1.0:
                off[i] /= factor
                off[:, i] *= factor
                scale[i] *= factor
                changed = True
    return scale

"""From the linear plant to the arrays that the compiled integrator runs on."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from simulators.plant.assembly import LinearPlant

__all__ = ["PhiMatrices", "pad", "phi_matrices", "round_up", "step_columns"]

Matrix = NDArray[np.float64]
_VECTOR = 4


class PhiMatrices(NamedTuple):
    """The exact linear sub-step."""

    transition: Matrix
    """``e^{hA}`` [n, n]."""
    held: Matrix
    """``h phi_1(hA) B`` [n, n_input]: effect of an input held over the step."""
    ramp: Matrix
    """``h phi_2(hA) B`` [n, n_input]: effect of an input that grows linearly from 0 to 1 over the step."""


def phi_matrices(dynamics: Matrix, columns: Matrix, step_s: float) -> PhiMatrices:
    """Matrix exponential, phi_1 and phi_2 by one exponential of an augmented matrix (Van Loan 1978).

    ``phi_1(z) = (e^z - 1)/z``, ``phi_2(z) = (e^z - 1 - z)/z^2``, formed without dividing.
    """
    n, k = columns.shape
    augmented = np.zeros((n + 2 * k, n + 2 * k))
    augmented[:n, :n] = step_s * dynamics
    augmented[:n, n : n + k] = step_s * columns
    augmented[n : n + k, n + k :] = np.eye(k)
    exponential = expm(augmented)
    return PhiMatrices(exponential[:n, :n], exponential[:n, n : n + k], exponential[:n, n + k :])


def step_columns(plant: LinearPlant, step_s: float) -> tuple[Matrix, Matrix]:
    """Predictor [n_input, n + n_site] and corrector [n_site, n + n_site], site coordinates folded in as further rows."""
    columns = np.column_stack([plant.voltage_column, plant.site_columns])
    phi = phi_matrices(plant.dynamics, columns, step_s)
    predictor = np.hstack([phi.transition, phi.held])
    corrector = phi.ramp[:, 1:]
    fold = np.vstack([np.eye(plant.dynamics.shape[0]), plant.site_rows])
    return (fold @ predictor).T, (fold @ corrector).T


def pad(matrix: Matrix, *, rows: bool = True) -> Matrix:
    """Zeros added until both sizes (or the last alone) are multiples of four."""
    n_row, n_column = matrix.shape
    padded = np.zeros((round_up(n_row) if rows else n_row, round_up(n_column)))
    padded[:n_row, :n_column] = matrix
    return padded


def round_up(size: int) -> int:
    """The next multiple of four."""
    return -(-size // _VECTOR) * _VECTOR

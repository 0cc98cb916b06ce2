"""From the linear plant to the arrays that the compiled integrator runs on."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from simulators.plant.assembly import LinearPlant
from vibrolock.lanes import WIDTH

__all__ = ["PhiMatrices", "StepColumns", "aligned", "pad", "phi_matrices", "round_up", "step_columns"]

Matrix = NDArray[np.float64]


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


class StepColumns(NamedTuple):
    """The sub-step as the kernels run it, padded; rows are ``[joint coordinates, element coordinates, x]``."""

    predictor: Matrix
    """[n_input, n_row]."""
    corrector: Matrix
    """[n_site, n_row]."""


def step_columns(plant: LinearPlant, n_joint: int, step_s: float) -> StepColumns:
    """Predictor and corrector, site coordinates folded in as rows of their own.

    Joints are the last ``n_joint`` sites; their coordinates begin at row 0, where whole vectors can be loaded.
    """
    columns = np.column_stack([plant.voltage_column, plant.site_columns])
    phi = phi_matrices(plant.dynamics, columns, step_s)
    predictor = np.hstack([phi.transition, phi.held])
    corrector = phi.ramp[:, 1:]
    fold = np.vstack([np.roll(plant.site_rows, n_joint, axis=0), np.eye(plant.dynamics.shape[0])])
    return StepColumns(pad((fold @ predictor).T), pad((fold @ corrector).T, rows=False))


def pad(matrix: Matrix, *, rows: bool = True) -> Matrix:
    """Zeros added until both sizes (or the last alone) are multiples of the vector length."""
    n_row, n_column = matrix.shape
    padded = aligned((round_up(n_row) if rows else n_row, round_up(n_column)))
    padded[:n_row, :n_column] = matrix
    return padded


def aligned(shape: int | tuple[int, ...]) -> Matrix:
    """Zeros that begin where a cache line does, so that no vector of a compiled loop straddles two."""
    size = int(np.prod(shape))
    line = WIDTH
    whole = np.zeros(size + line)
    skip = (-whole.ctypes.data // whole.itemsize) % line
    return whole[skip : skip + size].reshape(shape)


def round_up(size: int) -> int:
    """The next multiple of the vector length."""
    return -(-size // WIDTH) * WIDTH

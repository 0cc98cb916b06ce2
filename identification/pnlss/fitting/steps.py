"""Damped steps from normal equations: columns of unit norm, one decomposition, any damping a diagonal."""

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from identification.pnlss.fitting.normal_equations import NormalEquations

__all__ = ["Steps"]

Float = NDArray[np.float64]


class Steps:
    """Solutions of ``(H + damping w_max D^2) step = -g`` in the span of eigenvectors that the data tell of.

    D^2 is the diagonal of H, so that neither units nor degrees matter; w_max is the largest eigenvalue of ``D^-1 H D^-1``.
    n_states^2 directions change no output at all: eigenvalues below ``truncation w_max`` are left out, which a factorisation
    could not do.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the decomposition does not converge.
    """

    def __init__(self, equations: NormalEquations, truncation: float) -> None:
        diagonal = np.sqrt(np.diag(equations.hessian))
        self._scale = np.divide(1.0, diagonal, out=np.zeros_like(diagonal), where=diagonal > 0.0)
        scaled = equations.hessian * self._scale * self._scale[:, None]
        values, vectors = eigh(scaled, driver="evd", overwrite_a=True, check_finite=False)
        self._kept = values > max(truncation, np.finfo(float).tiny) * values[-1]
        self._values = values[self._kept]
        self._vectors = vectors[:, self._kept]
        self._gradient = self._vectors.T @ (self._scale * equations.gradient)

    @property
    def rank(self) -> int:
        """Number of directions that are not left out."""
        return int(np.count_nonzero(self._kept))

    def at(self, damping: float) -> Float:
        """Step with this damping, relative to the largest eigenvalue."""
        if not self.rank:
            return np.zeros_like(self._scale)
        solved = self._gradient / (self._values + damping * self._values[-1])
        return np.asarray(-self._scale * (self._vectors @ solved))

    def promised(self, damping: float) -> float:
        """Squared errors that the step with this damping takes away, if outputs are linear in the parameters."""
        values, damped = self._values, self._values + damping * self._values[-1:]
        return float(np.sum(self._gradient**2 * (2.0 * damped - values) / damped**2))

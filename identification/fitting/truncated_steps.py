"""Damped steps from normal equations, without the directions that the data do not determine.

Normal equations are scaled to columns of unit norm and decomposed once; each damping then only changes a diagonal.
"""

import numpy as np

from vibrolock.arrays import Float


class TruncatedSteps:
    """Solutions of ``(H + damping w_max D^2) step = -g`` in the span of the eigenvectors that the data determine.

    D^2 is the diagonal of H, so that the step does not depend on units or on the degrees of monomials; w_max is the largest
    eigenvalue of ``D^-1 H D^-1``. Eigenvalues below ``truncation w_max`` are left out, which a factorisation could not do.

    Raises `numpy.linalg.LinAlgError` if the decomposition does not converge.

    Parameters
    ----------
    hessian, gradient
        float[P, P] and float[P]: H and g, of half the cost.
    vector
        float[P], from which the steps lead.
    cost
        Cost there.
    truncation
        Smallest eigenvalue that is kept, relative to the largest.
    """

    def __init__(self, hessian: Float, gradient: Float, vector: Float, cost: float, truncation: float) -> None:
        self._from, self.cost = vector, cost
        diagonal = np.sqrt(np.diag(hessian))
        self._scale = np.divide(1.0, diagonal, out=np.zeros_like(diagonal), where=diagonal > 0.0)
        values, vectors = np.linalg.eigh(hessian * self._scale * self._scale[:, None])
        self._kept = values > max(truncation, np.finfo(float).tiny) * values[-1]
        self._values = values[self._kept]
        self._vectors = vectors[:, self._kept]
        self._gradient = self._vectors.T @ (self._scale * gradient)

    @property
    def rank(self) -> int:
        """Number of directions kept."""
        return int(np.count_nonzero(self._kept))

    def step(self, damping: float) -> Float:
        """Return the step with this damping, which is relative to the largest eigenvalue."""
        if not self.rank:
            return np.zeros_like(self._scale)
        solved = self._gradient / (self._values + damping * self._values[-1])
        return np.asarray(-self._scale * (self._vectors @ solved))

    def vector(self, damping: float) -> Float:
        """Return the vector to which the step with this damping leads."""
        return np.asarray(self._from + self.step(damping))

    def predicted(self, damping: float) -> float:
        """Return the predicted decrease of the squared errors with this damping, for outputs linear in the parameters."""
        values, damped = self._values, self._values + damping * self._values[-1:]
        return float(np.sum(self._gradient**2 * (2.0 * damped - values) / damped**2))

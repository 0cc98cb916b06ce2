"""Damped steps within bounds, from the QR decomposition of derivatives and residuals.

Each step solves a linear least-squares problem with damping and bounds exactly, by an active set. Numbers that belong at a
bound (sliders that a joint does not need) thereby arrive there. Interior methods approach it by a share in each iteration.
"""

from collections.abc import Callable

import numpy as np

from identification.fitting.levenberg_marquardt import DampingRule, Minimum, Step, minimise
from identification.fitting.result import Ending, FitStatus
from vibrolock.arrays import Float

Bounds = tuple[Float, Float]

_RULE = DampingRule(first=1e-3, factor=3.0, smallest=1e-12, largest=1e6, worth=0.1)
"""Choice of the damping, relative to derivatives of unit norm. Chosen: a cost takes a third of the time of derivatives."""


def qr_r(matrix: Float) -> Float:
    """Return the triangle R of the QR decomposition: columns with the same norms and scalar products."""
    return np.asarray(np.linalg.qr(matrix, mode="r"), dtype=np.float64)


def bounded_minimum(
    triangle: Callable[[Float], Float],
    cost: Callable[[Float], float],
    vector: Float,
    bounds: Bounds,
    tolerance: float,
    iterations: int,
) -> Minimum:
    """Minimise a sum of squares within bounds (`BoundedLeastSquares`).

    Parameters
    ----------
    triangle, cost, bounds
        Those of `BoundedLeastSquares`.
    vector
        float[P], initial numbers.
    tolerance
        Relative gain, achieved and predicted, below which the iterations end.
    iterations
        Iterations at most.
    """

    def ending(count: int, step: Step | None) -> Ending | None:
        if step is not None and max(step.before - step.cost, step.predicted) <= tolerance * step.before:
            return Ending(FitStatus.CONVERGED, f"the last iteration gained less than {tolerance:g}")
        return Ending.of(FitStatus.ITERATION_LIMIT, limit=iterations) if count == iterations else None

    return minimise(BoundedLeastSquares(triangle, cost, bounds), np.clip(vector, *bounds), _RULE, ending)


class BoundedLeastSquares:
    """A sum of squares with least and largest numbers, for `identification.fitting.levenberg_marquardt.minimise`.

    Dampings are relative to derivatives of unit norm, with the scales of More (1978): the largest norm of a column so far.

    Parameters
    ----------
    triangle
        float[P + 1, P + 1]: triangle of derivatives and residuals, [J r] = Q R, at a vector.
    cost
        Sum of squares at a vector.
    bounds
        float[P] each, least and largest numbers.
    """

    def __init__(self, triangle: Callable[[Float], Float], cost: Callable[[Float], float], bounds: Bounds) -> None:
        self._triangle, self.cost, self._bounds = triangle, cost, bounds
        self._norms = np.zeros_like(bounds[0])

    def linearised(self, vector: Float) -> "BoundedSteps":
        """Return the steps from a vector."""
        found = self._triangle(vector)
        self._norms = np.maximum(self._norms, np.linalg.norm(found[:, :-1], axis=0))
        return BoundedSteps(found, np.where(self._norms > 0.0, self._norms, 1.0), vector, self._bounds)


class BoundedSteps:
    """Steps with any damping from one vector."""

    def __init__(self, triangle: Float, scale: Float, vector: Float, bounds: Bounds) -> None:
        self._scale, self._vector, self._bounds = scale, vector, bounds
        self._jacobian, self._residual = triangle[:, :-1] / scale, triangle[:, -1]
        self.cost = float(self._residual @ self._residual)
        self._known: dict[float, tuple[Float, float]] = {}

    def _solved(self, damping: float) -> tuple[Float, float]:
        """Return the step, in scaled numbers, and the decrease of the sum of squares that it predicts."""
        from scipy.optimize import lsq_linear  # only on use: it takes long to load

        if damping not in self._known:
            count = self._scale.size
            matrix = np.concatenate([self._jacobian, np.sqrt(damping) * np.eye(count)])
            right = np.concatenate([-self._residual, np.zeros(count)])
            least, largest = ((bound - self._vector) * self._scale for bound in self._bounds)
            step = lsq_linear(matrix, right, (least, largest), method="bvls").x
            left = self._residual + self._jacobian @ step
            self._known[damping] = step, self.cost - float(left @ left)
        return self._known[damping]

    def vector(self, damping: float) -> Float:
        """Return the vector to which the step with this damping leads."""
        return np.clip(self._vector + self._solved(damping)[0] / self._scale, *self._bounds)

    def predicted(self, damping: float) -> float:
        """Return the predicted decrease of the sum of squares."""
        return self._solved(damping)[1]

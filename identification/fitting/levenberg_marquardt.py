"""Levenberg-Marquardt iterations whose numbers stay within bounds.

Each step solves a linear least-squares problem with damping and bounds exactly, by an active set. Numbers that belong at a
bound (sliders that a joint does not need) thereby arrive there. Interior methods approach it by a share in each iteration.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from vibrolock.arrays import Float

_FIRST, _FACTOR = 1e-3, 3.0
_SMALLEST, _LARGEST = 1e-12, 1e6
"""Dampings, relative to derivatives of unit norm."""
_WORTH = 0.1
"""A smaller damping is tried if its predicted gain exceeds that of the last by more than this share."""


class Minimum(NamedTuple):
    """Where the iterations ended."""

    vector: Float
    evaluations: int
    """Number of triangles."""
    stopped: str


def minimum(
    triangle: Callable[[Float], Float],
    cost: Callable[[Float], float],
    vector: Float,
    bounds: tuple[Float, Float],
    tolerance: float,
    evaluations: int,
) -> Minimum:
    """Minimise a sum of squares (Marquardt, J. SIAM 11, 1963, 431, with the scales of More, 1978).

    Parameters
    ----------
    triangle
        float[P + 1, P + 1]: triangle of derivatives and residuals, [J r] = Q T, at a vector.
    cost
        Sum of squares at a vector. It is asked for more often, for several dampings in an iteration.
    vector
        float[P], initial numbers.
    bounds
        float[P] each, least and largest numbers.
    tolerance
        Relative gain, achieved and predicted, below which the iterations end.
    evaluations
        Triangles at most.
    """
    vector, damping = np.clip(vector, *bounds), _FIRST
    scale = np.zeros_like(vector)
    for count in range(1, evaluations + 1):
        found = triangle(vector)
        before = float(found[:, -1] @ found[:, -1])
        scale = np.maximum(scale, np.linalg.norm(found[:, :-1], axis=0))
        best = _descend(_Steps(found, scale, vector, bounds, cost), damping)
        if best is None:
            return Minimum(vector, count, "no step of any damping fits better")
        vector, damping = best.vector, best.damping
        if max(before - best.cost, best.promised) <= tolerance * before:
            return Minimum(vector, count, f"the last iteration gained less than {tolerance:g}")
    return Minimum(vector, evaluations, f"stopped at its limit of {evaluations} iterations")


def triangle_of(matrix: Float) -> Float:
    """Return the triangle of the QR decomposition: columns with the same norms and scalar products."""
    return np.asarray(np.linalg.qr(matrix, mode="r"), dtype=np.float64)


class _Trial(NamedTuple):
    vector: Float
    damping: float
    promised: float
    cost: float


class _Steps:
    """Steps with any damping from one vector."""

    def __init__(
        self,
        triangle: Float,
        scale: Float,
        vector: Float,
        bounds: tuple[Float, Float],
        cost: Callable[[Float], float],
    ) -> None:
        self._scale = np.where(scale > 0.0, scale, 1.0)
        self._jacobian, self._residual = triangle[:, :-1] / self._scale, triangle[:, -1]
        self._vector, self._bounds, self._cost = vector, bounds, cost
        self.before = float(self._residual @ self._residual)
        self._known: dict[float, tuple[Float, float]] = {}

    def at(self, damping: float) -> tuple[Float, float]:
        """Return the step, in scaled numbers, and the decrease of the sum of squares that it promises."""
        from scipy.optimize import lsq_linear  # only on use: it takes long to load

        if damping not in self._known:
            count = self._scale.size
            matrix = np.concatenate([self._jacobian, np.sqrt(damping) * np.eye(count)])
            least, largest = ((bound - self._vector) * self._scale for bound in self._bounds)
            step = lsq_linear(
                matrix, np.concatenate([-self._residual, np.zeros(count)]), (least, largest), method="bvls"
            ).x
            left = self._residual + self._jacobian @ step
            self._known[damping] = step, self.before - float(left @ left)
        return self._known[damping]

    def tried(self, damping: float) -> _Trial:
        """Return where the step leads."""
        step, promised = self.at(damping)
        return self._reached(step, damping, promised)

    def _reached(self, step: Float, damping: float, promised: float) -> _Trial:
        vector = np.clip(self._vector + step / self._scale, *self._bounds)
        return _Trial(vector, damping, promised, self._cost(vector))


def _descend(steps: _Steps, damping: float) -> _Trial | None:
    """Return a step that reduces the cost; None if no step does."""
    best = steps.tried(max(damping / _FACTOR, _SMALLEST))
    if best.cost < steps.before:
        while best.damping > _SMALLEST:
            if steps.at(best.damping / _FACTOR)[1] < (1.0 + _WORTH) * best.promised:
                break
            other = steps.tried(best.damping / _FACTOR)
            if not other.cost < best.cost:
                break
            best = other
        return best
    while best.damping < _LARGEST:
        best = steps.tried(best.damping * _FACTOR)
        if best.cost < steps.before:
            return best
    return None

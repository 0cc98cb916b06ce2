"""Newton's method at a fixed parameter, and the linear equations that every step solves."""

import numpy as np
from numpy.typing import ArrayLike

from identification.continuation.path import Steps, System
from vibrolock.arrays import Float


def solved(
    system: System, unknowns: ArrayLike, parameter: float, *, scale: ArrayLike = 1.0, steps: Steps | None = None
) -> Float | None:
    """Solve for the unknowns at a fixed parameter by Newton's method from ``unknowns``; return None if it does not converge."""
    z = np.array(unknowns, dtype=float)
    allowed, size = steps or Steps(), np.broadcast_to(np.asarray(scale, dtype=float), z.shape)
    for _ in range(allowed.iterations):
        residual, jacobian, _ = evaluated(system, z, parameter)
        change = solution(jacobian * size, -residual)
        if change is None:
            return None
        z = z + size * change
        if np.linalg.norm(change) <= allowed.tolerance * max(1.0, float(np.linalg.norm(z / size))):
            return z
    return None


def tangent_of(bordered: Float) -> Float | None:
    """Return the unit tangent that has a positive product with the last row of ``bordered``; None if it does not exist."""
    right = np.zeros(len(bordered))
    right[-1] = 1.0
    tangent = solution(bordered, right)
    return None if tangent is None else tangent / np.linalg.norm(tangent)


def evaluated(system: System, z: Float, parameter: float) -> tuple[Float, Float, Float]:
    """Evaluate the equations; an overflow gives inf or NaN without a warning."""
    with np.errstate(all="ignore"):
        return system(z, parameter)


def solution(matrix: Float, right: Float) -> Float | None:
    """Solve linear equations after scaling each row by its largest coefficient; return None if there is no finite solution."""
    with np.errstate(all="ignore"):
        size = np.max(np.abs(matrix), axis=1)
        if not (np.all(np.isfinite(size)) and np.all(np.isfinite(right)) and np.all(size > 0.0)):
            return None
        try:
            found = np.linalg.solve(matrix / size[:, None], right / size)
        except np.linalg.LinAlgError:
            return None
    return found if np.all(np.isfinite(found)) else None

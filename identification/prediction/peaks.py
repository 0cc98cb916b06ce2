"""The largest value of a sampled curve."""

import numpy as np
from numpy.typing import NDArray

__all__ = ["peak_of"]

Float = NDArray[np.float64]

_NEAR_THE_TOP = 0.9


def peak_of(amplitude: Float, *columns: Float) -> tuple[float, ...]:
    """Largest amplitude of a curve and the other columns there, by a parabola through the three highest points.

    Points are taken as evenly spaced along the curve. Where a neighbour of the largest is missing, or lies so far below
    it that the curve jumps or is too coarsely sampled, it is the largest point itself.
    """
    top = int(np.argmax(amplitude))
    values = np.column_stack([amplitude, *columns])
    if not 0 < top < amplitude.size - 1:
        return tuple(values[top].tolist())
    before, here, after = amplitude[top - 1 : top + 2]
    bend = before - 2.0 * here + after
    if min(before, after) < _NEAR_THE_TOP * here or bend == 0.0:
        return tuple(values[top].tolist())
    shift = 0.5 * (before - after) / bend
    weights = np.array([0.5 * shift * (shift - 1.0), 1.0 - shift**2, 0.5 * shift * (shift + 1.0)])
    return tuple((weights @ values[top - 1 : top + 2]).tolist())

"""Types of a continuation: the system of equations, the step control and the resulting path."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.validation import positive
from vibrolock.arrays import Float

System = Callable[[Float, float], tuple[Float, Float, Float]]
"""``F(z, p)`` float[n] with its derivatives float[n, n] with respect to z and float[n] with respect to p."""
Ending = Literal["range", "size", "closed", "points", "step", "stopped"]


@dataclass(frozen=True, kw_only=True)
class Steps:
    """Step control of a continuation.

    Parameters
    ----------
    first, smallest, largest
        Length of the first step; shortest step tried before the path ends; longest step.
    angle_deg
        Largest angle between the tangents at both ends of a step.
    iterations
        Newton iterations before a step counts as failed.
    tolerance
        A solution is accepted once the length of the last Newton correction is at most this.
    kinks
        Whether the curve may have kinks, as where dry friction begins to slip. Where even the shortest step fails, the path
        then goes on along the tangent just ahead, within 90 degrees of its own.
    """

    first: float = 0.02
    smallest: float = 1e-6
    largest: float = 0.1
    angle_deg: float = 20.0
    iterations: int = 8
    tolerance: float = 1e-8
    kinks: bool = False

    def __post_init__(self) -> None:
        for name in ("first", "smallest", "largest", "angle_deg", "tolerance"):
            positive(name, getattr(self, name))
        IdentificationError.unless_at_least("iterations", self.iterations, 1)


@dataclass(frozen=True, eq=False, kw_only=True)
class Path:
    """Points of a curve, in the order in which they were found.

    Parameters
    ----------
    unknowns, parameter
        float[n, n_unknowns], float[n], the points.
    direction
        float[n], component of the unit tangent along the parameter. Its sign changes at turning points. There the Jacobian
        with respect to the unknowns is singular, and the sign of its determinant changes too.
    turning_unknowns, turning_parameter
        float[k, n_unknowns], float[k], turning points, where the parameter turns back.
    turning_after
        int[k], index of the last point before each turning point.
    ending
        Why the path ends. ``range``: the parameter reached the end of its range, where the last point lies. ``size``: the
        unknowns exceeded the allowed size. ``closed``: the path returned to its first point, which is also its last.
        ``points``: the largest number of points was reached. ``step``: even the shortest step failed. ``stopped``: the
        function ``stop`` ended it.
    reason
        Text that ``stop`` returned; empty otherwise.
    """

    unknowns: Float
    parameter: Float
    direction: Float
    turning_unknowns: Float
    turning_parameter: Float
    turning_after: NDArray[np.int64]
    ending: Ending
    reason: str = ""

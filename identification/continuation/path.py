"""What a continuation follows, how it steps, and the points that it finds."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.validation import positive

__all__ = ["Ending", "Path", "Steps", "System"]

Float = NDArray[np.float64]
System = Callable[[Float, float], tuple[Float, Float, Float]]
"""``F(z, p)`` float[n] with its derivatives float[n, n] with respect to z and float[n] with respect to p."""
Ending = Literal["range", "size", "closed", "points", "step", "stopped"]


@dataclass(frozen=True, kw_only=True)
class Steps:
    """Step control of a continuation.

    Parameters
    ----------
    first, smallest, largest
        Length of the first step; shortest that is tried before the path ends; longest.
    angle_deg
        Largest angle between the tangents at both ends of a step.
    iterations
        Newton iterations before a step counts as failed.
    tolerance
        Length of the last Newton correction, with which a solution is accepted.
    """

    first: float = 0.02
    smallest: float = 1e-6
    largest: float = 0.1
    angle_deg: float = 20.0
    iterations: int = 8
    tolerance: float = 1e-8

    def __post_init__(self) -> None:
        for name in ("first", "smallest", "largest", "angle_deg", "tolerance"):
            positive(name, getattr(self, name))
        if self.iterations < 1:
            raise IdentificationError(f"iterations: is {self.iterations}, needs at least 1")


@dataclass(frozen=True, eq=False, kw_only=True)
class Path:
    """Points of a curve, in the order in which they were found.

    Parameters
    ----------
    unknowns, parameter
        float[n, n_unknowns], float[n].
    direction
        float[n], parameter's part of the unit tangent: its sign changes at turning points, where the derivative with
        respect to the unknowns is singular, and with it the sign of that derivative's determinant.
    turning_unknowns, turning_parameter
        float[k, n_unknowns], float[k], points where the parameter turns back.
    turning_after
        int[k], the last point before each.
    ending
        Why the path ends: it left the ``range`` of the parameter (then its last point is at the end of the range), grew
        beyond the allowed ``size``, ``closed`` on itself (then its last point is its first), has all its ``points``, no
        ``step`` however short leads on, or it was ``stopped``.
    reason
        What the one who stopped it said.
    """

    unknowns: Float
    parameter: Float
    direction: Float
    turning_unknowns: Float
    turning_parameter: Float
    turning_after: NDArray[np.int64]
    ending: Ending
    reason: str = ""

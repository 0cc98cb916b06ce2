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
Ending = Literal["range", "closed", "points", "step", "stopped"]


@dataclass(frozen=True, kw_only=True)
class Steps:
    """Step control of a continuation."""

    first: float = 0.02
    """Length of the first step."""
    smallest: float = 1e-6
    """Shortest step tried before the path ends."""
    largest: float = 0.1
    """Longest step."""
    angle_deg: float = 20.0
    """Largest angle between the tangents at both ends of a step."""
    iterations: int = 8
    """Newton iterations before a step counts as failed."""
    tolerance: float = 1e-8
    """A solution is accepted once the length of the last Newton correction is at most this."""
    kinks: bool = False
    """Whether the curve may have kinks, as where dry friction begins to slip. Where even the shortest step fails, the path
    then goes on along the tangent just ahead, within 90 degrees of its own."""

    def __post_init__(self) -> None:
        for name in ("first", "smallest", "largest", "angle_deg", "tolerance"):
            positive(name, getattr(self, name))
        IdentificationError.unless_at_least("iterations", self.iterations, 1)


@dataclass(frozen=True, eq=False, kw_only=True)
class Path:
    """Points of a curve, in the order in which they were found."""

    unknowns: Float
    """float[n, n_unknowns], the points."""
    parameter: Float
    """float[n], the parameter at them."""
    direction: Float
    """float[n], component of the unit tangent along the parameter. Its sign changes at turning points. There the
    Jacobian with respect to the unknowns is singular, and the sign of its determinant changes too."""
    turning_unknowns: Float
    """float[k, n_unknowns], turning points, where the parameter turns back."""
    turning_parameter: Float
    """float[k], the parameter at them."""
    turning_after: NDArray[np.int64]
    """int[k], index of the last point before each turning point."""
    ending: Ending
    """Why the path ends. ``range``: the parameter reached the end of its range, where the last point lies. ``closed``:
    the path returned to its first point, which is also its last. ``points``: the largest number of points was reached.
    ``step``: even the shortest step failed. ``stopped``: the function ``stop`` ended it."""
    reason: str = ""
    """Text that ``stop`` returned; empty otherwise."""

"""What the figures of all analyses share."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["LEVEL_COLOURS", "length_unit", "level_colour", "roomy"]

LEVEL_COLOURS = "viridis"


def length_unit(largest_m: float) -> tuple[float, str]:
    """Factor and name of the unit in which displacements up to ``largest_m`` read well."""
    return (1e6, "µm") if largest_m < 5e-4 else (1e3, "mm")


def level_colour(number: int, count: int) -> tuple[float, float, float, float]:
    """Colour of one of several levels, dark to light."""
    from matplotlib import colormaps

    return colormaps[LEVEL_COLOURS](0.85 * number / max(1, count - 1))


def roomy(axis: "Axes", values: NDArray[np.float64], least_share: float) -> None:
    """Let the y axis span at least a share of its middle, so that what hardly changes looks like it."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    middle, half = 0.5 * (low + high), 0.55 * (high - low)
    half = max(half, 0.5 * least_share * abs(middle))
    axis.set_ylim(middle - half, middle + half)

"""Panels that figures of results share: an amplitude over the frequency with unstable parts dotted, values with a band."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LENGTHS = {"mm": 1e3, "µm": 1e6}
"""Factors from metres."""


def length_factor(amplitude_m: NDArray[np.float64]) -> tuple[float, str]:
    """Return factor and name of the unit in which displacements read best."""
    from rig.drawing.style import engineering

    unit = engineering(amplitude_m)[1]
    return LENGTHS[unit], unit


def branches(
    axis: "Axes", x: NDArray[Any], y: NDArray[Any], stable: NDArray[np.bool_] | None, *, label: str, **style: Any
) -> None:
    """Draw a curve that may fold: stable parts as a line, unstable parts dotted, with one entry in the legend each."""
    if stable is None or stable.all():
        axis.plot(x, y, label=label, **style)
        return
    for which, line, name in ((stable, "-", label), (~stable, ":", "unstable")):
        near = which | np.concatenate([which[1:], [False]])
        axis.plot(x, np.where(near, y, np.nan), line, label=name, **style)


def band(axis: "Axes", x: ArrayLike, middle: ArrayLike, half: ArrayLike, colour: str, *, label: str) -> None:
    """Draw values as a line, and ``half`` on both sides of them as a band."""
    mean, width = np.asarray(middle), np.asarray(half)
    axis.fill_between(x, mean - width, mean + width, color=colour, alpha=0.2, lw=0)
    axis.plot(x, mean, "o-", color=colour, label=label)

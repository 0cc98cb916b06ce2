"""Figure of responses at constant force: amplitude and phase, unstable branches dashed, the backbone on top."""

from typing import TYPE_CHECKING

import numpy as np

from rig.analysis.drawing import length_unit, level_colour
from rig.figures.style import REJECTED, SECOND
from simulators.analysis import PeriodicResponses

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw_curves"]


def draw_curves(page: "Figure", curves: dict[float, PeriodicResponses], resonances: PeriodicResponses) -> None:
    """Amplitude above phase lag, over the frequency."""
    from matplotlib.lines import Line2D

    top, bottom = page.subplots(2, 1, sharex=True, height_ratios=(2.0, 1.0))
    scale, unit = length_unit(max(float(np.max(curve.amplitude_m)) for curve in curves.values()))
    handles = []
    for number, (force, curve) in enumerate(curves.items()):
        colour = level_colour(number, len(curves))
        _branches(top, curve, scale * curve.amplitude_m, colour)
        _branches(bottom, curve, curve.phase_lag_deg, colour)
        handles.append(Line2D([], [], color=colour, label=f"{force:.4g} N"))
    if any(curve.stable is not None and not np.all(curve.stable) for curve in curves.values()):
        handles.append(Line2D([], [], color=REJECTED, ls=(0, (4, 2)), label="unstable"))
    top.plot(resonances.frequency_hz, scale * resonances.amplitude_m, "o-", ms=3.5, lw=0.9, color=SECOND)
    handles.append(Line2D([], [], color=SECOND, marker="o", ms=3.5, lw=0.9, label="phase resonance"))
    top.set_ylabel(f"displacement amplitude, {unit}")
    top.set_ylim(bottom=0.0)
    bottom.axhline(-90.0, color=SECOND, lw=0.9)
    bottom.set(xlabel="frequency, Hz", ylabel="lag of acceleration, deg", yticks=(-180, -90, 0), ylim=(-185, 5))
    page.legend(handles=handles, loc="outside lower center", ncols=6, fontsize=8)


def _branches(axis: "Axes", curve: PeriodicResponses, values: np.ndarray, colour: object) -> None:
    """Stable parts solid, unstable ones dashed, each up to the neighbouring point of the other."""
    stable = np.ones(values.size, bool) if curve.stable is None else curve.stable
    for kind, style in ((True, "-"), (False, (0, (4, 2)))):
        mine = stable == kind
        if kind is False:  # the dashes reach to the folds
            mine = mine | np.append(mine[1:], False) | np.append(False, mine[:-1])
        axis.plot(
            np.where(mine, curve.frequency_hz, np.nan), np.where(mine, values, np.nan), ls=style, color=colour, lw=1.3
        )

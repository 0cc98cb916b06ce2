"""Figure of the steady response to a constant voltage: force, displacement and lag over frequency."""

from typing import TYPE_CHECKING, Any

import numpy as np

from rig.analysis.drawing import length_unit
from rig.figures.style import MAIN, REJECTED, SECOND
from simulators.analysis import PeriodicResponses

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["draw_forced"]


def draw_forced(page: "Figure", up: PeriodicResponses, down: PeriodicResponses | None) -> None:
    """Three panels over the frequency; the falling direction where it differs."""
    force, response, lag = page.subplots(3, 1, sharex=True, height_ratios=(2.0, 2.0, 1.0))
    scale, unit = length_unit(float(np.max(up.amplitude_m)))
    ways: list[tuple[PeriodicResponses, Any, str, str]] = [
        (up, "-", MAIN, "frequency rising" if down is not None else "either direction")
    ]
    if down is not None:
        ways.append((down, (0, (4, 2)), SECOND, "frequency falling"))
    for way, style, colour, label in ways:
        force.plot(way.frequency_hz, way.force_n, ls=style, color=colour, label=label)
        response.plot(way.frequency_hz, scale * way.amplitude_m, ls=style, color=colour)
        lag.plot(way.frequency_hz, way.phase_lag_deg, ls=style, color=colour)
    force.set_ylabel("force (fundamental), N")
    response.set_ylabel(f"displacement, {unit}")
    for axis in (force, response):
        axis.set_ylim(bottom=0.0)
    lag.axhline(-90.0, color=REJECTED, lw=0.8)
    lag.set(xlabel="frequency, Hz", ylabel="lag of accel., deg", yticks=(-180, -90, 0), ylim=(-190, 10))
    page.legend(*force.get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=8)

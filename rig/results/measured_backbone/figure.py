"""Figure of a backbone that was measured with another system."""

from typing import TYPE_CHECKING

import numpy as np

from identification import Backbone
from rig.drawing.page import grid
from rig.drawing.style import MAIN, REJECTED, engineering, title

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_backbone(page: "Figure", backbone: Backbone) -> None:
    """Draw amplitude and force over the frequency, amplitude over the force, and the phase error."""
    axes = grid(page, 2, 2)
    amplitude, unit = engineering(np.asarray(backbone.amplitude_m))
    frequency, force = backbone.frequency_hz, np.asarray(backbone.force_n)
    error = [point.phase_error_deg for point in backbone.points]
    for axis, x, y, labels in (
        (axes[0, 0], frequency, amplitude, ("frequency, Hz", f"displacement, {unit}")),
        (axes[0, 1], frequency, force, ("frequency, Hz", "force, N")),
        (axes[1, 0], force, amplitude, ("force, N", f"displacement, {unit}")),
        (axes[1, 1], amplitude, error, (f"displacement, {unit}", "phase error, deg")),
    ):
        axis.plot(x, y, "o-", color=MAIN)
        axis.set(xlabel=labels[0], ylabel=labels[1])
    axes[1, 1].axhline(0.0, color=REJECTED, lw=0.8)
    largest = 1.1 * max(1.0, float(np.nanmax(np.abs([*error, 0.0]))))
    axes[1, 1].set_ylim(-largest, largest)
    title(page, f"{backbone.specimen or 'specimen'}: measured backbone")

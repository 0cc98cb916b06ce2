"""Figure of stepped-sine responses, level by level."""

from typing import TYPE_CHECKING

import numpy as np

from identification import FrequencyResponse
from rig.drawing.page import grid, legend_below
from rig.drawing.style import REJECTED, engineering, plain_log, shade, title

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_responses(page: "Figure", responses: tuple[FrequencyResponse, ...]) -> None:
    """Draw amplitude and phase lag over frequency."""
    top, bottom = grid(page, 2, 1, sharex=True)[:, 0]
    everything = np.concatenate([response.amplitude_m for response in responses])
    unit = engineering(everything)[1]
    scale = {"mm": 1e3, "µm": 1e6}[unit]
    for number, response in enumerate(responses):
        colour = shade(number, len(responses))
        order = np.argsort(response.frequency_hz)
        label = response.label or f"{response.level:g}"
        line = ".--" if response.controlled == "force" else ".-"
        top.semilogy(response.frequency_hz[order], scale * response.amplitude_m[order], line, color=colour, label=label)
        bottom.plot(response.frequency_hz[order], response.phase_lag_deg[order], line, color=colour)
    top.set(ylabel=f"displacement, {unit}")
    plain_log(top)
    bottom.set(xlabel="frequency, Hz", ylabel="phase lag, deg")
    bottom.axhline(90.0, color=REJECTED, lw=0.8)
    legend_below(page, top)
    title(page, f"{responses[0].specimen or 'specimen'}: stepped-sine responses, {len(responses)} levels")

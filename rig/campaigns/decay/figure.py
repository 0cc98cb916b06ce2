"""Figure of decays: their modal properties over the amplitude beside the settled points, and the amplitude over time."""

from itertools import cycle

import numpy as np

from identification import IdentificationError, nonlinear_mode
from rig.campaigns.decay.points import recorded_decays, recorded_settled
from rig.campaigns.evaluation.figure import draw_failure, draw_history, heading
from rig.drawing.page import grid
from rig.drawing.style import COLOURS, MAIN, Figure, engineering
from rig.recording.reader import Recording


def draw(page: Figure, recording: Recording) -> None:
    """Draw modal frequency and damping of settled points and decays, and the history of the control loop."""
    try:
        settled, decays = nonlinear_mode(recorded_settled(recording)), recorded_decays(recording)
    except IdentificationError:
        draw_failure(page, recording)
        return
    axes = grid(page, 2, 2)
    frequency, damping = axes[0]
    amplitude_m = np.concatenate([settled.amplitude_m, *(found.mode().amplitude_m for found in decays.values())])
    scaled, unit = engineering(amplitude_m)
    scale = float(scaled[0] / amplitude_m[0])
    colours = cycle(colour for colour in COLOURS if colour != MAIN)
    for colour, (number, found) in zip(colours, decays.items(), strict=False):
        mode, label = found.mode(), f"decay of point {number + 1}"
        x = scale * mode.amplitude_m
        style = {"fmt": "o-", "ms": 3.0, "color": colour, "capsize": 2.0}
        frequency.errorbar(x, mode.modal_frequency_hz, mode.modal_frequency_bound_95_hz, label=label, **style)
        damping.errorbar(x, 100.0 * mode.damping_ratio, 100.0 * mode.damping_ratio_bound_95, **style)
    x = scale * settled.amplitude_m
    settled_style = {"fmt": "s", "color": MAIN, "capsize": 2.0}
    frequency.errorbar(
        x, settled.modal_frequency_hz, settled.bound_95("modal_frequency_hz"), label="settled", **settled_style
    )
    damping.errorbar(x, 100.0 * settled.damping_ratio, 100.0 * settled.bound_95("damping_ratio"), **settled_style)
    for axis, name in ((frequency, "modal frequency, Hz"), (damping, "modal damping, %")):
        axis.set(xlabel=f"displacement amplitude, {unit}", ylabel=name, xscale="log")
    damping.set_ylim(0.0, 250.0 * float(np.max(settled.damping_ratio)))
    frequency.ticklabel_format(axis="y", useOffset=False)
    frequency.legend()
    draw_history(axes[1, 0], axes[1, 1], recording)
    heading(page, recording)

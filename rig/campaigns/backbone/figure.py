"""Figure of a backbone: modal properties over the amplitude, and the history of the control loop."""

from identification import IdentificationError, nonlinear_mode
from rig.campaigns.backbone.points import recorded_backbone
from rig.campaigns.evaluation.figure import draw_failure, draw_history, heading
from rig.drawing.axes import widen
from rig.drawing.nonlinear_mode import draw_properties
from rig.drawing.page import grid
from rig.drawing.style import Figure
from rig.recording.reader import Recording

LEAST_SPAN = 1e-3
"""Smallest part of the frequency that its axis spans: less would show its scatter as if it were a change."""


def draw(page: Figure, recording: Recording) -> None:
    """Draw frequency and damping over the amplitude, and the history of the control loop; if no point counts, only that."""
    try:
        mode = nonlinear_mode(recorded_backbone(recording))
    except IdentificationError:
        draw_failure(page, recording)
        return
    axes = grid(page, 2, 2)
    draw_properties(axes[0, 0], axes[0, 1], mode)
    widen(axes[0, 0], LEAST_SPAN)
    draw_history(axes[1, 0], axes[1, 1], recording)
    heading(page, recording)

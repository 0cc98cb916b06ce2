"""Figure of a backbone: modal properties over the amplitude, and the history of the control loop."""

from typing import TYPE_CHECKING

from identification import IdentificationError, NonlinearMode, nonlinear_mode
from rig.campaigns.backbone.points import recorded_backbone
from rig.campaigns.evaluation.figure import draw_history, heading, why_none
from rig.campaigns.evaluation.recorded import points_of
from rig.drawing.nonlinear_mode import draw_properties
from rig.drawing.page import grid
from rig.drawing.style import say_why_empty
from rig.recording.reader import Recording

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["draw"]


def draw(page: "Figure", recording: Recording) -> None:
    """Draw frequency and damping over the amplitude, and the history of the control loop."""
    axes = grid(page, 2, 2)
    try:
        mode: NonlinearMode | None = nonlinear_mode(recorded_backbone(recording))
    except IdentificationError:
        mode = None
    if mode is not None:
        draw_properties(axes[0, 0], axes[0, 1], mode)
    else:
        for axis in axes[0]:
            say_why_empty(axis, why_none(points_of(recording)))
    draw_history(axes[1, 0], axes[1, 1], recording)
    heading(page, recording)

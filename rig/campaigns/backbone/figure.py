"""Figure of a backbone: modal properties over the amplitude, and the history of the control loop."""

from collections.abc import Sequence

from identification import IdentificationError, nonlinear_mode
from rig.campaigns.backbone.points import recorded_backbone
from rig.campaigns.evaluation.drift import without_repetition
from rig.campaigns.evaluation.figure import draw_failure, draw_history, heading, notes_of
from rig.campaigns.evaluation.recorded import points_of
from rig.drawing.areas import is_narrow
from rig.drawing.axes import widen
from rig.drawing.nonlinear_mode import draw_properties
from rig.drawing.page import grid
from rig.drawing.style import Figure
from rig.recording.reader import Recording

PANELS = ("backbone", "history")
"""Parts of the figure, each a row of two panels."""
LEAST_SPAN = 1e-3
"""Smallest part of the frequency that its axis spans: less would show its scatter as if it were a change."""


def draw(page: Figure, recording: Recording, panels: Sequence[str] = ()) -> None:
    """Draw frequency and damping over the amplitude, and the history of the control loop; if no point counts, only that.

    ``panels``: which of `PANELS`; by default both, and on a page as narrow as a paper's column the backbone alone.
    """
    try:
        mode = nonlinear_mode(recorded_backbone(recording))
    except IdentificationError:
        draw_failure(page, recording)
        return
    shown = [name for name in PANELS if name in (panels or (PANELS[:1] if is_narrow(page) else PANELS))]
    axes = grid(page, len(shown), 2)
    for name, row in zip(shown, axes, strict=True):
        if name == "history":
            draw_history(row[0], row[1], recording)
        else:
            accepted = [point for point in without_repetition(points_of(recording)) if point.accepted]
            draw_properties(row[0], row[1], mode, notes_of(accepted))
            widen(row[0], LEAST_SPAN)
    heading(page, recording)

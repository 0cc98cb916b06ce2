"""Figure of a reference study: our figures beside published ones, and what the model does."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.drawing.page import grid, legend_below, page_for
from rig.drawing.style import MAIN, REJECTED, SECOND, THIRD, title
from studies.reproduce.references.result import StudyResult

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_STYLES: dict[str, dict[str, Any]] = {
    "measured": {"color": REJECTED, "lw": 3.0, "alpha": 0.6},
    "points": {"color": REJECTED, "marker": "o", "ms": 3.5, "lw": 0.0},
    "model": {"color": MAIN, "lw": 1.0},
    "residual": {"color": SECOND, "lw": 0.8},
    "backbone": {"color": MAIN, "marker": "s", "ms": 4.0, "lw": 1.0},
}


def draw_reference(result: StudyResult, path: Path) -> None:
    """Write the figure as an image; raise `RecordingError` if it cannot be written."""
    compared = bool(result.published)
    count = len(result.panels) + compared
    wide = min(count, 2 if count <= 4 else 3)
    rows = -(-count // wide)
    with page_for(path, (5.2 * wide, 3.8 * rows + 0.6)) as page:
        title(page, result.title)
        axes = grid(page, rows, wide).ravel()
        if compared:
            _compare(axes[0], result)
        for axis, panel in zip(axes[compared:], result.panels, strict=False):
            for curve in panel.curves:
                axis.plot(curve.x, curve.y, label=curve.label, **_STYLES[curve.role])
            axis.set(xlabel=panel.x_label, ylabel=panel.y_label)
        for axis in axes[count:]:
            axis.set_axis_off()
        legend_below(page, axes[count - 1])


def _compare(axis: "Axes", result: StudyResult) -> None:
    """Draw the first column: published figures above, ours below, the chosen model filled."""
    key, heading = result.columns[0].key, result.columns[0].heading
    lines = [line for line in (*result.published, *result.lines) if np.isfinite(line.values.get(key, np.nan))]
    for row, line in enumerate(lines):
        ours = line in result.lines
        mark, colour = ("o", MAIN) if ours else ("D", THIRD)
        axis.plot(line.values[key], row, mark, color=colour, mfc=None if line.chosen or not ours else "none", ms=7)
    axis.set_yticks(range(len(lines)), [f"{line.method}{' (chosen)' if line.chosen else ''}" for line in lines])
    axis.set(xlabel=heading, ylim=(len(lines) - 0.5, -0.5))
    axis.grid(axis="y", visible=False)
    if all(line.values[key] > 0.0 for line in lines):
        axis.set_xscale("log")

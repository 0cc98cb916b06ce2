"""Areas of a page for parts of a figure that differ in kind; on a narrow page they stand below one another."""

from collections.abc import Sequence

import numpy as np

from rig.drawing.page import NARROW_IN
from rig.drawing.style import Figure, SubFigure, height_is_free, rc

_PANEL_IN = 1.65  # inches; height of a panel on a narrow page; chosen


def is_narrow(page: Figure) -> bool:
    """Return whether a page is as narrow as a paper's column."""
    return bool(page.get_figwidth() < NARROW_IN)


def broad(times: float = 3.5) -> float:
    """Return the width (points) of a line that lies behind others."""
    return float(times * rc("lines.linewidth"))


def areas(page: Figure, panels: Sequence[int], sizes: Sequence[float], *, beside: bool = False) -> list[SubFigure]:
    """Give an area (a subfigure) for each part of a figure, from top to bottom, or ``beside`` one another.

    ``sizes`` are the relative heights (or widths) of the areas. On a narrow page, areas are below one another and as tall as
    their numbers of ``panels``; where its height is free, the page becomes as tall as they need.
    """
    if is_narrow(page):
        if height_is_free():
            page.set_figheight(_PANEL_IN * sum(panels))
        sizes, beside = panels, False
    if beside:
        return list(page.subfigures(1, len(sizes), width_ratios=sizes, squeeze=False)[0])
    return list(np.ravel(page.subfigures(len(sizes), 1, height_ratios=sizes, squeeze=False)))

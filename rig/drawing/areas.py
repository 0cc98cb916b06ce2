"""Areas of a page for parts of a figure that differ in kind; on a narrow page they stand below one another."""

from collections.abc import Mapping, Sequence
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.drawing.style import height_is_free

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["areas", "broad", "is_narrow", "legend_below"]

_NARROW_IN = 5.0
_PANEL_IN = 1.65
_LETTERS = 52  # of a legend's line on a narrow page


def is_narrow(page: "Figure") -> bool:
    """Return whether a page is as narrow as a paper's column."""
    return bool(page.get_figwidth() < _NARROW_IN)


def broad(times: float = 3.5) -> float:
    """Return the width (points) of a line that lies behind others."""
    from matplotlib import rcParams

    return float(times * rcParams["lines.linewidth"])


def legend_below(page: "Figure", handles: Mapping[str, Any]) -> None:
    """Put one legend for all panels below them: handles by label. A page whose height is free grows by it."""
    from matplotlib import rcParams
    from matplotlib.font_manager import FontProperties

    narrow = is_narrow(page)
    if narrow and height_is_free():
        line_in = 1.5 * FontProperties(size=rcParams["legend.fontsize"]).get_size_in_points() / 72.0
        page.set_figheight(page.get_figheight() + line_in * (len(handles) + 2))
    labels = ["\n".join(wrap(label, _LETTERS)) for label in handles] if narrow else list(handles)
    page.legend(list(handles.values()), labels, loc="outside lower left", ncols=1 if narrow else 3)


def areas(page: "Figure", panels: Sequence[int], sizes: Sequence[float], *, beside: bool = False) -> list[Any]:
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

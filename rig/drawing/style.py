"""Style shared by all figures: colours, fonts, grid, and resolution of traces."""

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "MAIN",
    "REJECTED",
    "SECOND",
    "STYLE",
    "TRACE_BINS",
    "engineering",
    "plain_log",
    "say_why_empty",
    "title",
    "unit_text",
]

MAIN, SECOND, REJECTED = "#1f4e79", "#c0504d", "#9a9a9a"
STYLE: dict[Any, Any] = {
    "font.size": 9,
    "axes.grid": True,
    "grid.color": "#e2e2e2",
    "grid.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "axes.formatter.useoffset": False,
    "lines.linewidth": 1.2,
    "legend.frameon": False,
    "figure.dpi": 150,
}

TRACE_BINS = 1200


def engineering(amplitude_m: np.ndarray) -> tuple[np.ndarray, str]:
    """Convert amplitudes to millimetres or micrometres, whichever reads better; also return the unit."""
    if amplitude_m.size and np.nanmax(amplitude_m) < 5e-4:
        return amplitude_m * 1e6, "µm"
    return amplitude_m * 1e3, "mm"


def say_why_empty(axis: "Axes", text: str) -> None:
    """Write into a panel why it is empty."""
    axis.text(0.5, 0.5, text, ha="center", va="center", transform=axis.transAxes, color=REJECTED)
    axis.set(xticks=[], yticks=[])


def title(page: "Figure", text: str) -> None:
    """Write a title at the top left, unless the text is empty."""
    if text:
        page.suptitle(text, fontsize=11, x=0.01, ha="left", parse_math=False)


def unit_text(unit: str) -> str:
    """Return a unit as written at an axis."""
    return {"m/s2": "m/s²", "m/s^2": "m/s²"}.get(unit, unit)


def plain_log(axis: "Axes") -> None:
    """Label a logarithmic axis of errors with plain numbers, with some intermediate ones if it spans little."""
    from matplotlib.ticker import LogLocator, StrMethodFormatter

    low, high = axis.get_ylim()
    axis.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    if high < 30.0 * low:
        axis.yaxis.set_minor_locator(LogLocator(subs=(2.0, 3.0, 5.0, 7.0)))
        axis.yaxis.set_minor_formatter(StrMethodFormatter("{x:g}"))
    else:
        axis.yaxis.set_minor_formatter("")

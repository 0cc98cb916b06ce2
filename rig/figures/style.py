"""What all figures share: colours, fonts, grid, and how finely a trace is drawn."""

from typing import Any

__all__ = ["MAIN", "REJECTED", "SECOND", "STYLE", "TRACE_BINS"]

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
    "savefig.dpi": 150,
}

TRACE_BINS = 1200

"""Limits and ticks of axes that many figures need, to be set after the data are drawn."""

from typing import Literal

import numpy as np

from rig.drawing.style import Axes

DAMPING_SPAN = 0.03
"""Smallest part of a damping ratio that its axis spans: a change below a per cent looks flat, one of 2 % fills the axis."""


def log_axis(axis: Axes, which: Literal["x", "y"] = "y", *, least_span: float = 2.0) -> None:
    """Make an axis logarithmic that spans at least a factor, with plain numbers at 1, 2, 5 where it spans few decades."""
    from matplotlib.ticker import AutoLocator, LogLocator, NullFormatter, NullLocator, StrMethodFormatter

    axis.set(**{f"{which}scale": "log"})
    low, high = getattr(axis, f"get_{which}lim")()
    if high < least_span * low:
        factor = np.sqrt(least_span * low / high)
        low, high = low / factor, high * factor
        axis.set(**{f"{which}lim": (low, high)})
    ticks = getattr(axis, f"{which}axis")
    ticks.set_minor_formatter(NullFormatter())
    if high < 6.0 * low:
        ticks.set_major_locator(AutoLocator())
        ticks.set_minor_locator(NullLocator())
    elif high < 300.0 * low:
        ticks.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    if low >= 1e-3 and high <= 1e4:
        ticks.set_major_formatter(StrMethodFormatter("{x:g}"))


def from_zero(axis: Axes, *values: np.ndarray) -> None:
    """Let an axis of amplitudes begin at zero, with room above the largest of the values."""
    largest = max((float(np.nanmax(one)) for one in values if np.isfinite(one).any()), default=0.0)
    if largest > 0.0:
        axis.set_ylim(0.0, 1.08 * largest)


def widen(axis: Axes, least: float) -> None:
    """Let the vertical axis span at least a part ``least`` of its middle value, so that scatter does not look like a trend."""
    low, high = axis.get_ylim()
    middle = 0.5 * (low + high)
    half = max(0.5 * (high - low), 0.5 * least * abs(middle))
    axis.set_ylim(middle - half, middle + half)


def ticks_at_1_2_5(axis: Axes) -> None:
    """Label a logarithmic x axis with plain numbers, at 1, 2 and 5 of each decade."""
    from matplotlib.ticker import LogLocator

    axis.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axis.xaxis.set_major_formatter("{x:g}")
    axis.xaxis.set_minor_formatter("")

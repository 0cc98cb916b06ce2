"""Figure of a continuous backbone: what was found on the way up and on the way down, their mean, and its 95 % band."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.figures.style import MAIN, REJECTED, SECOND, engineering, say_why_empty

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["draw_ways"]

Point = Mapping[str, Any]
_UP, _DOWN = SECOND, "#4f9d69"
_QUANTITIES = (("modal_frequency_hz", 1.0, "modal frequency, Hz"), ("damping_ratio", 100.0, "modal damping ratio, %"))


def draw_ways(axes: Sequence["Axes"], points: Sequence[Point]) -> None:
    """Draw modal frequency and damping over the amplitude into two axes; points are those of a recording.

    A level that was passed on one way only is drawn there, and in grey where the mean would be.
    """
    measured = [point for point in points if point.get("amplitude_m") is not None]
    if not measured:
        for axis in axes:
            say_why_empty(axis, "no level was passed")
        return
    unit = engineering(np.array([point["amplitude_m"] for point in measured]))[1]
    scale_m = 1e6 if unit == "µm" else 1e3
    for axis, (name, scale, label) in zip(axes, _QUANTITIES, strict=True):
        for number, repeat in enumerate(dict.fromkeys(point["repeat"] for point in measured)):
            some = sorted((p for p in measured if p["repeat"] == repeat), key=lambda point: point["amplitude_m"])
            _one_repeat(axis, some, name, scale, scale_m, labelled=number == 0)
        axis.set(xlabel=f"displacement amplitude, {unit}", ylabel=label, xscale="log")
    axes[1].legend(fontsize=8)


def _one_repeat(
    axis: "Axes", points: Sequence[Point], name: str, scale: float, scale_m: float, *, labelled: bool
) -> None:
    for way, colour, marker in (("up", _UP, "^"), ("down", _DOWN, "v")):
        there = [point for point in points if way in point]
        axis.plot(
            [scale_m * point["amplitude_m"] for point in there],
            [scale * point[way][name] for point in there],
            marker + ":",
            ms=3,
            lw=0.8,
            color=colour,
            label=f"way {way}" if labelled and there else None,
        )
    accepted = [point for point in points if point["accepted"]]
    x = scale_m * np.array([point["amplitude_m"] for point in accepted])
    mean, half = (np.array([point[key] for point in accepted]) * scale for key in (name, _STD[name]))
    axis.fill_between(x, mean - 1.96 * half, mean + 1.96 * half, color=MAIN, alpha=0.2, lw=0)
    axis.plot(x, mean, "o-", ms=4, color=MAIN, label="mean of both, 95 % band" if labelled else None)
    rejected = [point for point in points if not point["accepted"]]
    if rejected:
        axis.plot(
            [scale_m * point["amplitude_m"] for point in rejected],
            [scale * point[name] for point in rejected],
            "o",
            ms=5,
            mfc="none",
            color=REJECTED,
            label="not accepted" if labelled else None,
        )


_STD = {"modal_frequency_hz": "modal_frequency_std_hz", "damping_ratio": "damping_ratio_std"}

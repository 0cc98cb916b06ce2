"""Figure of a continuous backbone: what was found on the way up and on the way down, their mean, and its 95 % band."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from rig.campaigns.evaluation.figure import draw_history, heading
from rig.figures.style import MAIN, REJECTED, SECOND, engineering, say_why_empty
from rig.recording.reader import Recording

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw", "draw_differences", "draw_ways"]

Point = Mapping[str, Any]
_WAYS = (("up", SECOND, "^"), ("down", "#4f9d69", "v"))
_QUANTITIES = (
    ("modal_frequency_hz", "modal_frequency_std_hz", 1.0, "modal frequency, Hz"),
    ("damping_ratio", "damping_ratio_std", 100.0, "modal damping ratio, %"),
)


def draw(page: "Figure", recording: Recording) -> None:
    """Draw both ways, their differences from the mean, and the loop over time."""
    page.set_size_inches(9.0, 9.6)
    axes = page.subplots(3, 2)
    points = list(recording.latest.values())
    draw_ways(axes[0], points)
    draw_differences(axes[1], points)
    draw_history(axes[2, 0], axes[2, 1], recording)
    heading(page, recording)


def draw_ways(axes: Sequence["Axes"], points: Sequence[Point]) -> None:
    """Draw modal frequency and damping over the amplitude into two axes; points are those of a recording.

    A level that was passed on one way only is drawn there, and in grey where the mean would be.
    """
    for axis, (name, std, scale, label) in zip(axes, _QUANTITIES, strict=True):
        for some, scale_m, said in _repeats(axis, points, label):
            for way, colour, marker in _WAYS:
                there = [point for point in some if way in point]
                _line(
                    axis,
                    there,
                    scale_m,
                    [scale * point[way][name] for point in there],
                    f"way {way}" if said else None,
                    marker=marker,
                    ls=":",
                    color=colour,
                )
            good = [point for point in some if point["accepted"]]
            mean, half = (scale * np.array([point[key] for point in good]) for key in (name, std))
            _band(axis, good, scale_m, mean, half)
            _line(axis, good, scale_m, mean, "mean, 95 % band" if said else None, marker="o", color=MAIN)
            out = [point for point in some if not point["accepted"]]
            values = [scale * point[name] for point in out]
            _line(axis, out, scale_m, values, "not accepted" if said else None, marker="x", ls="", color=REJECTED)
    if axes[1].get_legend_handles_labels()[0]:
        axes[1].legend(fontsize=8)


def draw_differences(axes: Sequence["Axes"], points: Sequence[Point]) -> None:
    """Draw how far up and down lie from their mean, in per cent of it, with the mean's 95 % band."""
    for axis, (name, std, _, label) in zip(axes, _QUANTITIES, strict=True):
        for some, scale_m, _said in _repeats(axis, points, f"from the mean {label.split(',')[0]}, %"):
            both = [point for point in some if "up" in point and "down" in point]
            _band(axis, both, scale_m, np.zeros(len(both)), np.array([100.0 * p[std] / abs(p[name]) for p in both]))
            for way, colour, marker in _WAYS:
                values = [100.0 * (point[way][name] / point[name] - 1.0) for point in both]
                _line(axis, both, scale_m, values, None, marker=marker, ls=":", color=colour)


def _repeats(axis: "Axes", points: Sequence[Point], label: str) -> Iterator[tuple[list[Point], float, bool]]:
    """Measured points of each repeat in the order of amplitude, the scale of amplitudes, whether it is the first."""
    measured = [point for point in points if point.get("amplitude_m") is not None]
    if not measured:
        say_why_empty(axis, "no level was passed")
        return
    unit = engineering(np.array([point["amplitude_m"] for point in measured]))[1]
    axis.set(xlabel=f"displacement amplitude, {unit}", ylabel=label, xscale="log")
    for number, repeat in enumerate(dict.fromkeys(point["repeat"] for point in measured)):
        some = sorted((p for p in measured if p["repeat"] == repeat), key=lambda point: float(point["amplitude_m"]))
        yield some, 1e6 if unit == "µm" else 1e3, number == 0


def _band(axis: "Axes", points: Sequence[Point], scale_m: float, mean: Any, std: Any) -> None:
    x = [scale_m * point["amplitude_m"] for point in points]
    axis.fill_between(x, mean - 1.96 * std, mean + 1.96 * std, color=MAIN, alpha=0.2, lw=0)


def _line(axis: "Axes", points: Sequence[Point], scale_m: float, values: Any, label: str | None, **style: Any) -> None:
    if points:
        x = [scale_m * point["amplitude_m"] for point in points]
        axis.plot(x, values, ms=3.5, label=label, **{"lw": 1.0, **style})

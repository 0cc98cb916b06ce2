"""Figure of a continuous backbone: the results of the way up and of the way down, their mean, and its 95 % band."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from rig.campaigns.continuous_backbone.points import ContinuousBackboneResult
from rig.campaigns.evaluation.figure import draw_failure, draw_history, heading, notes_of, why_nothing_is_drawn
from rig.campaigns.evaluation.point import Point, vibration_of
from rig.campaigns.evaluation.recorded import points_of
from rig.campaigns.evaluation.stored_point import value_of
from rig.drawing.axes import DAMPING_SPAN, log_axis, widen
from rig.drawing.interactive.shapes import note_points
from rig.drawing.page import grid
from rig.drawing.style import MAIN, REJECTED, SECOND, THIRD, Axes, Figure, engineering, say_why_empty
from rig.recording.reader import Recording

LEAST_DETUNING = 0.002
"""Smallest detuning, relative, at which its axis ends."""

Measured = Point[ContinuousBackboneResult]


class _Quantity(NamedTuple):
    """How one modal property is drawn."""

    label: str
    scale: float
    name: str
    """Name of the field of a point, and of one way."""
    std: str
    """Name of the field with the standard error."""
    least_span: float
    """Smallest part of the value that its axis spans: less would show scatter as if it were a change."""


_QUANTITIES = (
    _Quantity("modal frequency, Hz", 1.0, "modal_frequency_hz", "modal_frequency_std_hz", 1e-3),
    _Quantity("modal damping ratio, %", 100.0, "damping_ratio", "damping_ratio_std", DAMPING_SPAN),
)
_WAYS = {"up": (SECOND, "^"), "down": (THIRD, "v")}
"""Colour and marker of each way, by the name of its field."""


def draw(page: Figure, recording: Recording) -> None:
    """Draw the results of both ways, their differences from the mean, the loop over time, and how far off resonance it was.

    The phase error of the loop is not drawn: while the level is ramped, the lag swings by more than 180 deg and says nothing of
    a point. What counts is the detuning.
    """
    points = points_of(recording, ContinuousBackboneResult)
    if not any(point.evaluated for point in points):
        draw_failure(page, recording)
        return
    axes = grid(page, 3, 2)
    draw_ways(axes[0], points)
    draw_differences(axes[1], points)
    draw_history(axes[2, 0], None, recording)
    draw_detuning(axes[2, 1], points, float(recording.configuration["plan"]["accepted_detuning"]))
    heading(page, recording)


def draw_detuning(axis: Axes, points: Sequence[Measured], accepted: float) -> None:
    """Draw how far the frequency was off resonance, at most, while a level was passed, in per cent of the frequency.

    The stored lag is that of a settled vibration at this detuning, ``tan(lag) = detuning / damping ratio``. The limit
    ``accepted`` (relative) is drawn where it is near.
    """
    for some, scale_m, _ in _repeats(axis, points, "largest detuning, %"):
        for used, style in ((True, {"marker": "o", "color": MAIN}), (False, {"marker": "x", "color": REJECTED})):
            shown = [point for point in some if point.accepted == used]
            _line(axis, shown, scale_m, [100.0 * _detuning(point) for point in shown], None, ls="", **style)
    largest = float(np.nanmax([LEAST_DETUNING, *(abs(_detuning(point)) for point in points)]))
    if largest > 0.5 * accepted:
        largest = max(largest, accepted)
        for limit in (-accepted, accepted):
            axis.axhline(100.0 * limit, color=REJECTED, lw=0.8, ls="--")
    axis.axhline(0.0, color=REJECTED, lw=0.8)
    axis.set_ylim(-115.0 * largest, 115.0 * largest)


def _detuning(point: Measured) -> float:
    """Return the largest relative detuning of a point; NaN if it has none."""
    lag, damping = value_of(point, "phase_error_deg"), value_of(point, "damping_ratio")
    return np.nan if lag is None or damping is None else float(np.tan(np.radians(lag)) * damping)


def draw_ways(axes: Sequence[Axes], points: Sequence[Measured]) -> None:
    """Draw the modal frequency and damping of a recording's points over the amplitude, into two axes.

    A level that was passed on one way only is drawn on that way, and its value is marked in grey as not accepted.
    """
    for axis, quantity in zip(axes, _QUANTITIES, strict=True):
        for some, scale_m, said in _repeats(axis, points, quantity.label):
            for way, (colour, marker) in _WAYS.items():
                there = [point for point in some if value_of(point, way) is not None]
                values, label = quantity.scale * _of_way(there, way, quantity), f"way {way}" if said else None
                _line(axis, there, scale_m, values, label, marker=marker, mfc="none", ls=":", color=colour)
            good = [point for point in some if point.accepted]
            mean, half = _values(good, quantity.name, quantity.scale), _values(good, quantity.std, quantity.scale)
            _band(axis, good, scale_m, mean, half)
            _line(axis, good, scale_m, mean, "mean, 95 % band" if said else None, marker="o", color=MAIN)
            out = [point for point in some if not point.accepted]
            values = _values(out, quantity.name, quantity.scale)
            _line(axis, out, scale_m, values, "not accepted" if said else None, marker="x", ls="", color=REJECTED)
    for axis, quantity in zip(axes, _QUANTITIES, strict=True):
        widen(axis, quantity.least_span)
    if axes[1].get_legend_handles_labels()[0]:
        axes[1].legend()


def draw_differences(axes: Sequence[Axes], points: Sequence[Measured]) -> None:
    """Draw the differences of both ways from their mean, in per cent of the mean, with the 95 % band of the mean."""
    for axis, quantity in zip(axes, _QUANTITIES, strict=True):
        for some, scale_m, _said in _repeats(axis, points, f"{quantity.label.split(',')[0]}, way minus mean, %"):
            both = [point for point in some if all(value_of(point, way) is not None for way in _WAYS)]
            mean, std = _values(both, quantity.name), _values(both, quantity.std)
            _band(axis, both, scale_m, np.zeros(len(both)), 100.0 * std / np.abs(mean))
            for way, (colour, marker) in _WAYS.items():
                values = 100.0 * (_of_way(both, way, quantity) / mean - 1.0)
                _line(axis, both, scale_m, values, None, marker=marker, mfc="none", ls=":", color=colour)
        least = 10.0 * quantity.least_span
        axis.set_ylim(min(-least, axis.get_ylim()[0]), max(least, axis.get_ylim()[1]))


def _values(points: Sequence[Measured], name: str, scale: float = 1.0) -> np.ndarray:
    """Return a modal property of every point, float[n]; NaN where the point has none."""
    return scale * np.array([value_of(point, name) for point in points], float)


def _of_way(points: Sequence[Measured], way: str, quantity: _Quantity) -> np.ndarray:
    return np.array([getattr(value_of(point, way), quantity.name) for point in points], float)


def _repeats(axis: Axes, points: Sequence[Measured], label: str) -> Iterator[tuple[list[Measured], float, bool]]:
    """Yield for each repeat: measured points by rising amplitude, the amplitude scale, and whether it is the first repeat."""
    measured = [point for point in points if point.vibration is not None]
    if not measured:
        say_why_empty(axis, why_nothing_is_drawn(points))
        return
    unit = engineering(np.array([vibration_of(point).amplitude_m for point in measured]))[1]
    axis.set(xlabel=f"displacement amplitude, {unit}", ylabel=label)
    for number, repeat in enumerate(dict.fromkeys(point.repeat for point in measured)):
        some = sorted((p for p in measured if p.repeat == repeat), key=lambda point: vibration_of(point).amplitude_m)
        yield some, 1e6 if unit == "µm" else 1e3, number == 0
    log_axis(axis, "x")


def _band(axis: Axes, points: Sequence[Measured], scale_m: float, mean: np.ndarray, std: np.ndarray) -> None:
    x = [scale_m * vibration_of(point).amplitude_m for point in points]
    axis.fill_between(x, mean - 1.96 * std, mean + 1.96 * std, color=MAIN, alpha=0.2, lw=0)


def _line(
    axis: Axes,
    points: Sequence[Measured],
    scale_m: float,
    values: Sequence[float] | np.ndarray,
    label: str | None,
    *,
    marker: str,
    color: str,
    ls: str = "-",
    mfc: str | None = None,
) -> None:
    if points:
        x = [scale_m * vibration_of(point).amplitude_m for point in points]
        (drawn,) = axis.plot(x, values, label=label, marker=marker, color=color, ls=ls, mfc=mfc)
        note_points(drawn, notes_of(points))

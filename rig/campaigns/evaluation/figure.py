"""Parts shared by the figures of several kinds of campaigns: the history of the control loop, and a heading."""

from typing import TYPE_CHECKING

import numpy as np

from rig.campaigns.evaluation.recorded import points_of, specimen_of
from rig.campaigns.evaluation.stored_point import point_from
from rig.figures.style import MAIN, SECOND, TRACE_BINS, title
from rig.recording.parts import Part
from rig.recording.reader import Recording

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["describe", "draw_history", "heading"]


def describe(recording: Recording, test: str) -> str:
    """Return specimen, kind of test, number of points and number of points not accepted, as one line."""
    points = points_of(recording)
    left_out = sum(not point.accepted for point in points)
    text = f"{specimen_of(recording)}: {test}, {len(points)} point{'' if len(points) == 1 else 's'}"
    return text + (f", {left_out} not accepted" if left_out else "")


def heading(page: "Figure", recording: Recording) -> None:
    """Write a heading that describes the recording above a page."""
    title(page, describe(recording, f"{recording.kind} test"))


def draw_history(frequency: "Axes", error: "Axes", recording: Recording) -> None:
    """Draw the loop over time: oscillator frequency with output amplitude, and phase error; mean and range of each bin."""
    rate = float(recording.configuration["bench"]["sample_rate_hz"])
    level = frequency.twinx()
    width = max(1, recording.n_rows // TRACE_BINS)
    start, largest = 0, 1.0
    for part in recording.parts:
        if part.n_rows < width:
            continue
        bins = part.n_rows // width
        seconds = (start + width * (np.arange(bins) + 0.5)) / rate
        _band(frequency, seconds, part.rows("frequency_hz"), width)
        level.plot(seconds, _binned(np.abs(part.rows("command_v")), width).mean(axis=1), color=SECOND, lw=0.9)
        degrees = np.degrees(part.rows("phase_error_rad"))
        _band(error, seconds, degrees, width, label="detector" if start == 0 else None)
        running = degrees[(part.rows("segment") >= 0) & np.isfinite(degrees)]
        largest = max(largest, float(np.quantile(np.abs(running), 0.995)) if running.size else 0.0)
        largest = max(largest, _mark_points(error, part, start, rate))
        start += part.n_rows
    frequency.set(xlabel="time, s", ylabel="oscillator frequency, Hz")
    frequency.yaxis.label.set_color(MAIN)
    level.set_ylabel("output amplitude, V", color=SECOND)
    level.grid(False)
    level.spines["right"].set_visible(True)
    error.set(xlabel="time, s", ylabel="phase error, deg", ylim=(-1.3 * largest, 1.3 * largest))
    if error.get_legend_handles_labels()[0]:
        error.legend(fontsize=8, loc="upper right")


def _mark_points(axis: "Axes", part: Part, start: int, rate: float) -> float:
    """Mark the phase error of every recorded fundamental of a part; return the largest absolute value, deg."""
    marks = [
        (0.5 * (point.rows.first_sample + point.rows.end_sample), point.lock.phase_error_deg)
        for point in map(point_from, part.points)
        if point.settled is not None and point.rows is not None and point.lock is not None
    ]
    if not marks:
        return 0.0
    seconds = [(start + middle) / rate for middle, _ in marks]
    degrees = np.array([degrees for _, degrees in marks], float)
    axis.plot(seconds, degrees, "D", ms=4, color=SECOND, label="recorded fundamental" if start == 0 else None)
    return float(np.max(np.abs(degrees)))


def _binned(values: np.ndarray, width: int) -> np.ndarray:
    """Return ``values`` in rows of ``width``, without an incomplete last row."""
    return np.asarray(values[: values.size // width * width].reshape(-1, width))


def _band(axis: "Axes", seconds: np.ndarray, values: np.ndarray, width: int, label: str | None = None) -> None:
    """Draw the mean of each bin as a line and its range as a band; plain decimation would alias the detector's ripple."""
    rows = _binned(values.astype(float), width)
    rows = np.where(np.isfinite(rows).all(axis=1, keepdims=True), rows, np.nan)  # gaps stay gaps
    axis.fill_between(seconds, rows.min(axis=1), rows.max(axis=1), color=MAIN, alpha=0.25, lw=0)
    axis.plot(seconds, rows.mean(axis=1), color=MAIN, lw=0.8, label=label)

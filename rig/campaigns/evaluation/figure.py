"""Parts shared by the figures of several kinds of campaigns: the history of the control loop, and a heading."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from rig.campaigns.evaluation.recorded import points_of, specimen_of
from rig.campaigns.evaluation.stored_point import point_from
from rig.campaigns.evaluation.stored_samples import StoredSamples
from rig.drawing.style import MAIN, SECOND, TRACE_BINS, title
from rig.recording.parts import Part
from rig.recording.reader import Recording

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["describe", "draw_history", "heading"]

AT_ONCE = 2**20  # rows that are read at a time


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
        stored = StoredSamples(part)
        seconds = (start + stored.samples(width * (np.arange(part.n_rows // width) + 0.5))) / rate
        _band(frequency, seconds, _binned(part, "frequency_hz", width))
        level.plot(seconds, _binned(part, "command_v", width).mean, color=SECOND, lw=0.9)
        _band(error, seconds, _binned(part, "phase_error_rad", width), label="detector" if start == 0 else None)
        largest = max(largest, _usual_error_deg(part), _mark_points(error, part, start, rate))
        start += int(stored.samples(np.array([part.n_rows]))[0])
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
    middles = StoredSamples(part).samples(np.array([middle for middle, _ in marks]))
    seconds = (start + middles) / rate
    degrees = np.array([degrees for _, degrees in marks], float)
    axis.plot(seconds, degrees, "D", ms=4, color=SECOND, label="recorded fundamental" if start == 0 else None)
    return float(np.max(np.abs(degrees)))


class _Bins(NamedTuple):
    """Smallest, mean and largest value of each bin, float64[n] each; NaN for a bin with a gap."""

    least: np.ndarray
    mean: np.ndarray
    most: np.ndarray


def _binned(part: Part, field: str, width: int) -> _Bins:
    """Read a field in bins of ``width`` rows, without an incomplete last one: magnitudes of complex values, angles in deg."""
    found = []
    whole, step = part.n_rows // width * width, width * max(1, AT_ONCE // width)
    for first in range(0, whole, step):
        values = _plain(field, part.rows(field, first, min(first + step, whole))).reshape(-1, width)
        values = np.where(np.isfinite(values).all(axis=1, keepdims=True), values, np.nan)  # gaps stay gaps
        found.append((values.min(axis=1), values.mean(axis=1), values.max(axis=1)))
    return _Bins(*(np.concatenate(columns) for columns in zip(*found, strict=True)))


def _plain(field: str, values: np.ndarray) -> np.ndarray:
    if np.iscomplexobj(values):
        values = np.abs(values)
    elif field.endswith("_rad"):
        values = np.degrees(values)
    return np.asarray(values.astype(float))


def _usual_error_deg(part: Part) -> float:
    """Return a phase error, deg, that is hardly ever exceeded while the plan runs; of a long part from a share of its rows."""
    found = []
    stride = part.n_rows // AT_ONCE + 1
    for first in range(0, part.n_rows, AT_ONCE):
        degrees = np.degrees(part.rows("phase_error_rad", first, first + AT_ONCE)[::stride])
        running = part.rows("segment", first, first + AT_ONCE)[::stride] >= 0
        found.append(np.abs(degrees[running & np.isfinite(degrees)]))
    errors = np.concatenate(found)
    return float(np.quantile(errors, 0.995)) if errors.size else 0.0


def _band(axis: "Axes", seconds: np.ndarray, bins: _Bins, label: str | None = None) -> None:
    """Draw the mean of each bin as a line and its range as a band; plain decimation would alias the detector's ripple."""
    axis.fill_between(seconds, bins.least, bins.most, color=MAIN, alpha=0.25, lw=0)
    axis.plot(seconds, bins.mean, color=MAIN, lw=0.8, label=label)

"""Parts shared by the figures of several kinds of campaigns: the history of the control loop, and a heading."""

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from rig.campaigns.evaluation.point import Point, point_name
from rig.campaigns.evaluation.recorded import points_of, specimen_of
from rig.campaigns.evaluation.stored_point import point_from
from rig.campaigns.evaluation.stored_samples import StoredSamples
from rig.drawing.interactive.shapes import note_points
from rig.drawing.page import columns_for, grid, text_below
from rig.drawing.style import MAIN, REJECTED, SECOND, TRACE_BINS, Axes, Figure, rc, say_why_empty, title
from rig.recording.parts import Part
from rig.recording.reader import Recording

AT_ONCE = 2**20  # rows that are read at a time
_THIN = 0.7  # of the usual width: lines over time


def describe(recording: Recording, test: str) -> str:
    """Return specimen, kind of test, number of points, and which points were not accepted, as one line."""
    points = points_of(recording)
    text = f"{specimen_of(recording)}: {test}, {len(points)} point{'' if len(points) == 1 else 's'}"
    left_out = refused(points)
    return text + (f", {left_out}" if left_out else "")


def refused(points: Sequence[Point[object]]) -> str:
    """Return how many points were not accepted, with their qualities, such as ``3 not accepted (2 lost-lock, 1 rejected)``."""
    left_out = Counter(str(point.quality) for point in points if not point.accepted)
    if not left_out:
        return ""
    names = left_out if len(left_out) == 1 else (f"{count} {name}" for name, count in left_out.items())
    return f"{left_out.total()} not accepted ({', '.join(names)})"


def notes_of(points: Iterable[Point[object]]) -> tuple[str, ...]:
    """Return of each point what a reader is told who points at it: its name, its quality, and its warnings in short."""
    return tuple(
        ", ".join(
            [
                f"{point_name(point.number)}: {point.quality}",
                *(text.partition(":")[0] for text in (point.reason, *(point.warnings or ())) if text),
            ]
        )
        for point in points
    )


def why_nothing_is_drawn(points: Sequence[Point[object]]) -> str:
    """Return why no point can be drawn: the reason of the first one that was not accepted."""
    if not points:
        return "no point was measured"
    first = next((point for point in points if not point.accepted), None)
    return "no point to draw" if first is None else f"no point was accepted; the first: {first.reason or first.quality}"


def heading(page: Figure, recording: Recording) -> None:
    """Write a heading that describes the recording above a page."""
    title(page, describe(recording, f"{recording.kind} test"))


def draw_failure(page: Figure, recording: Recording) -> None:
    """Draw what there is of a recording without an accepted point: why there is none, and the history of the loop.

    The phase error is drawn if a loop controlled the phase.
    """
    phase = any(np.isfinite(part.rows("phase_error_rad")).any() for part in recording.parts)
    axes = grid(page, 1, 2 if phase else 1)[0]
    draw_history(axes[0], axes[1] if phase else None, recording)
    heading(page, recording)
    why = f"Nothing else to draw: {why_nothing_is_drawn(points_of(recording))}"
    last = recording.parts[-1] if recording.parts else None
    if last is not None and last.end is not None and last.end.get("text") and last.end.get("reason") != "completed":
        why += f"; the run ended: {last.end['text']}"
    text_below(page, why)


def draw_history(frequency: Axes, error: Axes | None, recording: Recording) -> None:
    """Draw the loop over time: oscillator frequency with output amplitude, and phase error; mean and range of each bin.

    The ramp-down that ends a part is shaded. The phase is not controlled there, so its error is not drawn. ``error`` None: no
    phase error.
    """
    rate = float(recording.configuration["bench"]["sample_rate_hz"])
    level = frequency.twinx()
    width = max(1, recording.n_rows // TRACE_BINS)
    start, largest = 0, 1.0
    for part in recording.parts:
        if part.n_rows < width:
            continue
        stored = StoredSamples(part)
        seconds = (start + stored.samples(width * (np.arange(part.n_rows // width) + 0.5))) / rate
        running = _binned(part, "segment", width).least >= 0.0
        _band(frequency, seconds, _binned(part, "frequency_hz", width))
        level.plot(seconds, _binned(part, "command_v", width).mean, color=SECOND, lw=_THIN * rc("lines.linewidth"))
        _shade_ramp(frequency, seconds, running)
        if error is not None:
            errors = _binned(part, "phase_error_rad", width)
            _band(error, seconds, _Bins(*(np.where(running, one, np.nan) for one in errors)), label="detector")
            largest = max(largest, _usual_error_deg(part), _mark_points(error, part, start, rate))
            _shade_ramp(error, seconds, running)
        start += int(stored.samples(np.array([part.n_rows]))[0])
    frequency.set(xlabel="time, s", ylabel="oscillator frequency, Hz")
    frequency.yaxis.label.set_color(MAIN)
    level.set_ylabel("output amplitude, V", color=SECOND)
    level.grid(False)
    level.spines["right"].set_visible(True)
    if not recording.n_rows:
        say_why_empty(frequency, "nothing was recorded")
        level.set(yticks=[])
    if error is not None:
        _label_error(error, largest)


def _label_error(error: Axes, largest: float) -> None:
    error.set(xlabel="time, s", ylabel="phase error, deg", ylim=(-1.3 * largest, 1.3 * largest))
    handles, labels = error.get_legend_handles_labels()
    page = error.get_figure(root=True)
    if handles and page is not None:
        named = dict(zip(labels, handles, strict=True))
        error.legend(
            list(named.values()),
            list(named),
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0),
            ncols=columns_for(list(named), 0.75 * page.get_figwidth()),
            borderaxespad=0.2,
        )
    else:
        say_why_empty(error, "nothing was recorded")


def _shade_ramp(axis: Axes, seconds: np.ndarray, running: np.ndarray) -> None:
    if running.size and not running[-1]:
        begin = int(np.flatnonzero(running)[-1]) if running.any() else 0
        axis.axvspan(seconds[begin], seconds[-1], color=REJECTED, alpha=0.25, lw=0, label="ramp-down")


def _mark_points(axis: Axes, part: Part, start: int, rate: float) -> float:
    """Mark the phase error of every recorded fundamental of a part; return the largest absolute value, deg."""
    found = [one for one in map(point_from, part.points) if one.settled is not None and one.rows and one.lock]
    marks = [
        (0.5 * (point.rows.first_sample + point.rows.end_sample), point.lock.phase_error_deg)
        for point in found
        if point.rows is not None and point.lock is not None
    ]
    if not marks:
        return 0.0
    middles = StoredSamples(part).samples(np.array([middle for middle, _ in marks]))
    seconds = (start + middles) / rate
    degrees = np.array([degrees for _, degrees in marks], float)
    (drawn,) = axis.plot(seconds, degrees, "D", color=SECOND, label="recorded points", zorder=3)
    note_points(drawn, notes_of(found))
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
        values = part.rows(field, first, min(first + step, whole))
        values = np.abs(values) if np.iscomplexobj(values) else values
        values = np.degrees(values) if field.endswith("_rad") else values
        values = values.astype(float).reshape(-1, width)
        values = np.where(np.isfinite(values).all(axis=1, keepdims=True), values, np.nan)  # gaps stay gaps
        found.append((values.min(axis=1), values.mean(axis=1), values.max(axis=1)))
    return _Bins(*(np.concatenate(columns) for columns in zip(*found, strict=True)))


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


def _band(axis: Axes, seconds: np.ndarray, bins: _Bins, label: str | None = None) -> None:
    """Draw the mean of each bin as a line and its range as a band; plain decimation would alias the detector's ripple."""
    axis.fill_between(seconds, bins.least, bins.most, color=MAIN, alpha=0.25, lw=0)
    axis.plot(seconds, bins.mean, color=MAIN, lw=_THIN * rc("lines.linewidth"), label=label)

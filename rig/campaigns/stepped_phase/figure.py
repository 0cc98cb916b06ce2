"""Figure of a stepped-phase test: responses at constant level, drawn along their branches."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from identification import FrequencyResponse
from rig.campaigns.evaluation.figure import describe, notes_of
from rig.campaigns.evaluation.frequency_responses import passes_of, recorded_frequency_responses
from rig.campaigns.evaluation.point import Point
from rig.campaigns.evaluation.recorded import points_of
from rig.drawing.axes import from_zero
from rig.drawing.folding import folds_back
from rig.drawing.interactive.shapes import note_points
from rig.drawing.page import NARROW_IN, grid, legend_below
from rig.drawing.style import REJECTED, Axes, Figure, rc, shade, title as heading
from rig.recording.reader import Recording

_THIN = 0.7  # of the usual line width; chosen
NEAR_DEG = 5.0  # of phase resonance: the point that is marked as resonant


def draw(page: Figure, recording: Recording) -> None:
    """Draw every level of a recording along its branch."""
    draw_stepped_phase(
        page,
        recorded_frequency_responses(recording),
        title=describe(recording, "stepped phase"),
        lags_deg=asked_lags(points_of(recording)),
        notes=[notes_of(some) for _, some in passes_of(points_of(recording))],
    )


def draw_stepped_phase(
    page: Figure,
    responses: Sequence[FrequencyResponse],
    *,
    title: str = "",
    lags_deg: Sequence[float] = (),
    notes: Sequence[tuple[str, ...]] = (),
) -> None:
    """Draw displacement amplitude, lag of the displacement, and force over frequency.

    ``page`` is an empty figure, about 9 by 6.4 inches. Points are joined in the order of measurement, so the line runs back
    where the response folds over; there it is dotted (`rig.drawing.folding.folds_back`). The line is interrupted where a
    requested lag (``lags_deg``) was not measured. The point nearest to phase resonance is filled. If the force was controlled,
    its level is a dashed line. ``notes`` are told of the points of each level to who points at them.
    """
    amplitude, lag, force = _panels(page)
    micro = max(float(np.max(item.amplitude_m)) for item in responses) < 5e-4
    scale = 1e6 if micro else 1e3
    for number, item in enumerate(responses):
        colour, breaks = shade(number, len(responses)), gaps(item.phase_lag_deg, lags_deg)
        label = item.label or f"{item.level:g} {item.level_unit}"
        told = notes[number] if notes else ()
        _branch(amplitude, item, item.amplitude_m * scale, colour, breaks, told, label)
        _branch(lag, item, item.phase_lag_deg, colour, breaks, told)
        _branch(force, item, item.force_n, colour, breaks, told)
        if item.controlled == "force":
            force.axhline(item.level, color=colour, lw=_THIN * rc("lines.linewidth"), ls="--")
    if any(folds_back(item.frequency_hz, item.phase_lag_deg).any() for item in responses):
        amplitude.plot(
            [], [], "o:", mfc="white", color=REJECTED, label="folds back: unstable at this force without the loop"
        )
    if any(_resonant(item) is not None for item in responses):
        amplitude.plot([], [], "o", color=REJECTED, label="nearest to phase resonance")
    for axis, text in (
        (amplitude, f"displacement amplitude, {'µm' if micro else 'mm'}"),
        (force, "fundamental force, N"),
    ):
        axis.set(xlabel="frequency, Hz", ylabel=text)
    from_zero(amplitude, *(item.amplitude_m * scale for item in responses))
    from_zero(force, *(item.force_n for item in responses))
    lag.set(xlabel="frequency, Hz", ylabel="lag of displacement, deg")
    lag.axhline(90.0, color=REJECTED, lw=0.8, zorder=1)
    for axis in (lag, force):
        axis.set_xlim(amplitude.get_xlim())
    legend_below(page, amplitude)
    heading(page, title)


def _panels(page: Figure) -> tuple[Axes, Axes, Axes]:
    """Give a large panel beside two small ones, or three below one another on a narrow page."""
    if page.get_figwidth() < NARROW_IN:
        amplitude, lag, force = grid(page, 3, height_ratios=(1.5, 1.0, 1.0))[:, 0]
        return amplitude, lag, force
    axes = page.subplot_mosaic([["amplitude", "lag"], ["amplitude", "force"]], width_ratios=(1.5, 1.0))
    return axes["amplitude"], axes["lag"], axes["force"]


def asked_lags(points: Sequence[Point[object]]) -> list[float]:
    """Return the lags of the displacement that the plan asks for, deg, rising."""
    return sorted({(point.asked_phase_lag_deg or 0.0) + 180.0 for point in points})


def gaps(phase_lag_deg: NDArray[np.float64], lags_deg: Sequence[float]) -> NDArray[np.intp]:
    """Return int[k]: the points before which at least one requested lag is missing. Both are lags of the displacement."""
    if not len(lags_deg):
        return np.array([], dtype=np.intp)
    asked = np.sort(lags_deg)
    nearest = np.argmin(np.abs(np.subtract.outer(phase_lag_deg, asked)), axis=1)
    return np.flatnonzero(np.abs(np.diff(nearest)) > 1) + 1


def _branch(
    axis: Axes,
    item: FrequencyResponse,
    values: NDArray[np.float64],
    colour: object,
    interruptions: NDArray[np.intp],
    notes: tuple[str, ...],
    label: str | None = None,
) -> None:
    """Draw one level in the order of measurement: dotted where it folds back, with its resonant point filled."""
    folded = np.flatnonzero(folds_back(item.frequency_hz, item.phase_lag_deg)) + 1
    stable = np.setdiff1d(np.arange(1, values.size), folded)
    for line, elsewhere in (("-", folded), (":", stable)):
        breaks = np.union1d(interruptions, elsewhere).astype(np.intp)
        axis.plot(np.insert(item.frequency_hz, breaks, np.nan), np.insert(values, breaks, np.nan), line, color=colour)
    note_points(axis.plot(item.frequency_hz, values, "o", mfc="white", color=colour)[0], notes)
    if label is not None:
        axis.plot([], [], "o-", mfc="white", color=colour, label=label)
    resonant = _resonant(item)
    if resonant is not None:
        axis.plot(item.frequency_hz[resonant], values[resonant], "o", color=colour)


def _resonant(item: FrequencyResponse) -> int | None:
    nearest = int(np.argmin(np.abs(item.phase_lag_deg - 90.0)))
    return nearest if abs(item.phase_lag_deg[nearest] - 90.0) <= NEAR_DEG else None

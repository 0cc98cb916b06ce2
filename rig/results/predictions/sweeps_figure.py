"""Figure of predicted sweeps: motion, force, and their differences from the recording, over the instantaneous frequency."""

from typing import Any

import numpy as np

from identification import Predictions, SweepPrediction, Transient
from identification.models import as_recorded
from rig.drawing.areas import broad
from rig.drawing.style import MAIN, REJECTED, SECOND, Figure, length_factor

_MOST_SWEEPS, _MOST_ON_A_COLUMN, _MOST_BESIDE_OTHERS = 4, 2, 1  # largest numbers of sweeps drawn; chosen
_LINES_OF_TEXT = 14.0  # a row of panels takes the height of so many
_MOST_SHOWN = 2.0  # times the largest recorded value: an unbounded run is not shown beyond


def sweeps_shown(page: Figure, predictions: Predictions, narrow: bool, alone: bool) -> int:
    """Return how many sweeps are drawn, the first ones: as many as the page has room for."""
    from matplotlib import rcParams

    rows = max(1, int(page.get_figheight() * 72.0 / rcParams["font.size"] / _LINES_OF_TEXT))
    most = _MOST_ON_A_COLUMN if narrow else min(rows, _MOST_SWEEPS) if alone else _MOST_BESIDE_OTHERS
    return min(len(predictions.sweeps), most)


def draw_sweeps(area: Any, predictions: Predictions, shown: int, *, narrow: bool) -> None:
    """Draw one row per sweep: motion, force and, if a sweep was recorded, prediction minus recording.

    On a ``narrow`` page the panels of a sweep are below one another.
    """
    compared = any(recorded is not None for recorded in predictions.sweep_references[:shown])
    columns = 3 if compared else 2
    axes = area.subplots(shown * columns, 1) if narrow else area.subplots(shown, columns, squeeze=False)
    axes = np.asarray(axes).reshape(shown, columns)
    for index in range(shown):
        _sweep(axes[index], predictions, index)
    for axis in axes.ravel() if narrow else axes[-1]:
        axis.set_xlabel("frequency, Hz")
    count = len(predictions.sweeps)
    heading = (
        None if count == shown else f"the first{f' {shown}' if shown > 1 else ''} of {count} sweeps, for want of room"
    )
    handles: dict[str, Any] = {}
    for axis in axes.ravel():
        for handle, label in zip(*axis.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    columns = 1 if narrow else 3
    area.legend(list(handles.values()), list(handles), loc="outside upper left", ncols=columns, title=heading)


def _sweep(axes: Any, predictions: Predictions, index: int) -> None:
    sweep, recorded = predictions.sweeps[index], predictions.sweep_references[index]
    amplitude, force = np.abs(sweep.drive_m), np.abs(sweep.force)
    top = float(amplitude.max())
    if recorded is not None:
        measured, amplitude, force = as_recorded(sweep, recorded)
        top = max(float(amplitude.max()), float(measured.max()))
    scale, unit = length_factor(np.array([top]))
    if recorded is not None:
        wide: dict[str, Any] = {"color": REJECTED, "lw": broad(), "alpha": 0.5}
        axes[0].plot(recorded.frequency_hz, scale * measured, label="recorded", **wide)
        axes[1].plot(recorded.frequency_hz, np.abs(recorded.force), **wide)
        _differences(axes[2], sweep, recorded)
    elif len(axes) > 2:
        axes[2].set_axis_off()
        axes[2].text(0.5, 0.5, "not recorded", ha="center", color=REJECTED, transform=axes[2].transAxes)
    source = "the plan" if sweep.origin.startswith("planned") else sweep.origin
    axes[0].plot(sweep.frequency_hz, scale * amplitude, color=MAIN, label=f"predicted from {source}")
    axes[1].plot(sweep.frequency_hz, force, color=MAIN)
    if np.isfinite(sweep.largest_identified):
        limit = scale * top / sweep.range_use
        axes[0].axhline(limit, color=SECOND, lw=0.9, ls="--", label="largest amplitude identified")
    if sweep.unbounded_at_s is not None:
        axes[0].axvline(sweep.frequency_hz[-1], color=SECOND, lw=0.9, ls=":", label="unbounded from here on")
        top = top if recorded is None else min(top, _MOST_SHOWN * float(measured.max()))
    largest = float(force.max())
    if recorded is not None:
        measured_n = float(np.abs(recorded.force).max())
        largest = max(min(largest, _MOST_SHOWN * measured_n), measured_n)
    axes[0].set_ylim(0.0, 1.08 * scale * top)
    axes[1].set_ylim(0.0, 1.08 * largest)
    axes[0].set(ylabel=f"displacement, {unit}")
    axes[1].set(ylabel="force, N")
    axes[0].set_title(_heading(predictions, index))


def _differences(axis: Any, sweep: SweepPrediction, recorded: Transient) -> None:
    measured, amplitude, force = as_recorded(sweep, recorded)
    measured_n = np.abs(recorded.force)
    for predicted, known, colour, line, label in (
        (amplitude, measured, MAIN, "-", "difference of displacement, % of peak"),
        (force, measured_n, SECOND, "--", "difference of force, % of peak"),
    ):
        there = np.interp(recorded.time_s, sweep.time_s, predicted, left=np.nan, right=np.nan)
        axis.plot(recorded.frequency_hz, 100.0 * (there - known) / known.max(), ls=line, color=colour, label=label)
    axis.axhline(0.0, color=REJECTED, lw=0.8)
    axis.set(ylabel="difference, %")
    shown = np.abs(axis.get_ylim()).max()
    if shown > 100.0 * _MOST_SHOWN:
        axis.set_ylim(-100.0 * _MOST_SHOWN, 100.0 * _MOST_SHOWN)


def _heading(predictions: Predictions, index: int) -> str:
    sweep, error = predictions.sweeps[index], predictions.sweep_errors[index]
    name = sweep.origin.removeprefix("planned ") if error is None else error.name
    if sweep.unbounded_at_s is not None:
        return f"{name}: unbounded after {sweep.unbounded_at_s:.2f} s"
    if error is not None:
        return f"{error.name}: peak {100 * error.peak_error:+.2f} %, range use {error.range_use:.2f}"
    return f"{name}, range use {sweep.range_use:.2f}"

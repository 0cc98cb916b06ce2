"""Figure of predicted sweeps: motion and force over the instantaneous frequency, with the recording if there is one."""

from typing import Any

import numpy as np

from identification import Predictions
from identification.prediction.sweep_prediction import as_recorded
from rig.drawing.style import MAIN, REJECTED, SECOND, engineering

__all__ = ["draw_sweeps"]

_MOST_SWEEPS = 4
_MOST_SHOWN = 2.0  # times the largest recorded value: an unbounded run is not shown beyond


def draw_sweeps(area: Any, predictions: Predictions) -> None:
    """Draw one row per sweep with motion and force; at most four sweeps are drawn."""
    count = len(predictions.sweeps)
    shown = min(count, _MOST_SWEEPS)
    axes = area.subplots(shown, 2, squeeze=False)
    for index in range(shown):
        _sweep(axes[index], predictions, index)
    for axis in axes[-1]:
        axis.set_xlabel("frequency, Hz")
    heading = None if count == shown else f"the first {shown} of {count} sweeps"
    entries = axes[0, 0].get_legend_handles_labels()
    area.legend(*entries, loc="outside upper left", fontsize=7, ncols=3, title=heading, title_fontsize=7)


def _sweep(axes: Any, predictions: Predictions, index: int) -> None:
    """Draw amplitudes over the instantaneous frequency, smoothed like the recording if there is one."""
    sweep, recorded = predictions.sweeps[index], predictions.sweep_references[index]
    amplitude, force = np.abs(sweep.drive_m), np.abs(sweep.force)
    top = float(amplitude.max())
    if recorded is not None:
        measured, amplitude, force = as_recorded(sweep, recorded)
        top = max(float(amplitude.max()), float(measured.max()))
    unit = engineering(np.array([top]))[1]
    scale = {"mm": 1e3, "µm": 1e6}[unit]
    if recorded is not None:
        axes[0].plot(recorded.frequency_hz, scale * measured, color=REJECTED, lw=2.4, label="recorded")
        axes[1].plot(recorded.frequency_hz, np.abs(recorded.force), color=REJECTED, lw=2.4)
    axes[0].plot(sweep.frequency_hz, scale * amplitude, color=MAIN, lw=1.0, label=_origin(sweep.origin))
    axes[1].plot(sweep.frequency_hz, force, color=MAIN, lw=1.0)
    if np.isfinite(sweep.largest_identified):
        limit = scale * top / sweep.range_use
        axes[0].axhline(limit, color=SECOND, lw=0.7, ls="--", label="identified up to")
    if sweep.unbounded_at_s is not None:
        axes[0].axvline(sweep.frequency_hz[-1], color=SECOND, lw=0.7, ls=":", label="unbounded from here on")
        top = top if recorded is None else min(top, _MOST_SHOWN * float(measured.max()))
    largest = float(force.max())
    if recorded is not None:
        measured_n = float(np.abs(recorded.force).max())
        largest = max(min(largest, _MOST_SHOWN * measured_n), measured_n)
    axes[0].set_ylim(0.0, 1.08 * scale * top)
    axes[1].set_ylim(0.0, 1.08 * largest)
    axes[0].set(ylabel=f"displacement, {unit}")
    axes[1].set(ylabel="force, N")
    axes[0].set_title(_heading(predictions, index), fontsize=8, loc="left")


def _origin(origin: str) -> str:
    return "predicted from the plan" if origin.startswith("planned") else f"predicted from {origin}"


def _heading(predictions: Predictions, index: int) -> str:
    """Return the name of a sweep with its error, or with the part of the identified range that it uses."""
    sweep, error = predictions.sweeps[index], predictions.sweep_errors[index]
    name = sweep.origin.removeprefix("planned ") if error is None else error.name
    if sweep.unbounded_at_s is not None:
        return f"{name}: unbounded after {sweep.unbounded_at_s:.2f} s"
    if error is not None:
        return f"{error.name}: peak {100 * error.peak_error:+.2f} %, range use {error.range_use:.2f}"
    return f"{name}, range use {sweep.range_use:.2f}"

"""Figures of predictions beside what they are compared with: frequency responses and sweeps."""

from typing import TYPE_CHECKING, Any

import numpy as np

from identification import Predictions, SteadyPrediction, SweepPrediction
from identification.channels import MOTION_ORDER, find_role
from rig.figures.style import MAIN, REJECTED, SECOND, engineering, title

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw_predictions"]

_MOST_SWEEPS = 4
_FLAGGED = 1.0


def draw_predictions(page: "Figure", predictions: Predictions) -> None:
    """Frequency responses on the left, sweeps on the right, whatever there is."""
    kinds = [kind for kind in ("steady", "sweeps") if getattr(predictions, kind)]
    areas = np.atleast_1d(np.asarray(page.subfigures(1, len(kinds)), dtype=object))
    for kind, area in zip(kinds, areas, strict=True):
        _steady_on(area, predictions) if kind == "steady" else _sweeps_on(area, predictions)
    count = f"{len(predictions.steady)} frequency responses, {len(predictions.sweeps)} sweeps"
    title(page, f"{predictions.specimen or 'specimen'}: predictions, {count}")


def _steady_on(area: Any, predictions: Predictions) -> None:
    size, phase = area.subplots(2, 1, sharex=True, height_ratios=(1.6, 1.0))
    everything = np.concatenate([response.amplitude_m() for response in predictions.steady])
    unit = engineering(everything)[1]
    scale = {"mm": 1e3, "µm": 1e6}[unit]
    count = len(predictions.steady)
    for index, response in enumerate(predictions.steady):
        colour = _shade(index, count)
        measured = predictions.steady_references[index]
        label = response.name if measured is None else measured.label or response.name
        _branches(size, response, scale * response.amplitude_m(), colour, label)
        _branches(phase, response, response.phase_lag_deg(), colour, None)
        for fold in range(response.fold_frequency_hz.size):
            size.plot(
                response.fold_frequency_hz[fold], scale * response.fold_amplitude_m[fold], "x", color=colour, ms=5
            )
        if measured is not None:
            size.plot(measured.frequency_hz, scale * measured.amplitude_m, ".", ms=4, color=colour, alpha=0.6)
            phase.plot(measured.frequency_hz, measured.phase_lag_deg % 360.0, ".", ms=4, color=colour, alpha=0.6)
    size.plot([], [], color=REJECTED, label="predicted, stable")
    size.plot([], [], ":", color=REJECTED, label="predicted, unstable")
    if any(response.range_use.max() > _FLAGGED for response in predictions.steady):
        size.plot([], [], color=REJECTED, lw=3.5, alpha=0.35, label="beyond the identified range")
    if any(reference is not None for reference in predictions.steady_references):
        size.plot([], [], ".", color=REJECTED, label="reference")
    size.set(ylabel=f"displacement amplitude of the drive point, {unit}")
    size.legend(fontsize=7)
    phase.set(xlabel="frequency, Hz", ylabel="phase lag of displacement, deg")
    phase.axhline(90.0, color=REJECTED, lw=0.8)


def _branches(axis: "Axes", response: SteadyPrediction, values: np.ndarray, colour: Any, label: str | None) -> None:
    """Every branch on its own; unstable parts dotted, parts beyond the identified range shaded."""
    for branch in np.unique(response.branch):
        on = response.branch == branch
        for which, line in ((response.stable[on], "-"), (~response.stable[on], ":")):
            shown = np.where(_with_neighbours(which), values[on], np.nan)
            axis.plot(
                response.frequency_hz[on], shown, line, color=colour, lw=1.2, label=label if line == "-" else None
            )
            label = None if line == "-" else label
        beyond = np.where(response.range_use[on] > _FLAGGED, values[on], np.nan)
        axis.plot(response.frequency_hz[on], beyond, color=colour, lw=3.5, alpha=0.35)


def _with_neighbours(which: np.ndarray) -> np.ndarray:
    """True where it or the point after it is: lines meet where stability changes."""
    return np.asarray(which | np.concatenate([which[1:], [False]]))


def _sweeps_on(area: Any, predictions: Predictions) -> None:
    shown = predictions.sweeps[:_MOST_SWEEPS]
    axes = area.subplots(len(shown), 2, squeeze=False)
    for row, sweep in enumerate(shown):
        _sweep(axes[row], sweep, predictions, row)
    for axis in axes[-1]:
        axis.set_xlabel("frequency, Hz")
    axes[0, 0].legend(fontsize=7)


def _sweep(axes: Any, sweep: SweepPrediction, predictions: Predictions, index: int) -> None:
    """Amplitudes of motion and force over the momentary frequency."""
    recorded, error = predictions.sweep_references[index], predictions.sweep_errors[index]
    amplitude = np.abs(sweep.drive_m)
    unit = engineering(amplitude)[1]
    scale = {"mm": 1e3, "µm": 1e6}[unit]
    if recorded is not None:
        drive = find_role(recorded.channels, "drive")
        order = MOTION_ORDER[recorded.channels[drive].motion]
        measured = np.abs(recorded.fundamentals[drive]) / (2.0 * np.pi * recorded.frequency_hz) ** order
        axes[0].plot(recorded.frequency_hz, scale * measured, color=REJECTED, lw=2.2, label="recorded")
        axes[1].plot(recorded.frequency_hz, np.abs(recorded.force), color=REJECTED, lw=2.2)
    axes[0].plot(sweep.frequency_hz, scale * amplitude, color=MAIN, lw=1.0, label=f"predicted from {sweep.origin}")
    axes[1].plot(sweep.frequency_hz, np.abs(sweep.force), color=MAIN, lw=1.0)
    axes[0].axhline(
        scale * sweep.largest_identified * amplitude.max() / np.abs(sweep.modal_amplitude).max(),
        color=SECOND,
        lw=0.7,
        ls="--",
        label="identified up to",
    )
    axes[0].set_ylim(
        bottom=0.0, top=1.08 * scale * max(amplitude.max(), measured.max() if recorded is not None else 0.0)
    )
    axes[0].set(ylabel=f"displacement, {unit}")
    axes[1].set(ylabel="force, N")
    axes[1].set_ylim(bottom=0.0)
    if error is not None:
        axes[0].set_title(f"{error.name}: peak {100 * error.peak_error:+.2f} %", fontsize=8, loc="left")


def _shade(index: int, count: int) -> Any:
    from matplotlib import colormaps

    return colormaps["viridis"](0.85 * index / max(1, count - 1))

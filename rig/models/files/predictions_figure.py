"""Figures of predictions with their references: frequency responses and sweeps."""

from typing import TYPE_CHECKING, Any

import numpy as np

from identification import Predictions, ResponseBand, SteadyPrediction
from rig.drawing.style import REJECTED, engineering, title
from rig.models.files.predicted_runs_figure import draw_runs
from rig.models.files.predicted_sweeps_figure import draw_sweeps

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw_predictions"]

_BEYOND = 1.0
_WIDTHS = {"steady": 1.2, "sweeps": 1.2, "runs": 0.7}
_MOST_NAMED = 12
_NEAR = 1.3
_MARGIN = 0.15


def draw_predictions(page: "Figure", predictions: Predictions) -> None:
    """Draw the predictions that exist, from left to right: frequency responses, sweeps, multisines."""
    panels = {"steady": _steady_on, "sweeps": draw_sweeps, "runs": draw_runs}
    kinds = [kind for kind in panels if getattr(predictions, kind)]
    areas = np.atleast_1d(
        np.asarray(page.subfigures(1, len(kinds), width_ratios=[_WIDTHS[kind] for kind in kinds]), dtype=object)
    )
    for kind, area in zip(kinds, areas, strict=True):
        panels[kind](area, predictions)
    steady, sweeps, runs = len(predictions.steady), len(predictions.sweeps), len(predictions.runs)
    counts = [
        f"{n} {name}{'s' if n > 1 else ''}"
        for n, name in ((steady, "frequency response"), (sweeps, "sweep"), (runs, "multisine"))
        if n
    ]
    title(page, f"{predictions.specimen or 'specimen'}: predicted, {', '.join(counts)}")


def _steady_on(area: Any, predictions: Predictions) -> None:
    """Draw amplitude and phase over frequency, with the names of the curves above both."""
    size, phase = area.subplots(2, 1, sharex=True, height_ratios=(1.6, 1.0))
    top = max(response.amplitude_m().max() for response in predictions.steady)
    unit = engineering(np.array([top]))[1]
    scale = {"mm": 1e3, "µm": 1e6}[unit]
    count = len(predictions.steady)
    for index, response in enumerate(predictions.steady):
        colour = _shade(index, count)
        measured, band = predictions.steady_references[index], predictions.steady_bands[index]
        _branches(size, response, scale * response.amplitude_m(), colour, _name(predictions, index))
        _branches(phase, response, response.phase_lag_deg(), colour, None)
        size.plot(response.fold_frequency_hz, scale * response.fold_amplitude_m, "x", color=colour, ms=5)
        if band is not None:
            _uncertainty(size, phase, band, scale, colour)
        if measured is not None:
            size.plot(measured.frequency_hz, scale * measured.amplitude_m, ".", ms=4, color=colour, alpha=0.6)
            phase.plot(measured.frequency_hz, measured.phase_lag_deg % 360.0, ".", ms=4, color=colour, alpha=0.6)
    _limit(size, predictions, scale, scale * top)
    _explain(size, predictions)
    size.set(ylabel=f"displacement amplitude of the drive point, {unit}")
    size.set_ylim(bottom=0.0)
    _show_references(size, predictions)
    area.legend(loc="outside upper left", fontsize=7, ncols=3)
    phase.set(xlabel="frequency, Hz", ylabel="phase lag of displacement, deg")
    phase.axhline(90.0, color=REJECTED, lw=0.8)


def _name(predictions: Predictions, index: int) -> str | None:
    """Return the name of a curve with its error. Of many curves only the first and the last are named."""
    count = len(predictions.steady)
    if count > _MOST_NAMED and 0 < index < count - 1:
        return None
    measured, error = predictions.steady_references[index], predictions.steady_errors[index]
    name = (measured.label if measured else "") or predictions.steady[index].name
    if error is None:
        return name
    return f"{name}: peak {100 * error.peak_error:+.2f} %" if np.isfinite(error.peak_error) else f"{name}: no peak"


def _uncertainty(size: "Axes", phase: "Axes", band: ResponseBand, scale: float, colour: Any) -> None:
    """Draw the 95 % band as an area: between the limits of amplitude, and between the limits of frequency."""
    middle_hz = band.frequency_hz.mean(axis=0)
    size.fill(
        np.concatenate([middle_hz, middle_hz[::-1]]),
        scale * np.concatenate([band.amplitude_m[0], band.amplitude_m[1][::-1]]),
        color=colour,
        alpha=0.25,
        lw=0,
    )
    phase.fill_betweenx(band.phase_lag_deg, *band.frequency_hz, color=colour, alpha=0.25, lw=0)


def _limit(size: "Axes", predictions: Predictions, scale: float, top: float) -> None:
    """Draw the drive point's largest identified amplitude if the curves come near it."""
    highest = max(predictions.steady, key=lambda response: float(response.range_use.max()))
    where = int(np.argmax(highest.range_use))
    limit = scale * float(highest.amplitude_m()[where] / highest.range_use[where])
    if limit < _NEAR * top and np.isfinite(highest.modal_amplitude).all():  # models with states have no modal amplitude
        size.axhline(limit, color=REJECTED, lw=0.8, ls="--", label="identified up to")


def _show_references(size: "Axes", predictions: Predictions) -> None:
    """If every response has a reference, limit the frequency axis to the range of the references and a small margin."""
    found = [reference.frequency_hz for reference in predictions.steady_references if reference is not None]
    if len(found) == len(predictions.steady):
        every = np.concatenate(found)
        margin = _MARGIN * np.ptp(every)
        size.set_xlim(every.min() - margin, every.max() + margin)


def _explain(size: "Axes", predictions: Predictions) -> None:
    """Add legend entries that explain lines and marks."""
    size.plot([], [], color=REJECTED, label="predicted, stable")
    if not all(response.stable.all() for response in predictions.steady):
        size.plot([], [], ":", color=REJECTED, label="predicted, unstable")
    if any(response.range_use.max() > _BEYOND for response in predictions.steady):
        size.plot([], [], color=REJECTED, lw=3.5, alpha=0.35, label="beyond the identified range")
    if any(band is not None for band in predictions.steady_bands):
        size.fill([], [], color=REJECTED, alpha=0.25, lw=0, label="95 % by the model's errors")
    if any(reference is not None for reference in predictions.steady_references):
        size.plot([], [], ".", color=REJECTED, label="reference")


def _branches(axis: "Axes", response: SteadyPrediction, values: np.ndarray, colour: Any, label: str | None) -> None:
    """Draw every branch separately; unstable parts are dotted, parts beyond the identified range are shaded."""
    for branch in np.unique(response.branch):
        on = response.branch == branch
        for which, line in ((response.stable[on], "-"), (~response.stable[on], ":")):
            shown = np.where(_with_neighbours(which), values[on], np.nan)
            axis.plot(
                response.frequency_hz[on], shown, line, color=colour, lw=1.2, label=label if line == "-" else None
            )
            label = None if line == "-" else label
        beyond = np.where(response.range_use[on] > _BEYOND, values[on], np.nan)
        axis.plot(response.frequency_hz[on], beyond, color=colour, lw=3.5, alpha=0.35)


def _with_neighbours(which: np.ndarray) -> np.ndarray:
    """True where a point or the one after it is selected, so that lines meet where stability changes."""
    return np.asarray(which | np.concatenate([which[1:], [False]]))


def _shade(index: int, count: int) -> Any:
    from matplotlib import colormaps

    return colormaps["viridis"](0.85 * index / max(1, count - 1))

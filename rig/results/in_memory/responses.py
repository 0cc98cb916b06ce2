"""Figures of single frequency responses: measured, cut from a force surface, predicted."""

from typing import TYPE_CHECKING

import numpy as np

from identification import (
    Comparison,
    ConstantForceCurve,
    ForceSurface,
    FrequencyResponse,
    Predictions,
    ResponseBand,
    SteadyPrediction,
    SweepPrediction,
)
from identification.common import MOTION_UNIT
from rig.drawing.style import MAIN, REJECTED, SECOND, shade, title, unit_text
from rig.results.frequency_responses.figure import draw_responses
from rig.results.in_memory.axes import branches, length_factor
from rig.results.predictions.figure import draw_predictions

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_FREQUENCY, _LAG = "frequency, Hz", "phase lag of displacement, deg"
_LAGS_DEG = (30.0, 90.0, 150.0)
"""Phase lags of the sections that are drawn, deg: resonance, and one on each side; chosen."""


def draw_response(page: "Figure", response: FrequencyResponse) -> None:
    """Draw amplitude and lag over the frequency."""
    draw_responses(page, (response,))


def draw_surface(page: "Figure", surface: ForceSurface) -> None:
    """Draw stiffness and lag of every level as fitted, and the force over the displacement at three lags."""
    size, section = page.subplots(1, 2)
    x = np.linspace(-1.0, 1.0, 81)
    factor, unit = length_factor(surface.amplitude_m)
    for index, fit in enumerate(surface.levels):
        stiffness = np.abs(np.polynomial.polynomial.polyval(x, fit.coefficients))
        named = index in (0, len(surface.levels) - 1)
        label = f"{factor * fit.amplitude_m:.3g} {unit}" if named else None
        frequency_hz = (fit.centre + x * fit.half_range) / (2.0 * np.pi)
        size.plot(frequency_hz, factor / stiffness, color=shade(index, len(surface.levels)), label=label)
    size.set(xlabel=_FREQUENCY, ylabel=f"receptance, {unit}/N")
    size.legend(title="displacement held")
    for index, lag in enumerate(_LAGS_DEG):
        found = surface.section(lag)
        if found.omega.size:
            x_m, force_n = np.exp(found.log_amplitude), np.exp(found.log_force)
            section.plot(factor * x_m, force_n, "vo^"[index] + "-", color=shade(index, 3), label=f"lag {lag:g} deg")
    section.set(xlabel=f"displacement amplitude, {unit}", ylabel="force, N")
    section.legend()
    title(page, f"{surface.specimen or 'specimen'}: force surface, {len(surface.levels)} levels")


def draw_constant_force(page: "Figure", curve: ConstantForceCurve) -> None:
    """Draw amplitude over frequency with its 95 % band, and the lag; unstable parts are dotted."""
    size, lag = page.subplots(1, 2)
    found = curve.response
    factor, unit = length_factor(found.amplitude_m)
    amplitude, half = factor * found.amplitude_m, 1.96 * factor * curve.amplitude_std_m
    size.fill_between(found.frequency_hz, amplitude - half, amplitude + half, color=MAIN, alpha=0.2, lw=0)
    branches(size, found.frequency_hz, amplitude, curve.stable, label=found.label, color=MAIN)
    branches(lag, found.frequency_hz, found.phase_lag_deg, curve.stable, label=found.label, color=MAIN)
    _label(size, lag, unit)
    title(page, f"{found.specimen or 'specimen'}: at constant force, cut from a force surface")


def draw_comparison(page: "Figure", compared: Comparison) -> None:
    """Draw reference and prediction over the frequency, and their difference."""
    size, difference = page.subplots(1, 2)
    known = compared.reference
    unit = unit_text(MOTION_UNIT[known.kind])
    size.plot(known.frequency_hz, np.abs(known.response), "o", color=SECOND, label="reference")
    size.plot(known.frequency_hz, compared.predicted_amplitude, ".-", color=MAIN, label="predicted")
    size.set(xlabel=_FREQUENCY, ylabel=f"{known.kind} amplitude, {unit}")
    size.legend()
    error = 100.0 * (compared.predicted_amplitude / np.abs(known.response) - 1.0)
    difference.plot(known.frequency_hz, error, ".-", color=MAIN)
    difference.axhline(0.0, color=REJECTED, lw=0.8)
    difference.set(xlabel=_FREQUENCY, ylabel="predicted over reference, minus one, %")
    title(page, f"{known.specimen or 'specimen'}: {compared.error.name}, {compared.error.verdict}")


def as_predictions(one: SteadyPrediction | SweepPrediction) -> Predictions:
    """Return predictions with this one alone, without a reference."""
    if isinstance(one, SweepPrediction):
        return Predictions(sweeps=(one,), sweep_references=(None,), sweep_errors=(None,))
    return Predictions(steady=(one,), steady_references=(None,), steady_errors=(None,), steady_bands=(None,))


def draw_prediction(page: "Figure", one: SteadyPrediction | SweepPrediction) -> None:
    """Draw a single prediction as a file of predictions is drawn."""
    draw_predictions(page, as_predictions(one))


def draw_band(page: "Figure", found: ResponseBand) -> None:
    """Draw the interval of the amplitude over the lag, and of the frequency over the lag."""
    size, frequency = page.subplots(1, 2)
    factor, unit = length_factor(found.amplitude_m)
    size.fill_between(found.phase_lag_deg, *(factor * found.amplitude_m), color=MAIN, alpha=0.4, lw=0)
    frequency.fill_between(found.phase_lag_deg, *found.frequency_hz, color=MAIN, alpha=0.4, lw=0)
    size.set(xlabel=_LAG, ylabel=f"displacement amplitude, {unit}")
    frequency.set(xlabel=_LAG, ylabel=_FREQUENCY)
    title(page, f"95 % of {found.draws} draws")


def _label(size: "Axes", lag: "Axes", unit: str) -> None:
    size.set(xlabel=_FREQUENCY, ylabel=f"displacement amplitude, {unit}")
    size.legend()
    lag.axhline(90.0, color=REJECTED, lw=0.8)
    lag.set(xlabel=_FREQUENCY, ylabel=_LAG)

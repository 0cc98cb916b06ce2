"""Figures of results without a file: responses and force surfaces, backbones, distortion, stabilisation, sweeps."""

import numpy as np

from identification import (
    Comparison,
    ConstantForceCurve,
    ContinuousBackbone,
    DistortionLevels,
    ForceSurface,
    FrequencyResponse,
    Predictions,
    ResponseBand,
    StabilisationDiagram,
    SteadyPrediction,
    SweepPrediction,
    Transient,
)
from identification.common import MOTION_UNIT
from rig.drawing.force_surface import fitted_stiffness
from rig.drawing.lines import draw_poles
from rig.drawing.steady_curve import draw_stability
from rig.drawing.style import MAIN, REJECTED, SECOND, THIRD, Axes, Figure, length_factor, shade, title, unit_text
from rig.results.frequency_responses.views import draw_responses
from rig.results.predictions.figure import draw_predictions
from simulators.analysis import PeriodicResponses

_FREQUENCY, _LAG = "frequency, Hz", "phase lag of displacement, deg"
_LAGS_DEG = (30.0, 90.0, 150.0)
"""Phase lags of the sections that are drawn, deg: resonance, and one on each side; chosen."""


def draw_response(page: Figure, response: FrequencyResponse) -> None:
    """Draw amplitude and lag over the frequency."""
    draw_responses(page, (response,))


def draw_surface(page: Figure, surface: ForceSurface) -> None:
    """Draw stiffness and lag of every level as fitted, and the force over the displacement at three lags."""
    size, section = page.subplots(1, 2)
    factor, unit = length_factor(surface.amplitude_m)
    for index, fit in enumerate(surface.levels):
        frequency_hz, stiffness = fitted_stiffness(fit)
        named = index in (0, len(surface.levels) - 1)
        label = f"{factor * fit.amplitude_m:.3g} {unit}" if named else None
        size.plot(frequency_hz, factor / np.abs(stiffness), color=shade(index, len(surface.levels)), label=label)
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


def draw_curve(page: Figure, curve: ConstantForceCurve) -> None:
    """Draw amplitude over frequency with its 95 % band, and the lag; unstable parts are dotted."""
    size, lag = page.subplots(1, 2)
    found = curve.response
    factor, unit = length_factor(found.amplitude_m)
    amplitude, half = factor * found.amplitude_m, 1.96 * factor * curve.amplitude_std_m
    size.fill_between(found.frequency_hz, amplitude - half, amplitude + half, color=MAIN, alpha=0.2, lw=0)
    draw_stability(size, found.frequency_hz, amplitude, curve.stable, MAIN, found.label, "unstable")
    draw_stability(lag, found.frequency_hz, found.phase_lag_deg, curve.stable, MAIN, found.label, "unstable")
    _label(size, lag, unit)
    title(page, f"{found.specimen or 'specimen'}: at constant force, cut from a force surface")


def draw_comparison(page: Figure, compared: Comparison) -> None:
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


def draw_prediction(page: Figure, one: SteadyPrediction | SweepPrediction) -> None:
    """Draw a single prediction as a file of predictions is drawn."""
    draw_predictions(page, as_predictions(one))


def draw_band(page: Figure, found: ResponseBand) -> None:
    """Draw the interval of the amplitude over the lag, and of the frequency over the lag."""
    size, frequency = page.subplots(1, 2)
    factor, unit = length_factor(found.amplitude_m)
    size.fill_between(found.phase_lag_deg, *(factor * found.amplitude_m), color=MAIN, alpha=0.4, lw=0)
    frequency.fill_between(found.phase_lag_deg, *found.frequency_hz, color=MAIN, alpha=0.4, lw=0)
    size.set(xlabel=_LAG, ylabel=f"displacement amplitude, {unit}")
    frequency.set(xlabel=_LAG, ylabel=_FREQUENCY)
    title(page, f"95 % of {found.draws} draws")


def _label(size: Axes, lag: Axes, unit: str) -> None:
    size.set(xlabel=_FREQUENCY, ylabel=f"displacement amplitude, {unit}")
    size.legend()
    lag.axhline(90.0, color=REJECTED, lw=0.8)
    lag.set(xlabel=_FREQUENCY, ylabel=_LAG)


def draw_continuous(page: Figure, found: ContinuousBackbone) -> None:
    """Draw modal frequency and damping over the amplitude: the mean of both ramps with its 95 % band, and each ramp."""
    frequency, damping = page.subplots(1, 2)
    factor, unit = length_factor(found.amplitude_m)
    x = factor * found.amplitude_m
    omega = np.sqrt(found.stiffness)  # of the ramp up and of the ramp down
    omega_std = 0.5 * found.stiffness_std / omega
    ratio, ratio_std = 0.5 * found.damping_1_s / omega, 0.5 * found.damping_std_1_s / omega
    values = ((frequency, omega, omega_std, 0.5 / np.pi), (damping, ratio, ratio_std, 100.0))
    for axis, both, std, scale in values:
        half = 1.96 * 0.5 * np.sqrt(np.sum(std**2, axis=0))
        for way, marker, colour, label in zip(both, "^v", (SECOND, THIRD), ("ramp up", "ramp down"), strict=True):
            axis.plot(x, scale * way, marker + ":", color=colour, label=label)
        mean = scale * both.mean(axis=0)
        axis.fill_between(x, mean - scale * half, mean + scale * half, color=MAIN, alpha=0.2, lw=0)
        axis.plot(x, mean, "o-", color=MAIN, label="mean, 95 % of the noise")
        axis.set(xlabel=f"displacement amplitude, {unit}", xscale="log")
    frequency.set(ylabel="modal frequency, Hz")
    damping.set(ylabel="modal damping ratio, %")
    damping.legend()
    title(page, f"{found.backbone.specimen or 'specimen'}: continuous backbone, {found.periods:.0f} periods")


def draw_periodic(page: Figure, found: PeriodicResponses) -> None:
    """Draw amplitude and lag over the frequency, in the order of the points; unstable parts are dotted."""
    size, lag = page.subplots(1, 2)
    factor, unit = length_factor(found.amplitude_m)
    stable = np.ones(found.amplitude_m.size, bool) if found.stable is None else found.stable
    draw_stability(size, found.frequency_hz, factor * found.amplitude_m, stable, MAIN, "harmonic balance", "unstable")
    displacement_lag = (180.0 + found.phase_lag_deg) % 360.0
    draw_stability(lag, found.frequency_hz, displacement_lag, stable, MAIN, "harmonic balance", "unstable")
    _label(size, lag, unit)
    title(page, f"harmonic balance, {found.frequency_hz.size} points")


_FLOOR = 1e-6  # of the largest amplitude: smaller values are rounding


def draw_distortion(page: Figure, levels: DistortionLevels) -> None:
    """Draw signal, odd and even distortion and noise of every channel over the frequency, as peak amplitudes."""
    axes = page.subplots(len(levels.channels), 1, sharex=True, squeeze=False)[:, 0]
    odd, even = ~levels.excited & ~levels.even, ~levels.excited & levels.even
    for row, (axis, channel) in enumerate(zip(axes, levels.channels, strict=True)):
        floor = _FLOOR * float(np.sqrt(levels.signal[row, levels.excited].max()))
        for power, lines, marker, colour, label in (
            (levels.signal, levels.excited, "o", MAIN, "signal, excited lines"),
            (levels.distortion, levels.excited, ".", REJECTED, "distortion, excited lines"),
            (levels.distortion, odd, "x", THIRD, "distortion, odd lines"),
            (levels.distortion, even, "+", SECOND, "distortion, even lines"),
        ):
            value = np.sqrt(np.maximum(np.nan_to_num(power[row]), 0.0))
            shown = lines & (value > floor)
            axis.semilogy(levels.frequency_hz[shown], value[shown], marker, color=colour, ms=3.5, label=label)
        noise = np.sqrt(np.maximum(levels.noise[row], 0.0))
        axis.semilogy(levels.frequency_hz, np.where(noise > floor, noise, np.nan), color=REJECTED, label="noise")
        axis.set(ylabel=f"{channel.name}, {unit_text(channel.unit)}")
    axes[-1].set(xlabel="frequency, Hz")
    page.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=5)
    title(page, f"distortion of what is driven by {levels.input}")


def draw_stabilisation(page: Figure, diagram: StabilisationDiagram) -> None:
    """Draw the poles over the order, and the singular values."""
    poles, singular = page.subplots(1, 2, width_ratios=(2.0, 1.0))
    draw_poles(poles, diagram, "frequency stable", "frequency, damping and shape stable")
    poles.set(xlabel="frequency, Hz", ylabel="model order")
    values = diagram.singular_values
    singular.semilogy(np.arange(1, values.size + 1), values / values[0], ".-", color=MAIN)
    singular.set(xlabel="number", ylabel="singular value over the first")
    page.legend(*poles.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    title(page, "stabilisation diagram")


def draw_transient(page: Figure, sweep: Transient) -> None:
    """Draw the fundamental of every channel and the frequency over time."""
    axes = page.subplots(len(sweep.channels) + 1, 1, sharex=True)
    for axis, channel, values in zip(axes, sweep.channels, np.abs(sweep.fundamentals), strict=False):
        axis.plot(sweep.time_s, values, color=MAIN)
        axis.set(ylabel=f"{channel.name}, {unit_text(channel.unit)}")
        axis.set_ylim(bottom=0.0)
    axes[-1].plot(sweep.time_s, sweep.frequency_hz, color=MAIN)
    axes[-1].set(ylabel="frequency, Hz", xlabel="time, s")
    title(page, f"fundamentals over time, averaged over {sweep.window_periods} periods")

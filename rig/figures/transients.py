"""Figures of open-loop tests: sweeps, stepped sines and multisines, from their measurements in memory.

Every function draws into a `matplotlib.figure.Figure` that it is given and writes nothing.
"""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from identification import (
    ForceDropOut,
    FrequencyResponse,
    InstrumentResponse,
    PeriodicSpectra,
    Transient,
    zero_crossings,
)
from rig.figures.style import MAIN, REJECTED, SECOND, TRACE_BINS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw_multisine", "draw_stepped_sine", "draw_sweep"]

Float = NDArray[np.float64]

_ODD = "#4f9d69"
_JUMP = 1.5  # times the amplitude of the point before
_SYMBOL = {"m/s2": "m/s²", "m/s^2": "m/s²"}


def draw_sweep(
    page: "Figure",
    sweep: Transient,
    samples: NDArray[Any],
    sample_rate_hz: float,
    *,
    drop_out: ForceDropOut | None = None,
    voltage: str = "voltage",
    response: str = "drive",
    title: str = "",
) -> None:
    """Voltage, force, response and momentary frequency over time.

    Parameters
    ----------
    page
        An empty figure, about 9 by 9 inches.
    sweep
        Fundamentals of the sweep; their envelopes are drawn over the signals.
    samples
        float[n_channels, n], the signals themselves, in the order of the channels of ``sweep``.
    sample_rate_hz
        Samples per second.
    drop_out
        What of the force's drop-out is marked; nothing if None.
    voltage, response
        Channels drawn beside the force.
    title
        Heading.
    """
    force = next(channel.name for channel in sweep.channels if channel.role == "force")
    axes = page.subplots(4, 1, sharex=True, height_ratios=(1.0, 1.5, 1.5, 1.2))
    names = {voltage: "voltage", force: "force", response: f"response ({response})"}
    longest = int(np.ceil(sample_rate_hz / sweep.frequency_hz.min()))
    for axis, (name, text) in zip(axes, names.items(), strict=False):
        row = sweep.index(name)
        _signal(axis, np.asarray(samples[row], dtype=np.float64), longest, sample_rate_hz)
        envelope = np.abs(sweep.fundamentals[row])
        axis.plot(sweep.time_s, envelope, color=SECOND, label="fundamental")
        axis.plot(sweep.time_s, -envelope, color=SECOND)
        axis.set(ylabel=f"{text}, {_unit(sweep.channels[row].unit)}")
    _momentary_frequency(axes[3], sweep, np.asarray(samples[sweep.index(force)]), sample_rate_hz)
    if drop_out is not None:
        _mark_drop_out(axes[1], axes[2], drop_out)
    for axis in axes[1:]:
        axis.legend(fontsize=8, ncols=4, loc="lower right", bbox_to_anchor=(1.0, 0.98), borderaxespad=0.0)
    axes[3].set(xlabel="time, s", xlim=(0.0, samples.shape[1] / sample_rate_hz))
    _heading(page, title)


def _signal(axis: "Axes", values: Float, period: int, rate_hz: float) -> None:
    """Range of a signal within the period around each instant: single oscillations would not be seen."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    at = np.arange(0, values.size, max(1, values.size // TRACE_BINS))
    lowest, highest = minimum_filter1d(values, period)[at], maximum_filter1d(values, period)[at]
    axis.fill_between(at / rate_hz, lowest, highest, color=MAIN, alpha=0.35, lw=0, label="signal")


def _momentary_frequency(axis: "Axes", sweep: Transient, force: NDArray[Any], rate_hz: float) -> None:
    halves = zero_crossings(force, sample_rate_hz=rate_hz)
    axis.plot(halves.time_s, halves.frequency_hz, ".", ms=2.0, color=REJECTED, label="zero crossings of the force")
    axis.plot(sweep.time_s, sweep.frequency_hz, color=MAIN, label="voltage")
    turning = np.unwrap(np.angle(sweep.force))
    own = sweep.frequency_hz + np.gradient(turning, sweep.time_s) / (2.0 * np.pi)
    axis.plot(sweep.time_s, own, color=SECOND, lw=0.9, label="fundamental of the force")
    low, high = sweep.frequency_hz.min(), sweep.frequency_hz.max()
    margin = 0.25 * (high - low)
    axis.set(ylabel="frequency, Hz", ylim=(low - margin, high + margin))


def _mark_drop_out(force: "Axes", response: "Axes", drop_out: ForceDropOut) -> None:
    """Levels off resonance, minimum, overshoot and peak, with their values."""
    force.axhline(drop_out.off_resonance_n, color=REJECTED, lw=0.8, ls="--")
    marks = (
        (drop_out.minimum_time_s, drop_out.minimum_n, drop_out.minimum_ratio, drop_out.minimum_frequency_hz, "v"),
        (
            drop_out.overshoot_time_s,
            drop_out.overshoot_n,
            drop_out.overshoot_ratio,
            drop_out.overshoot_frequency_hz,
            "^",
        ),
    )
    for seconds, newtons, ratio, frequency_hz, marker in marks:
        label = f"{100 * ratio:.3g} % of {drop_out.off_resonance_n:.3g} N at {frequency_hz:.4g} Hz"
        force.plot(seconds, newtons, marker, ms=6, color="black", label=label)
    unit = _unit(drop_out.peak_unit)
    label = f"{drop_out.peak:.4g} {unit} at {drop_out.peak_frequency_hz:.4g} Hz"
    response.plot(drop_out.peak_time_s, drop_out.peak, "o", ms=5, color="black", label=label)


def draw_stepped_sine(page: "Figure", responses: Sequence[FrequencyResponse], *, title: str = "") -> None:
    """Force, displacement amplitude, phase lag and accelerance over frequency, one line per level.

    ``page`` is an empty figure, about 9 by 6.4 inches; points are joined in the order of measurement, so that jumps and
    the direction of a sweep stay visible.
    """
    from matplotlib import colormaps

    (force, amplitude), (lag, accelerance) = page.subplots(2, 2, sharex=True)
    micro = max(float(np.max(item.amplitude_m)) for item in responses) < 5e-4
    for number, item in enumerate(responses):
        colour = colormaps["viridis"](number / max(1, len(responses) - 1) * 0.9)
        style: dict[str, Any] = {"marker": ".", "ms": 4, "color": colour}
        label = item.label or f"{item.level:g} {item.level_unit}"
        acceleration = item.amplitude_m * (2.0 * np.pi * item.frequency_hz) ** 2
        _stepped(force, item, item.force_n, label=label, **style)
        _stepped(amplitude, item, item.amplitude_m * (1e6 if micro else 1e3), **style)
        _stepped(lag, item, item.phase_lag_deg, **style)
        _stepped(accelerance, item, acceleration / item.force_n, **style)
    for axis in (force, amplitude, accelerance):
        axis.set(yscale="log")
    force.set(ylabel="force, N")
    amplitude.set(ylabel=f"displacement amplitude, {'µm' if micro else 'mm'}")
    lag.set(ylabel="phase lag of displacement, deg", xlabel="frequency, Hz")
    lag.axhline(90.0, color=REJECTED, lw=0.8)
    accelerance.set(ylabel="accelerance, 1/kg", xlabel="frequency, Hz")
    page.legend(fontsize=8, loc="outside right upper")
    _heading(page, title)


def _stepped(axis: "Axes", measured: FrequencyResponse, values: Float, **style: Any) -> None:
    """Points in the order of measurement; where the amplitude jumps from one to the next, their link is dotted."""
    frequency_hz, amplitude_m = measured.frequency_hz, measured.amplitude_m
    jumps = np.flatnonzero(np.abs(np.diff(np.log(amplitude_m))) > np.log(_JUMP)) + 1
    gaps = np.full(jumps.size, np.nan)
    axis.plot(np.insert(frequency_hz, jumps, gaps), np.insert(values, jumps, gaps), **style)
    for k in jumps:
        axis.plot(frequency_hz[k - 1 : k + 1], values[k - 1 : k + 1], ":", lw=0.8, color=style["color"])


def draw_multisine(
    page: "Figure",
    spectra: PeriodicSpectra,
    *,
    voltage: str = "voltage",
    response: str = "drive",
    title: str = "",
) -> None:
    """Amplitude spectra of voltage, force and response with their noise levels, and the frequency response with its own.

    ``page`` is an empty figure, about 9 by 6.4 inches. Odd and even lines that are not excited have marks of their own: what
    stands there above the noise is odd and even nonlinear distortion of the rig, shaker included.
    """
    force = next(channel.name for channel in spectra.channels if channel.role == "force")
    left, right = np.asarray(page.subfigures(1, 2))
    axes = left.subplots(3, 1, sharex=True)
    names = {voltage: "voltage", force: "force", response: response}
    for axis, (name, text) in zip(axes, names.items(), strict=True):
        _spectrum(axis, spectra, name, text)
    axes[0].set_title(_counts(spectra), fontsize=9, loc="left")
    handles, labels = axes[1].get_legend_handles_labels()
    left.legend(handles, labels, fontsize=8, ncols=2, loc="outside lower center")
    axes[2].set(xlabel="frequency, Hz")
    _response(right, spectra.frequency_response(response, instrument=voltage), f"{response} over {force}")
    _heading(page, title)


def _spectrum(axis: "Axes", spectra: PeriodicSpectra, name: str, text: str) -> None:
    row, excited = spectra.index(name), spectra.excited
    amplitude, noise = spectra.amplitude[row], spectra.noise_std[row]
    dots = {"ls": "", "ms": 3.0}
    axis.semilogy(spectra.frequency_hz[excited], amplitude[excited], marker="o", color=MAIN, label="excited", **dots)
    floor = 1e-6 * amplitude[excited].max()  # below lies rounding, not noise
    if not excited.all():
        for name, marker, colour, parity in (("odd", "x", _ODD, ~spectra.even), ("even", "+", SECOND, spectra.even)):
            rest = ~excited & parity & (amplitude > floor)
            label = f"{name}, not excited"
            if rest.any():
                axis.semilogy(
                    spectra.frequency_hz[rest], amplitude[rest], marker=marker, color=colour, label=label, **dots
                )
    if np.any(noise > floor):
        axis.semilogy(spectra.frequency_hz, noise, color=REJECTED, lw=0.9, label="noise")
    axis.set(ylabel=f"{text}, {_unit(spectra.channels[row].unit)}")
    lowest, highest = axis.get_ylim()
    if highest < 10.0 * lowest:  # a flat spectrum stays flat
        axis.set_ylim(lowest / 3.0, 3.0 * highest)


def _response(page: Any, measured: InstrumentResponse, text: str) -> None:
    size, phase = page.subplots(2, 1, sharex=True)
    frequency = measured.frequency_hz
    size.semilogy(frequency, np.abs(measured.value), ".-", ms=3, color=MAIN, label=text)
    if np.any(measured.noise_std > 0.0):
        size.semilogy(frequency, measured.noise_std, color=REJECTED, lw=0.9, label="noise")
    if np.isfinite(measured.total_std).any():
        label = "noise and distortion"
        size.semilogy(frequency, measured.total_std, color=SECOND, lw=0.9, label=label)
    unit = {"m/s2/N": "1/kg", "m/s^2/N": "1/kg"}.get(measured.unit, measured.unit)
    size.set(ylabel=f"frequency response, {unit}")
    page.legend(fontsize=8, ncols=3, loc="outside lower center")
    degrees = (np.degrees(np.angle(measured.value)) + 90.0) % 360.0 - 90.0  # neither 0 nor 180 deg is torn apart
    phase.plot(frequency, degrees, ".-", ms=3, color=MAIN)
    phase.set(xlabel="frequency, Hz", ylabel="phase, deg", ylim=(-100.0, 280.0), yticks=(-90, 0, 90, 180, 270))


def _counts(spectra: PeriodicSpectra) -> str:
    realisations, periods = spectra.spectra.shape[:2]
    return f"amplitude, mean of {realisations} × {periods} periods"


def _unit(unit: str) -> str:
    return _SYMBOL.get(unit, unit)


def _heading(page: "Figure", text: str) -> None:
    if text:
        page.suptitle(text, fontsize=11, x=0.01, ha="left")

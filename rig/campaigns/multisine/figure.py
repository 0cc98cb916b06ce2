"""Figure of a multisine test: amplitude spectra with their noise, and the frequency response."""

from typing import TYPE_CHECKING, Any

import numpy as np

from identification import InstrumentResponse, PeriodicSpectra
from rig.campaigns.evaluation.recorded import specimen_of
from rig.campaigns.multisine.points import recorded_spectra
from rig.drawing.style import MAIN, REJECTED, SECOND, unit_text
from rig.drawing.style import title as heading
from rig.recording.reader import Recording

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw", "draw_multisine"]

_ODD = "#4f9d69"


def draw(page: "Figure", recording: Recording) -> None:
    """Draw the highest level of a recording."""
    level, at_level = max(recorded_spectra(recording).items())
    realisations = at_level.spectra.shape[0]
    draw_multisine(
        page, at_level, title=f"{specimen_of(recording)}: multisine, {level:g} V RMS, {realisations} realisations"
    )


def draw_multisine(
    page: "Figure",
    spectra: PeriodicSpectra,
    *,
    voltage: str = "voltage",
    response: str = "drive",
    title: str = "",
) -> None:
    """Draw amplitude spectra of voltage, force and response, and the frequency response, all with their noise levels.

    ``page`` is an empty figure, about 9 by 6.4 inches. Lines that are not excited have separate marks for odd and even. What
    exceeds the noise on them is odd or even nonlinear distortion of the rig, including the shaker.
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
    heading(page, title)


def _spectrum(axis: "Axes", spectra: PeriodicSpectra, name: str, text: str) -> None:
    row, excited = spectra.index(name), spectra.excited
    amplitude, noise = spectra.amplitude[row], spectra.noise_std[row]
    dots = {"ls": "", "ms": 3.0}
    axis.semilogy(spectra.frequency_hz[excited], amplitude[excited], marker="o", color=MAIN, label="excited", **dots)
    floor = 1e-6 * amplitude[excited].max()  # anything lower is rounding, not noise
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
    axis.set(ylabel=f"{text}, {unit_text(spectra.channels[row].unit)}")
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
    degrees = (np.degrees(np.angle(measured.value)) + 90.0) % 360.0 - 90.0  # the curve has no jump at 0 or 180 deg
    phase.plot(frequency, degrees, ".-", ms=3, color=MAIN)
    phase.set(xlabel="frequency, Hz", ylabel="phase, deg", ylim=(-100.0, 280.0), yticks=(-90, 0, 90, 180, 270))


def _counts(spectra: PeriodicSpectra) -> str:
    realisations, periods = spectra.spectra.shape[:2]
    return f"amplitude, mean of {realisations} × {periods} periods"

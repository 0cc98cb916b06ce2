"""Figure of a multisine test: amplitude spectra with their noise, and the frequency response."""

import numpy as np

from identification import IdentificationError, InstrumentResponse, PeriodicSpectra, coherence
from rig.campaigns.evaluation.figure import notes_of, refused
from rig.campaigns.evaluation.recorded import accepted_points, points_of, specimen_of
from rig.campaigns.evaluation.vibrations import VOLTAGE
from rig.campaigns.multisine.points import MultisineResult, recorded_spectra
from rig.drawing.axes import log_axis
from rig.drawing.interactive.shapes import note_points
from rig.drawing.page import grid, legend_below
from rig.drawing.style import (
    MAIN,
    REJECTED,
    SECOND,
    THIRD,
    Axes,
    Figure,
    rc,
    say_why_empty,
    title as heading,
    unit_text,
)
from rig.recording.reader import Recording

_DOT = 0.7
"""Size of the dots of a spectrum, over the usual size of markers."""


def draw(page: Figure, recording: Recording) -> None:
    """Draw the highest level of a recording."""
    spectra = recorded_spectra(recording)
    level, at_level = max(spectra.items())
    realisations, periods = at_level.spectra.shape[:2]
    others = f", the highest of {len(spectra)} levels" if len(spectra) > 1 else ""
    left_out = refused(points_of(recording))
    mean = f"mean of {_counted(realisations, 'realisation')} of {_counted(periods, 'period')}"
    text = f"{specimen_of(recording)}: multisine, {level:g} V RMS{others}, {mean}"
    notes = notes_of(point for point in accepted_points(recording, MultisineResult) if point.level == level)
    draw_multisine(page, at_level, title=text + (f", {left_out}" if left_out else ""), note="; ".join(notes))


def draw_multisine(page: Figure, spectra: PeriodicSpectra, *, title: str = "", note: str = "") -> None:
    """Draw amplitude spectra of voltage, force and response, and the frequency response with its noise and coherence.

    ``page`` is an empty figure, about 9 by 6.4 inches. Lines that are not excited have separate marks for odd and even. What
    exceeds the noise on them is odd or even nonlinear distortion of the rig, including the shaker. ``note`` is told of excited
    lines to who points at them, such as the quality of the realisations.
    """
    force = next(channel.name for channel in spectra.channels if channel.role == "force")
    axes = grid(page, 3, 2, down_columns=True)
    names = {VOLTAGE.name: "voltage", force: "force", "drive": "drive"}
    for axis, (name, text) in zip(axes[:, 0], names.items(), strict=True):
        _spectrum(axis, spectra, name, text, note)
    measured = spectra.frequency_response("drive", instrument=VOLTAGE.name)
    _response(axes[0, 1], axes[1, 1], measured, f"drive over {force}")
    _coherence(axes[2, 1], spectra, "drive", force)
    legend_below(page, *axes[:, 0], axes[0, 1])
    heading(page, title)


def _counted(number: int, thing: str) -> str:
    return f"{number} {thing}{'' if number == 1 else 's'}"


def _spectrum(axis: Axes, spectra: PeriodicSpectra, name: str, text: str, note: str) -> None:
    row, excited = spectra.index(name), spectra.excited
    amplitude, noise = spectra.amplitude[row], spectra.noise_std[row]
    dots = {"ls": "", "markersize": _DOT * rc("lines.markersize")}
    (drawn,) = axis.semilogy(
        spectra.frequency_hz[excited], amplitude[excited], marker="o", color=MAIN, label="excited lines", **dots
    )
    note_points(drawn, (), f"excited lines ({note})" if note else "")
    floor = 1e-6 * amplitude[excited].max()  # anything lower is rounding, not noise
    if not excited.all():
        for name, marker, colour, parity in (("odd", "x", THIRD, ~spectra.even), ("even", "+", SECOND, spectra.even)):
            rest = ~excited & parity & (amplitude > floor)
            label = f"{name} lines, not excited"
            if rest.any():
                axis.semilogy(
                    spectra.frequency_hz[rest], amplitude[rest], marker=marker, color=colour, label=label, **dots
                )
    if np.any(noise > floor):
        axis.semilogy(spectra.frequency_hz, noise, color=REJECTED, label="noise")
    axis.set(xlabel="frequency, Hz", ylabel=f"{text}, {unit_text(spectra.channels[row].unit)}")
    log_axis(axis, least_span=10.0)  # a flat spectrum stays flat


def _response(size: Axes, phase: Axes, measured: InstrumentResponse, text: str) -> None:
    frequency = measured.frequency_hz
    size.semilogy(frequency, np.abs(measured.value), ".-", color=MAIN, label=text)
    if np.any(measured.noise_std > 0.0):
        size.semilogy(frequency, measured.noise_std, color=REJECTED, label="noise")
    if np.isfinite(measured.total_std).any():
        label = "noise and distortion"
        size.semilogy(frequency, measured.total_std, color=SECOND, label=label)
    size.set(xlabel="frequency, Hz", ylabel=f"{text}, {unit_text(measured.unit)}")
    degrees = (np.degrees(np.angle(measured.value)) + 90.0) % 360.0 - 90.0  # the curve has no jump at 0 or 180 deg
    phase.plot(frequency, degrees, ".-", color=MAIN)
    phase.set(xlabel="frequency, Hz", ylabel="phase, deg", ylim=(-100.0, 280.0), yticks=(-90, 0, 90, 180, 270))


def _coherence(axis: Axes, spectra: PeriodicSpectra, response: str, force: str) -> None:
    """Draw the coherence of response and force over all periods of all realisations: noise and distortion lower it."""
    axis.set(xlabel="frequency, Hz", ylabel=f"coherence, {response}–{force}", ylim=(0.0, 1.05))
    try:
        found = coherence(spectra, response, force)
    except IdentificationError:
        say_why_empty(axis, "coherence needs more\nthan one period")
        return
    axis.plot(spectra.frequency_hz[spectra.excited], found, ".-", color=MAIN)

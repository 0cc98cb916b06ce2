"""Figure of a stepped-sine test: force, displacement, lag and accelerance over frequency."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from identification import FrequencyResponse
from rig.campaigns.evaluation.figure import describe, notes_of
from rig.campaigns.evaluation.frequency_responses import passes_of, recorded_frequency_responses
from rig.campaigns.evaluation.recorded import points_of
from rig.drawing.axes import log_axis
from rig.drawing.interactive.shapes import note_points
from rig.drawing.page import grid, legend_below
from rig.drawing.style import REJECTED, Axes, ColorType, Figure, shade, title as heading
from rig.recording.reader import Recording
from vibrolock.arrays import Float

_JUMP = 1.5  # times the amplitude of the previous point


def draw(page: Figure, recording: Recording) -> None:
    """Draw every level of a recording."""
    responses = recorded_frequency_responses(recording)
    notes = [notes_of(some) for _, some in passes_of(points_of(recording))]
    draw_stepped_sine(page, responses, title=describe(recording, "stepped sine"), notes=notes)


def draw_stepped_sine(
    page: Figure,
    responses: Sequence[FrequencyResponse],
    *,
    title: str = "",
    notes: Sequence[tuple[str, ...]] = (),
) -> None:
    """Draw force, displacement amplitude, phase lag and accelerance over frequency, one line per level.

    ``page`` is an empty figure, about 9 by 6.4 inches. Points are joined in the order of measurement, so that jumps and the
    direction of a sweep stay visible. ``notes`` are told of the points of each level to who points at them.
    """
    (force, amplitude), (lag, accelerance) = grid(page, 2, 2)
    micro = max(float(np.max(item.amplitude_m)) for item in responses) < 5e-4
    for number, item in enumerate(responses):
        colour = shade(number, len(responses))
        label = item.label or f"{item.level:g} {item.level_unit}"
        acceleration = item.amplitude_m * (2.0 * np.pi * item.frequency_hz) ** 2
        told = notes[number] if notes else ()
        _stepped(force, item, item.force_n, colour, told, label)
        _stepped(amplitude, item, item.amplitude_m * (1e6 if micro else 1e3), colour, told)
        _stepped(lag, item, item.phase_lag_deg, colour, told)
        _stepped(accelerance, item, acceleration / item.force_n, colour, told)
    for axis in (force, amplitude, accelerance):
        log_axis(axis)
    for axis in (force, amplitude, lag, accelerance):
        axis.set(xlabel="frequency, Hz")
    force.set(ylabel="fundamental force, N")
    amplitude.set(ylabel=f"displacement amplitude, {'µm' if micro else 'mm'}")
    lag.set(ylabel="phase lag of displacement, deg")
    lag.axhline(90.0, color=REJECTED, lw=0.8, zorder=1)
    accelerance.set(ylabel="accelerance, (m/s²)/N")
    if any(line.get_linestyle() == ":" for line in amplitude.get_lines()):
        amplitude.plot([], [], ":", color=REJECTED, label="jump")
    legend_below(page, force, amplitude)
    heading(page, title)


def _stepped(
    axis: Axes,
    measured: FrequencyResponse,
    values: Float,
    colour: ColorType,
    notes: tuple[str, ...],
    label: str | None = None,
) -> None:
    """Draw points in the order of measurement. Two points between which the amplitude jumps are joined by a dotted line."""
    frequency_hz, amplitude_m = measured.frequency_hz, measured.amplitude_m
    at = jumps(amplitude_m)
    (drawn,) = axis.plot(
        np.insert(frequency_hz, at, np.nan), np.insert(values, at, np.nan), marker=".", color=colour, label=label
    )
    if notes:
        note_points(drawn, tuple(np.insert(np.array(notes, dtype=object), at, "")))
    for k in at:
        axis.plot(frequency_hz[k - 1 : k + 1], values[k - 1 : k + 1], ":", color=colour)


def jumps(amplitude_m: Float) -> NDArray[np.intp]:
    """Return int[k]: the points before which the amplitude, float[n], jumps."""
    return np.flatnonzero(np.abs(np.diff(np.log(amplitude_m))) > np.log(_JUMP)) + 1

"""Figure of a response-controlled test: quasi-linear responses by level, and curves at constant force cut from them."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from identification import ConstantForceCurve, ForceSurface, FrequencyResponse, IdentificationError
from identification.common import LevelFit
from rig.drawing.axes import ticks_at_1_2_5
from rig.drawing.interactive.shapes import note_points
from rig.drawing.page import grid
from rig.drawing.steady_curve import UNSTABLE, draw_stability
from rig.drawing.style import COLOURS, REJECTED, Axes, Figure, legend_above, length_factor, plain_log, shade, title

_CURVES = 4  # curves at constant force, at forces in geometric progression; chosen
_SECTIONS_DEG = (30.0, 90.0, 150.0)  # deg; phase lags of the sections: resonance and both flanks; chosen
_MOST_NAMED = 8  # levels up to which the legend names each; beyond, the lowest and highest only; chosen


class MeasuredSurface(Protocol):
    """A force surface with the responses of which it was made."""

    @property
    def responses(self) -> Sequence[FrequencyResponse]:
        """Responses at levels of held displacement."""

    @property
    def surface(self) -> ForceSurface:
        """The surface through them."""


def draw_force_surface(
    page: Figure,
    responses: Sequence[FrequencyResponse],
    surface: ForceSurface | None,
    *,
    text: str = "",
    notes: Sequence[tuple[str, ...]] = (),
) -> None:
    """Draw receptance and lag of every level on the left; constant-force curves and the force over displacement on the right.

    ``page`` is an empty figure, about 11 by 7 inches. Without a ``surface`` the right half is left out. ``notes`` are told of
    the points of each response to who points at them.
    """
    columns = 1 if surface is None else 2
    axes = grid(page, 2, columns)
    scale, unit = length_factor(np.concatenate([response.amplitude_m for response in responses]))
    levels = sorted({response.level for response in responses})
    for number, response in enumerate(responses):
        colour = shade(levels.index(response.level), len(levels))
        named = len(levels) <= _MOST_NAMED or response.level in (levels[0], levels[-1])
        name = f"{scale * response.level:.4g} {unit}" if named else None
        receptance = scale * response.amplitude_m / response.force_n
        for axis, values, label in ((axes[0, 0], receptance, name), (axes[1, 0], response.phase_lag_deg, None)):
            (drawn,) = axis.plot(response.frequency_hz, values, ".", color=colour, label=label)
            note_points(drawn, notes[number] if notes else ())
    fits = () if surface is None else surface.levels
    for index, fit in enumerate(fits):
        frequency_hz, stiffness = fitted_stiffness(fit)
        axes[0, 0].plot(frequency_hz, scale / np.abs(stiffness), color=shade(index, len(fits)), lw=0.9)
        axes[1, 0].plot(frequency_hz, np.degrees(np.angle(stiffness)), color=shade(index, len(fits)), lw=0.9)
    axes[0, 0].set(xlabel="frequency, Hz", ylabel=f"receptance, {unit}/N", yscale="log")
    plain_log(axes[0, 0])
    legend_above(axes[0, 0], 3, "displacement held")
    axes[1, 0].set(xlabel="frequency, Hz", ylabel="phase lag, deg")
    axes[1, 0].axhline(90.0, color=REJECTED, lw=0.8)
    if surface is not None:
        _curves(axes[0, 1], surface, scale, unit)
        _sections(axes[1, 1], surface, scale, unit)
    specimen = responses[0].specimen or "specimen"
    title(page, text or f"{specimen}: response-controlled test, {len(levels)} levels")


def draw_measured_surface(page: Figure, measured: MeasuredSurface) -> None:
    """Draw a force surface from a file."""
    draw_force_surface(page, measured.responses, measured.surface)


def fitted_stiffness(fit: LevelFit) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies, Hz, and complex dynamic stiffness, N/m, of a level as fitted by the surface."""
    x = np.linspace(-1.0, 1.0, 81)
    return (fit.centre + x * fit.half_range) / (2.0 * np.pi), np.polynomial.polynomial.polyval(x, fit.coefficients)


def _curves(axis: Axes, surface: ForceSurface, scale: float, unit: str) -> None:
    """Draw amplitude over frequency at forces within the surface; unstable parts are dotted."""
    found = _within(surface)
    for index, curve in enumerate(found):
        response, colour = curve.response, shade(index, len(found))
        amplitude = scale * response.amplitude_m
        draw_stability(axis, response.frequency_hz, amplitude, curve.stable, colour, response.label)
        axis.plot(response.frequency_hz[[0, -1]], amplitude[[0, -1]], "s", color=colour)
    resonance = surface.at_lag(90.0)
    axis.plot(resonance.frequency_hz, scale * resonance.amplitude_m, "--", color=REJECTED, lw=0.9, label="resonance")
    if any(not curve.stable.all() for curve in found):
        axis.plot([], [], ls=UNSTABLE, color=REJECTED, label="unstable")
    if found:
        axis.plot([], [], "s", color=REJECTED, label="end of the levels")
    axis.set(xlabel="frequency, Hz", ylabel=f"displacement, {unit}")
    legend_above(axis, 2, "constant force, cut from the surface")


def _within(surface: ForceSurface) -> list[ConstantForceCurve]:
    """Return curves at forces that the levels cover from lag 30 to 150 deg, or at least at resonance."""
    resonance = surface.at_lag(90.0).force_n
    try:
        lowest = max(float(surface.at_lag(lag).force_n[0]) for lag in (_SECTIONS_DEG[0], _SECTIONS_DEG[-1]))
    except IdentificationError:
        lowest = float(resonance[0])
    highest = float(resonance[-1])
    if not lowest < highest:
        lowest = float(resonance[0])
    out = []
    for force in np.geomspace(1.02 * lowest, 0.98 * highest, _CURVES):
        try:
            out.append(surface.constant_force(float(f"{force:.2g}")))
        except IdentificationError:  # rounding moved the force out of the measured range
            continue
    return out


def _sections(axis: Axes, surface: ForceSurface, scale: float, unit: str) -> None:
    for lag, marker, colour in zip(_SECTIONS_DEG, ("v", "o", "^"), COLOURS, strict=False):
        try:
            section = surface.at_lag(lag)
        except IdentificationError:
            continue
        axis.plot(scale * section.amplitude_m, section.force_n, marker + "-", color=colour, label=f"lag {lag:g} deg")
    axis.set(xlabel=f"displacement, {unit}", ylabel="force, N", xscale="log", yscale="log")
    plain_log(axis)
    ticks_at_1_2_5(axis)
    axis.legend()

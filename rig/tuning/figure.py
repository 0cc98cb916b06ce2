"""Figure of a tuning: measured and modelled plant, Bode plots of the loops, step responses."""

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from controller.tuning import Design
from rig.drawing.page import page_for
from rig.drawing.style import MAIN, REJECTED, SECOND, say_why_empty, title
from rig.errors import RecordingError

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from rig.tuning import Tuning

__all__ = ["check_figure", "draw_tuning"]

DASHES = ("-", "--", ":")


def check_figure(figure: Path, overwrite: bool) -> None:
    """Raise `RecordingError`, before anything moves, if a figure could not be written."""
    if figure.suffix.lower() not in (".png", ".pdf", ".svg"):
        raise RecordingError(f"{figure}: figures are written as .png, .pdf or .svg")
    if figure.is_dir():
        raise RecordingError(f"{figure}: is a folder, the name of a file is wanted")
    if not figure.parent.is_dir():
        raise RecordingError(f"{figure}: there is no folder {figure.parent}")
    if figure.exists() and not overwrite:
        raise RecordingError(f"{figure}: exists already; choose another name, or `overwrite`")


def draw_tuning(tuning: "Tuning", figure: Path) -> None:
    """Write the figure (png, pdf or svg, by its suffix)."""
    with page_for(figure, (11.0, 6.8)) as page:
        draw_on(page, tuning)


def draw_on(page: "Figure", tuning: "Tuning") -> None:
    """Draw plant, open loops and step responses on an empty page."""
    designs = (tuning.chosen.design, *tuning.chosen.others)
    axes = page.subplots(2, 3)
    _draw_plant(axes[0, 0], axes[1, 0], tuning)
    _draw_bode(axes[0, 1], axes[1, 1], designs)
    _draw_frequency_step(axes[0, 2], designs)
    _draw_level_step(axes[1, 2], designs)
    law = tuning.chosen.design.loop
    title(
        page,
        f"{tuning.bench.specimen.name}: tuned at {tuning.test.level_rms_v:.3g} V RMS, law {tuning.chosen.law}, low-pass "
        f"{tuning.chosen.low_pass_rad_s:.4g} rad/s, locked at {law.omega_rad_s / 2.0 / math.pi:.4g} Hz",
    )


def _draw_plant(size: "Axes", phase: "Axes", tuning: "Tuning") -> None:
    measured, plant = tuning.test.responses, tuning.plant
    fine = np.linspace(*plant.band_hz, 4000)
    s = 2j * np.pi * fine
    models = (plant.force_per_v(s), plant.acceleration_per_v(s))
    for row, (colour, model) in enumerate(zip((MAIN, SECOND), models, strict=True)):
        value, channel = measured.value[:, row, 0], measured.outputs[row]
        size.semilogy(measured.frequency_hz, np.abs(value), ".", ms=2.5, mew=0.0, alpha=0.4, color=colour)
        size.semilogy(fine, np.abs(model), color=colour, lw=0.9, label=f"{channel.name}, {channel.unit}/V")
        phase.plot(measured.frequency_hz, np.degrees(np.angle(value)), ".", ms=2.5, mew=0.0, alpha=0.4, color=colour)
        phase.plot(fine, _unbroken(np.degrees(np.angle(model))), color=colour, lw=0.9)
    for axis in (size, phase):
        axis.axvline(plant.frequency_rad_s / 2.0 / np.pi, color=REJECTED, lw=0.8, ls="--")
        axis.axvline(plant.coupled_pole_rad_s.imag / 2.0 / np.pi, color=REJECTED, lw=0.8, ls=":")
        axis.set(xlabel="frequency, Hz")
    size.set(ylabel="response to voltage (points: measured)")
    size.legend(fontsize=8)
    phase.set(ylabel="phase, deg (grey: structure, with exciter)", ylim=(-190, 190), yticks=(-180, -90, 0, 90, 180))


def _draw_bode(size: "Axes", phase: "Axes", designs: tuple[Design, ...]) -> None:
    """Draw the open loops over the frequency of a slow change, relative to the vibration frequency."""
    for line, design in zip(DASHES, designs, strict=False):
        share = design.omega_rad_s / design.loop.omega_rad_s
        loops = [(design.frequency_loop_gain, MAIN, "frequency loop")]
        if design.amplitude_margins is not None:
            loops += [(gain, SECOND, "response loop, both sidebands") for gain in design.amplitude_loop_gain]
        for number, (gain, colour, name) in enumerate(loops):
            label = name if line == "-" and number < 2 else None
            size.loglog(share, np.abs(gain), line, color=colour, lw=0.9, label=label)
            phase.semilogx(share, _unbroken(np.degrees(np.angle(gain))), line, color=colour, lw=0.9)
    size.axhline(1.0, color="k", lw=0.6)
    size.set(ylabel="open loop |L|", ylim=(1e-2, 1e2), xlabel="slow frequency / frequency")
    size.legend(fontsize=8)
    phase.set(xlabel="slow frequency / frequency", ylabel="phase of L, deg", ylim=(-190, 190))
    phase.set_yticks((-180, -90, 0, 90, 180))


def _draw_frequency_step(axis: "Axes", designs: tuple[Design, ...]) -> None:
    drawn = 0.0
    for line, design in zip(DASHES, designs, strict=False):
        if design.steps is None:
            continue
        periods = design.steps.time_s * design.loop.omega_rad_s / 2.0 / np.pi
        axis.plot(periods, np.degrees(design.steps.lag_after_frequency_rad), line, color=MAIN, label=_label(design))
        drawn = max(drawn, min(2.0 * design.settling.longest, float(periods[-1])))
    if not drawn:
        say_why_empty(axis, "unstable")
        return
    axis.set(xlabel="periods", ylabel="lag after a shift of\nhalf a bandwidth, deg", xlim=(0.0, drawn))
    axis.legend(fontsize=8, title="damping", title_fontsize=8)


def _draw_level_step(axis: "Axes", designs: tuple[Design, ...]) -> None:
    """Draw response and lag after a step to a level 30 % higher."""
    drawn = 0.0
    lag = axis.twinx()
    for line, design in zip(DASHES, designs, strict=False):
        if design.steps is None:
            continue
        periods = design.steps.time_s * design.loop.omega_rad_s / 2.0 / np.pi
        axis.plot(periods, 30.0 * design.steps.log_response_after_level, line, color=MAIN)
        lag.plot(periods, np.degrees(0.3 * design.steps.lag_after_level_rad), line, color=SECOND)
        drawn = max(drawn, min(2.0 * design.settling.longest, float(periods[-1])))
    lag.grid(False)
    if not drawn:
        say_why_empty(axis, "unstable")
        return
    axis.set(xlabel="periods", xlim=(0.0, drawn))
    axis.set_ylabel("response after a level 30 % higher, %", color=MAIN)
    lag.set_ylabel("lag after it, deg", color=SECOND)
    lag.spines["right"].set_visible(True)


def _unbroken(degrees: np.ndarray) -> np.ndarray:
    """Replace an angle by NaN where it wraps, so that no line is drawn there."""
    out = degrees.copy()
    out[1:][np.abs(np.diff(degrees)) > 180.0] = np.nan
    return out


def _label(design: Design) -> str:
    return f"{100.0 * design.loop.plant.damping_ratio:.3g} %"

"""Figure of a tuning: measured and fitted rig with coherence, open loops with margins, step responses."""

import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from controller.tuning import Design
from rig.drawing.lines import without_wraps
from rig.drawing.page import check_ending, grid, page_for
from rig.drawing.style import MAIN, REJECTED, SECOND, Axes, Figure, say_why_empty, title, unit_text
from rig.errors import RecordingError

if TYPE_CHECKING:
    from rig.tuning import Tuning

_STEP = 0.3
"""Relative change of level whose effect is drawn."""


def check_figure(figure: Path, overwrite: bool) -> None:
    """Raise `RecordingError`, before anything moves, if a figure could not be written."""
    check_ending(figure)
    if figure.is_dir():
        raise RecordingError(f"{figure}: is a folder, the name of a file is expected")
    if not figure.parent.is_dir():
        raise RecordingError(f"{figure}: there is no folder {figure.parent}")
    if figure.exists() and not overwrite:
        raise RecordingError(f"{figure}: exists already; choose another name, or `overwrite`")


def draw_tuning(tuning: "Tuning", figure: Path) -> None:
    """Write the figure (png, pdf or svg, by its suffix)."""
    with page_for(figure, (11.0, 6.8)) as page:
        draw_on(page, tuning)


def draw_on(page: Figure, tuning: "Tuning") -> None:
    """Draw, from left to right: measured rig and fit; open loops with their margins; how the closed loops settle."""
    designs = (tuning.chosen.design, *tuning.chosen.others)
    axes = grid(page, 2, 3, down_columns=True)
    _draw_plant(axes[0, 0], axes[1, 0], tuning)
    _draw_bode(axes[0, 1], axes[1, 1], designs[0])
    _draw_steps(axes[0, 2], axes[1, 2], designs)
    law = designs[0].loop
    title(
        page,
        f"{tuning.bench.specimen.name}: tuned at {tuning.test.level_rms_v:.3g} V RMS, law {tuning.chosen.law}, low-pass "
        f"{tuning.chosen.low_pass_rad_s:.4g} rad/s, locked at {law.omega_rad_s / 2.0 / math.pi:.4g} Hz; coherence "
        f"{tuning.test.coherence[0]:.5f} (force), {tuning.test.coherence[1]:.5f} (drive)",
    )


def _draw_plant(size: Axes, phase: Axes, tuning: "Tuning") -> None:
    """Draw force and drive acceleration per volt, measured and fitted, and the coherence above the phase."""
    measured, plant = tuning.test.responses, tuning.plant
    fine = np.linspace(*plant.band_hz, 4000)
    seen = phase.inset_axes((0.0, 1.12, 1.0, 0.25), sharex=phase)
    models = (plant.force_per_v(2j * np.pi * fine), plant.acceleration_per_v(2j * np.pi * fine))
    for row, (colour, model) in enumerate(zip((MAIN, SECOND), models, strict=True)):
        value, channel = measured.value[:, row, 0], measured.outputs[row]
        label = f"{channel.name}, {unit_text(f'{channel.unit}/V')}"
        for axis, values in ((size, np.abs(value)), (phase, np.degrees(np.angle(value)))):
            axis.plot(measured.frequency_hz, values, color=colour, ls="none", marker=".", mew=0.0, alpha=0.4)
        size.semilogy(fine, np.abs(model), color=colour, label=label)
        phase.plot(fine, without_wraps(np.degrees(np.angle(model))), color=colour)
        noise = measured.noise_std[:, row, 0]
        seen.plot(measured.frequency_hz, 1.0 / (1.0 + (noise / np.abs(value)) ** 2), color=colour, lw=0.9)
    size.plot([], [], color=REJECTED, label="measured", ls="none", marker=".", mew=0.0, alpha=0.4)
    size.axvline(plant.frequency_rad_s / 2.0 / np.pi, color=REJECTED, lw=0.9, ls="--", label="structure")
    size.axvline(plant.coupled_pole_rad_s.imag / 2.0 / np.pi, color=REJECTED, lw=0.9, ls=":", label="with exciter")
    size.set(ylabel="response per volt", xlabel="frequency, Hz")
    _legend_above(size, 2)
    lowest = min(0.95, seen.get_ylim()[0])
    seen.set(ylim=(lowest, 1.0 + 0.1 * (1.0 - lowest)), yticks=(lowest, 1.0), yticklabels=(f"{lowest:.2g}", "1"))
    seen.text(0.98, 0.1, "coherence", ha="right", va="bottom", transform=seen.transAxes)
    seen.tick_params(labelbottom=False)
    phase.set(xlabel="frequency, Hz", ylabel="phase, deg", ylim=(-190, 190), yticks=(-180, -90, 0, 90, 180))


def _draw_bode(size: Axes, phase: Axes, design: Design) -> None:
    """Draw the open loops over the modulation frequency, with their margins, at the damping that was measured.

    The amplitude loop has two lines, for changes above and below the vibration's frequency; the phase of the second is
    mirrored, as the margin counts either sign.
    """
    f = design.omega_rad_s / 2.0 / np.pi
    loops = [(design.frequency_loop_gain, design.frequency_margins, MAIN, "-", "frequency loop")]
    if design.amplitude_margins is not None:
        above, below = design.amplitude_loop_gain
        loops += [(above, design.amplitude_margins, SECOND, "-", "level loop")]
        loops += [(np.conj(below), design.amplitude_margins, SECOND, "--", "")]
    for gain, found, colour, line, name in loops:
        margin = f"{20.0 * math.log10(found.gain_margin):.0f} dB" if math.isfinite(found.gain_margin) else "any gain"
        label = f"{name}: {margin}, {found.phase_margin_deg:.0f} deg" if name else None
        size.loglog(f, np.abs(gain), line, color=colour, label=label)
        phase.semilogx(f, without_wraps(np.degrees(np.angle(gain))), line, color=colour)
        if name and found.crossover_rad_s > 0.0:
            for axis in (size, phase):
                axis.axvline(found.crossover_rad_s / 2.0 / np.pi, color=colour, lw=0.8, ls=":")
    size.axhline(1.0, color=REJECTED, lw=0.9)
    phase.axhline(-180.0, color=REJECTED, lw=0.9)
    shown = f[np.abs(design.frequency_loop_gain) < 1e2]
    for axis in (size, phase):
        axis.set(xlabel="modulation frequency, Hz", xlim=(shown[0], f[-1]) if shown.size else None)
    size.set(ylabel="open-loop gain", ylim=(1e-2, 1e2))
    phase.set(ylabel="loop phase, deg", ylim=(-190, 190), yticks=(-180, -90, 0, 90, 180))
    _legend_above(size, title="margins")


def _draw_steps(lag: Axes, level: Axes, designs: tuple[Design, ...]) -> None:
    """Draw phase error and level after steps, one line style per damping, up to twice the longest settling time."""
    stable = [(design, design.steps) for design in designs if design.steps is not None]
    if not stable:
        for axis in (lag, level):
            say_why_empty(axis, "the closed loop is unstable")
        return
    labels: tuple[str | None, str | None] = ("half a bandwidth shift", f"level +{100.0 * _STEP:.0f} %")
    until = 0.0
    for (design, steps), line in zip(stable, ("-", "--", (0, (1, 1.5))), strict=False):
        periods, longest = steps.time_s * design.loop.omega_rad_s / 2.0 / np.pi, design.settling.longest
        until = max(until, min(2.0 * longest, float(periods[-1])))
        lag.plot(periods, np.degrees(steps.lag_after_frequency_rad), ls=line, color=MAIN, label=labels[0])
        lag.plot(periods, np.degrees(_STEP * steps.lag_after_level_rad), ls=line, color=SECOND, label=labels[1])
        labels = None, None
        label = f"{100.0 * design.loop.plant.damping_ratio:.2g} %: {longest:.0f} periods"
        level.plot(periods, 100.0 * _STEP * steps.log_response_after_level, ls=line, color=SECOND, label=label)
    level.axhline(100.0 * _STEP, color=REJECTED, lw=0.9)
    for axis, text in ((lag, "phase error, deg"), (level, "change of level, %")):
        axis.set(xlabel="periods of vibration", ylabel=text, xlim=(0.0, until))
    _legend_above(lag, title="phase error after")
    level.legend(loc="lower right", title="damping: settles in")


def _legend_above(axis: Axes, columns: int = 1, title: str | None = None) -> None:
    axis.legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=columns, borderaxespad=0.2, title=title, alignment="left"
    )

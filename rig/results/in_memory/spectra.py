"""Figures of distortion levels, stabilisation diagrams and sweeps in memory."""

from typing import TYPE_CHECKING

import numpy as np

from identification import DistortionLevels, StabilisationDiagram, Transient
from rig.drawing.style import MAIN, REJECTED, SECOND, THIRD, title, unit_text

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_FLOOR = 1e-6  # of the largest amplitude: smaller values are rounding


def draw_distortion(page: "Figure", levels: DistortionLevels) -> None:
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


def draw_stabilisation(page: "Figure", diagram: StabilisationDiagram) -> None:
    """Draw the poles over the order, and the singular values."""
    poles, singular = page.subplots(1, 2, width_ratios=(2.0, 1.0))
    for which, marker, colour, label in (
        (~diagram.frequency_stable, ".", REJECTED, "new"),
        (diagram.frequency_stable & ~diagram.stable, "+", SECOND, "frequency stable"),
        (diagram.stable, "o", MAIN, "frequency, damping and shape stable"),
    ):
        at = which & diagram.physical
        poles.plot(diagram.frequency_hz[at], diagram.order[at], marker, mfc="none", color=colour, label=label)
    poles.set(xlabel="frequency, Hz", ylabel="model order")
    values = diagram.singular_values
    singular.semilogy(np.arange(1, values.size + 1), values / values[0], ".-", color=MAIN)
    singular.set(xlabel="number", ylabel="singular value over the first")
    page.legend(*poles.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    title(page, "stabilisation diagram")


def draw_transient(page: "Figure", sweep: Transient) -> None:
    """Draw the fundamental of every channel and the frequency over time."""
    axes = page.subplots(len(sweep.channels) + 1, 1, sharex=True)
    for axis, channel, values in zip(axes, sweep.channels, np.abs(sweep.fundamentals), strict=False):
        axis.plot(sweep.time_s, values, color=MAIN)
        axis.set(ylabel=f"{channel.name}, {unit_text(channel.unit)}")
        axis.set_ylim(bottom=0.0)
    axes[-1].plot(sweep.time_s, sweep.frequency_hz, color=MAIN)
    axes[-1].set(ylabel="frequency, Hz", xlabel="time, s")
    title(page, f"fundamentals over time, averaged over {sweep.window_periods} periods")

"""Figure of a nonlinear mode: modal properties over the amplitude, and what the force was made of."""

from typing import TYPE_CHECKING, Any

import numpy as np

from identification import NonlinearMode
from rig.figures.style import MAIN, SECOND, engineering, say_why_empty, title

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw_mode", "draw_properties"]


def draw_mode(page: "Figure", mode: NonlinearMode) -> None:
    """Draw a model."""
    axes = page.subplots(2, 2)
    draw_properties(axes[0, 0], axes[0, 1], mode)
    amplitude, unit = engineering(mode.amplitude_m)
    order = np.argsort(mode.force_n)
    axes[1, 0].plot(mode.force_n[order], amplitude[order], "o-", ms=4, color=MAIN)
    axes[1, 0].set(xlabel="force amplitude (fundamental), N", ylabel=f"displacement amplitude, {unit}")
    _harmonics(axes[1, 1], mode)
    title(page, f"{mode.specimen or 'specimen'}: nonlinear mode from {mode.source}, {mode.force_n.size} points")


def draw_properties(left: "Axes", right: "Axes", mode: NonlinearMode, colour: str = MAIN) -> None:
    """Modal frequency and damping over the amplitude."""
    order = np.argsort(mode.amplitude_m)
    amplitude, unit = engineering(mode.amplitude_m[order])
    error: dict[str, Any] = {"fmt": "o-", "ms": 4, "color": colour, "capsize": 2, "elinewidth": 0.8}
    left.errorbar(amplitude, mode.modal_frequency_hz[order], 1.96 * mode.modal_frequency_std_hz[order], **error)
    left.set(xlabel=f"displacement amplitude, {unit}", ylabel="modal frequency, Hz")
    if np.isfinite(mode.damping_ratio).any():
        right.errorbar(
            amplitude,
            100 * mode.damping_ratio[order],
            196 * mode.damping_ratio_std[order],
            label="active power of the fundamental" if mode.source == "backbone" else "one-mode fit",
            **error,
        )
        if np.isfinite(mode.damping_ratio_total_power).any():
            right.plot(
                amplitude,
                100 * mode.damping_ratio_total_power[order],
                "s--",
                ms=3.5,
                color=SECOND,
                label="active power of all harmonics",
            )
        right.legend(fontsize=8)
    else:
        say_why_empty(right, "damping needs the specimen's drive_mode_shape")
    right.set(xlabel=f"displacement amplitude, {unit}", ylabel="modal damping ratio, %")
    _keep_small_changes_small(right)


def _keep_small_changes_small(axis: "Axes") -> None:
    """Let the axis span a fifth of its middle at the least, so that scatter does not look like a trend."""
    low, high = axis.get_ylim()
    middle, half = 0.5 * (low + high), max(0.5 * (high - low), 0.1 * abs(low + high))
    axis.set_ylim(max(0.0, middle - half), middle + half)


def _harmonics(axis: "Axes", mode: NonlinearMode) -> None:
    order = np.argsort(mode.force_n)
    drawn = False
    for harmonic, marker in ((2, "^"), (3, "v")):
        if mode.force_harmonics.shape[1] > harmonic and np.isfinite(mode.force_harmonics).any():
            ratio = np.abs(mode.force_harmonics[:, harmonic]) / np.abs(mode.force_harmonics[:, 1])
            axis.plot(
                mode.force_n[order],
                ratio[order],
                marker + "-",
                ms=4,
                color=MAIN if harmonic == 2 else SECOND,
                label=f"|F{harmonic}|/|F1|",
            )
            drawn = True
    if drawn:
        axis.set(xlabel="force amplitude (fundamental), N", ylabel="harmonics of the force")
        axis.set_ylim(bottom=0.0)
        axis.legend(fontsize=8)
        return
    axis.plot(mode.modal_frequency_hz, engineering(mode.amplitude_m)[0], "o-", ms=4, color=MAIN)
    axis.locator_params(axis="x", nbins=5)
    axis.set(xlabel="modal frequency, Hz", ylabel=f"displacement amplitude, {engineering(mode.amplitude_m)[1]}")

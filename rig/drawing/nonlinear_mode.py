"""Figure of a nonlinear mode: modal properties over the amplitude, and the harmonics of the force."""

from typing import TYPE_CHECKING, Any

import numpy as np

from identification import NonlinearMode
from rig.drawing.style import MAIN, SECOND, engineering, say_why_empty, title

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["draw_mode", "draw_properties"]


def draw_mode(page: "Figure", mode: NonlinearMode) -> None:
    """Draw a nonlinear mode."""
    shapes, purities = np.isfinite(mode.mac).any(), np.isfinite(mode.force_purity).any()
    axes = page.subplots(2, 3 if shapes or purities else 2)
    draw_properties(axes[0, 0], axes[0, 1], mode)
    amplitude, unit = engineering(mode.amplitude_m)
    order = np.argsort(mode.force_n)
    if shapes or purities:
        _draw_mac(axes[0, 2], mode)
        _draw_purity(axes[1, 2], mode)
    axes[1, 0].plot(mode.force_n[order], amplitude[order], "o-", ms=4, color=MAIN)
    axes[1, 0].set(xlabel="force amplitude (fundamental), N", ylabel=f"displacement amplitude, {unit}")
    _harmonics(axes[1, 1], mode)
    title(page, f"{mode.specimen or 'specimen'}: nonlinear mode from {mode.source}, {mode.force_n.size} points")


def _draw_mac(axis: "Axes", mode: NonlinearMode) -> None:
    """Draw one minus the MAC on a logarithmic axis; a MAC close to one would be a line at the top."""
    if not np.isfinite(mode.mac).any():
        say_why_empty(axis, "MAC needs mode shapes")
        return
    order = np.argsort(mode.amplitude_m)
    amplitude, unit = engineering(mode.amplitude_m[order])
    away = np.maximum(1.0 - mode.mac[order], 1e-12)
    low, high = np.maximum(1.0 - mode.interval("mac")[order, ::-1].T, 0.1 * np.nanmin(away))  # to zero, off the axis
    axis.fill_between(amplitude, low, high, color=MAIN, alpha=0.2, lw=0)
    axis.semilogy(amplitude, away, "o-", ms=4, color=MAIN)
    axis.set(xlabel=f"displacement amplitude, {unit}", ylabel="1 - MAC against the linear shape")


def _draw_purity(axis: "Axes", mode: NonlinearMode) -> None:
    """Draw the share of the fundamental in force and motion, with its 95 % interval."""
    if not np.isfinite(mode.force_purity).any():
        say_why_empty(axis, "purity needs harmonics")
        return
    order = np.argsort(mode.force_n)
    for name, label, colour in (("force_purity", "force", MAIN), ("response_purity", "drive point", SECOND)):
        low, high = mode.interval(name)[order].T
        axis.fill_between(mode.force_n[order], low, high, color=colour, alpha=0.2, lw=0)
        axis.plot(mode.force_n[order], getattr(mode, name)[order], "o-", ms=4, color=colour, label=label)
    axis.set(xlabel="force amplitude (fundamental), N", ylabel="purity", ylim=(0.0, 1.05))
    axis.legend(fontsize=8)


def draw_properties(left: "Axes", right: "Axes", mode: NonlinearMode, colour: str = MAIN) -> None:
    """Draw modal frequency and damping over the amplitude, with their 95 % intervals."""
    order = np.argsort(mode.amplitude_m)
    amplitude, unit = engineering(mode.amplitude_m[order])
    error: dict[str, Any] = {"fmt": "o-", "ms": 4, "color": colour, "capsize": 2, "elinewidth": 0.8}
    left.errorbar(amplitude, mode.modal_frequency_hz[order], mode.bound_95("modal_frequency_hz")[order], **error)
    left.set(xlabel=f"displacement amplitude, {unit}", ylabel="modal frequency, Hz")
    if np.isfinite(mode.damping_ratio).any():
        right.errorbar(
            amplitude,
            100 * mode.damping_ratio[order],
            100 * mode.bound_95("damping_ratio")[order],
            label="one-mode fit" if mode.source == "stepped sine" else "active power of the fundamental",
            **error,
        )
        if np.isfinite(mode.damping_ratio_total_power).any():
            right.errorbar(
                amplitude,
                100 * mode.damping_ratio_total_power[order],
                100 * mode.bound_95("damping_ratio_total_power")[order],
                label="active power of all harmonics",
                **{**error, "fmt": "s--", "ms": 3.5, "color": SECOND},
            )
        right.legend(fontsize=8)
    else:
        say_why_empty(right, "damping needs the specimen's drive_mode_shape")
    right.set(xlabel=f"displacement amplitude, {unit}", ylabel="modal damping ratio, %")
    _keep_small_changes_small(right)


def _keep_small_changes_small(axis: "Axes") -> None:
    """Let the axis span at least a fifth of its middle value, so that scatter does not look like a trend."""
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

"""Figure of a nonlinear mode: modal properties over the amplitude, and the harmonics of the force."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from identification import NonlinearMode
from rig.drawing.axes import DAMPING_SPAN, widen
from rig.drawing.interactive.shapes import note_points
from rig.drawing.page import grid
from rig.drawing.style import MAIN, REJECTED, SECOND, Axes, Figure, engineering, say_why_empty, title

_GAIN_ERROR = 0.02  # relative error of a sensor's sensitivity that is assumed; chosen
SHAPE_FLOOR = _GAIN_ERROR**2 / 4.0
"""1 - MAC of two equal components, one of them wrong by 2 %: a smaller change of shape is not told from a sensor's error."""


def draw_mode(page: Figure, mode: NonlinearMode) -> None:
    """Draw a nonlinear mode. Without harmonics of the force, purity and phase lag are left out.

    The change of the mode shape has a panel if it exceeds `SHAPE_FLOOR`; otherwise the title says that there is none.
    """
    pure = bool(np.isfinite(mode.force_purity).any())
    axes = grid(page, 2, 3 if pure else 2)
    draw_properties(axes[0, 0], axes[0, 1], mode)
    amplitude, unit = engineering(mode.amplitude_m)
    order = np.argsort(mode.force_n)
    axes[1, 0].plot(mode.force_n[order], amplitude[order], "o-", color=MAIN)
    axes[1, 0].set(xlabel="force amplitude (fundamental), N", ylabel=f"displacement, {unit}")
    _harmonics(axes[1, 1], mode)
    away = 1.0 - mode.mac[np.isfinite(mode.mac)]
    change = bool(away.size) and away.max() > SHAPE_FLOOR
    shape_text = f"; shape as the linear one (1 - MAC below {SHAPE_FLOOR:g})" if away.size and not change else ""
    if pure:
        _draw_purity(axes[1, 2], mode)
        if change:
            _draw_mac(axes[0, 2], mode)
        else:
            _draw_lag(axes[0, 2], mode)
    count = mode.force_n.size
    points = f"{count} point{'' if count == 1 else 's'}"
    title(page, f"{mode.specimen or 'specimen'}: nonlinear mode from {mode.source}, {points}{shape_text}")


def _draw_mac(axis: Axes, mode: NonlinearMode) -> None:
    """Draw one minus the MAC with its 95 % interval, over the floor below which it means nothing."""
    order = np.argsort(mode.amplitude_m)
    amplitude, unit = engineering(mode.amplitude_m[order])
    away = np.maximum(1.0 - mode.mac[order], 0.1 * SHAPE_FLOOR)
    low, high = np.maximum(1.0 - mode.interval("mac")[order, ::-1].T, 0.1 * SHAPE_FLOOR)
    axis.fill_between(amplitude, low, high, color=MAIN, alpha=0.2, lw=0)
    axis.semilogy(amplitude, away, "o-", color=MAIN, label="measured, 95 %")
    axis.axhspan(0.1 * SHAPE_FLOOR, SHAPE_FLOOR, color=REJECTED, alpha=0.25, lw=0, label="2 % error of a sensor")
    axis.set(xlabel=f"displacement amplitude, {unit}", ylabel="1 - MAC to linear shape")
    axis.legend()


def _draw_lag(axis: Axes, mode: NonlinearMode) -> None:
    order = np.argsort(mode.amplitude_m)
    amplitude, unit = engineering(mode.amplitude_m[order])
    axis.axhline(90.0, color=REJECTED, lw=0.8)
    bound = np.nan_to_num(mode.bound_95("phase_lag_deg")[order])
    axis.errorbar(amplitude, mode.phase_lag_deg[order], bound, fmt="o-", color=MAIN)
    low, high = axis.get_ylim()
    axis.set(xlabel=f"displacement amplitude, {unit}", ylabel="phase lag, deg")
    axis.set_ylim(min(low, 85.0), max(high, 95.0))


def _draw_purity(axis: Axes, mode: NonlinearMode) -> None:
    order = np.argsort(mode.force_n)
    for name, label, colour, line in (
        ("force_purity", "force", MAIN, "o-"),
        ("response_purity", "drive point", SECOND, "s--"),
    ):
        low, high = mode.interval(name)[order].T
        axis.fill_between(mode.force_n[order], low, high, color=colour, alpha=0.2, lw=0)
        axis.plot(mode.force_n[order], getattr(mode, name)[order], line, color=colour, label=label)
    axis.set(xlabel="force amplitude (fundamental), N", ylabel="purity", ylim=(0.0, 1.05))
    axis.legend(title="fundamental over RMS of all")


def draw_properties(left: Axes, right: Axes, mode: NonlinearMode, notes: Sequence[str] = ()) -> None:
    """Draw modal frequency and damping over the amplitude, with their 95 % intervals; ``notes``: what is told of each point."""
    order = np.argsort(mode.amplitude_m)
    told = tuple(notes[n] for n in order) if len(notes) == order.size else ()
    amplitude, unit = engineering(mode.amplitude_m[order])
    error: dict[str, Any] = {"fmt": "o-", "color": MAIN}
    drawn = left.errorbar(
        amplitude, mode.modal_frequency_hz[order], mode.bound_95("modal_frequency_hz")[order], **error
    )
    note_points(drawn[0], told)
    left.set(xlabel=f"displacement amplitude, {unit}", ylabel="modal frequency, Hz")
    if np.isfinite(mode.damping_ratio).any():
        own = "one-mode fit" if mode.source == "stepped sine" else "from the fundamental's power"
        for name, label, style in (
            ("damping_ratio", own, error),
            ("damping_ratio_total_power", "from the power of all harmonics", {"fmt": "s--", "color": SECOND}),
        ):
            damping = 100 * getattr(mode, name)[order]
            if np.isfinite(damping).any():
                drawn = right.errorbar(amplitude, damping, 100 * mode.bound_95(name)[order], label=label, **style)
                note_points(drawn[0], told)
        right.legend()
    else:
        say_why_empty(right, "damping needs the specimen's drive_mode_shape")
    right.set(xlabel=f"displacement amplitude, {unit}", ylabel="modal damping, %")
    widen(right, DAMPING_SPAN)
    right.set_ylim(bottom=max(0.0, right.get_ylim()[0]))


def _harmonics(axis: Axes, mode: NonlinearMode) -> None:
    order = np.argsort(mode.force_n)
    drawn = False
    for harmonic, marker, colour in ((2, "^", MAIN), (3, "v", SECOND)):
        if mode.force_harmonics.shape[1] > harmonic and np.isfinite(mode.force_harmonics).any():
            ratio = np.abs(mode.force_harmonics[:, harmonic]) / np.abs(mode.force_harmonics[:, 1])
            label = f"harmonic {harmonic}, |F{harmonic}|/|F1|"
            axis.plot(mode.force_n[order], ratio[order], marker + "-", color=colour, label=label)
            drawn = True
    if drawn:
        axis.set(xlabel="force amplitude (fundamental), N", ylabel="harmonics of force")
        axis.set_ylim(bottom=0.0)
        axis.legend()
        return
    axis.plot(mode.modal_frequency_hz, engineering(mode.amplitude_m)[0], "o-", color=MAIN)
    axis.locator_params(axis="x", nbins=5)
    axis.set(xlabel="modal frequency, Hz", ylabel=f"displacement, {engineering(mode.amplitude_m)[1]}")

"""Figures of backbones without waiting, and of vibrations by harmonic balance."""

from typing import TYPE_CHECKING

import numpy as np

from identification import ContinuousBackbone
from rig.drawing.style import MAIN, REJECTED, SECOND, THIRD, title
from rig.results.in_memory.axes import band, branches, length_factor
from simulators.analysis import PeriodicResponses

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def draw_continuous(page: "Figure", found: ContinuousBackbone) -> None:
    """Draw modal frequency and damping over the amplitude: the mean of both ramps with its 95 % band, and each ramp."""
    frequency, damping = page.subplots(1, 2)
    factor, unit = length_factor(found.amplitude_m)
    x = factor * found.amplitude_m
    omega = np.sqrt(found.stiffness)  # of the ramp up and of the ramp down
    omega_std = 0.5 * found.stiffness_std / omega
    ratio, ratio_std = 0.5 * found.damping_1_s / omega, 0.5 * found.damping_std_1_s / omega
    values = ((frequency, omega, omega_std, 0.5 / np.pi), (damping, ratio, ratio_std, 100.0))
    for axis, both, std, scale in values:
        half = 1.96 * 0.5 * np.sqrt(np.sum(std**2, axis=0))
        for way, marker, colour, label in zip(both, "^v", (SECOND, THIRD), ("ramp up", "ramp down"), strict=True):
            axis.plot(x, scale * way, marker + ":", color=colour, label=label)
        band(axis, x, scale * both.mean(axis=0), scale * half, MAIN, label="mean, 95 % of the noise")
        axis.set(xlabel=f"displacement amplitude, {unit}", xscale="log")
    frequency.set(ylabel="modal frequency, Hz")
    damping.set(ylabel="modal damping ratio, %")
    damping.legend()
    title(page, f"{found.backbone.specimen or 'specimen'}: continuous backbone, {found.periods:.0f} periods")


def draw_periodic(page: "Figure", found: PeriodicResponses) -> None:
    """Draw amplitude and lag over the frequency, in the order of the points; unstable parts are dotted."""
    size, lag = page.subplots(1, 2)
    factor, unit = length_factor(found.amplitude_m)
    stable = found.stable
    branches(size, found.frequency_hz, factor * found.amplitude_m, stable, label="harmonic balance", color=MAIN)
    displacement_lag = (180.0 + found.phase_lag_deg) % 360.0
    branches(lag, found.frequency_hz, displacement_lag, stable, label="harmonic balance", color=MAIN)
    size.set(xlabel="frequency, Hz", ylabel=f"displacement amplitude, {unit}")
    size.legend()
    lag.axhline(90.0, color=REJECTED, lw=0.8)
    lag.set(xlabel="frequency, Hz", ylabel="phase lag of displacement, deg")
    title(page, f"harmonic balance, {found.frequency_hz.size} points")

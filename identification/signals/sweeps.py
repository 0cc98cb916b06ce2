"""Force drop-out in an uncontrolled sweep through resonance: how far the force drops and overshoots, and the largest motion.

A shaker that is driven with a constant voltage yields to a resonant structure. The fundamental of the force falls to a few
per cent and, in a fast sweep, overshoots afterwards. Both are given as fractions of the force off resonance. That force is
not a single number, because the mass of the armature and the suspension make it rise or fall over the band. The result
therefore states which part of the sweep counts as off resonance.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.channels import MOTION_ORDER, find_role
from identification.errors import IdentificationError
from identification.signals.transients import Transient
from vibrolock.arrays import Float

Band = tuple[float, float]

_BEFORE = 0.15
"""Share of the swept band, at its beginning, where the force is off resonance; at both ends it is not searched. Chosen."""


@dataclass(frozen=True)
class ForceDropOut:
    """Drop-out of the fundamental of the force in one sweep through one resonance; all amplitudes are peak values.

    Parameters
    ----------
    off_resonance_n
        Force off resonance: the mean of its medians over the bands ``off_resonance_hz``.
    off_resonance_hz
        Frequency bands that count as off resonance.
    minimum_n, minimum_time_s, minimum_frequency_hz
        Smallest force, and its time and frequency.
    overshoot_n, overshoot_time_s, overshoot_frequency_hz
        Largest force after the minimum, and its time and frequency.
    peak_m
        Largest displacement of the response channel, m: its fundamental, integrated where it is a velocity or an acceleration.
    peak_time_s, peak_frequency_hz
        Time and frequency of the largest displacement. The largest acceleration is elsewhere, at a higher frequency.
    peak, peak_channel, peak_unit
        Fundamental of the response channel at that time, in its unit; name and unit of this channel.
    window_periods
        Window over which the fundamentals were smoothed; a wider window gives a shallower minimum in a fast sweep.
    """

    off_resonance_n: float
    off_resonance_hz: tuple[Band, ...]
    minimum_n: float
    minimum_time_s: float
    minimum_frequency_hz: float
    overshoot_n: float
    overshoot_time_s: float
    overshoot_frequency_hz: float
    peak: float
    peak_m: float
    peak_time_s: float
    peak_frequency_hz: float
    peak_channel: str
    peak_unit: str
    window_periods: int

    @property
    def minimum_ratio(self) -> float:
        """Smallest force over the force off resonance."""
        return self.minimum_n / self.off_resonance_n

    @property
    def overshoot_ratio(self) -> float:
        """Largest force after the minimum over the force off resonance."""
        return self.overshoot_n / self.off_resonance_n


def force_drop_out(
    sweep: Transient,
    *,
    response: str | None = None,
    off_resonance_hz: Sequence[Band] | None = None,
    resonance_hz: Band | None = None,
) -> ForceDropOut:
    """Evaluate the drop-out of the force in a sweep.

    Raises `IdentificationError` if a band has no values, the channel does not exist, or the force off resonance is
    zero.

    Parameters
    ----------
    sweep
        Fundamentals of the sweep.
    response
        Channel whose largest displacement is evaluated; the channel of role ``drive`` if None.
    off_resonance_hz
        Bands of the instantaneous frequency that count as off resonance. If None: the first 15 % of the sweep's range, which
        is before the resonance.
    resonance_hz
        Band in which minimum and peak are sought; if None, the range without its first and last 15 %.
    """
    frequency, force = sweep.frequency_hz, np.abs(sweep.force)
    start, end = float(frequency[0]), float(frequency[-1])
    edge = _BEFORE * (end - start)
    bands = tuple(off_resonance_hz) if off_resonance_hz is not None else (_sorted(start, start + edge),)
    searched = resonance_hz if resonance_hz is not None else _sorted(start + edge, end - edge)
    off = float(np.mean([np.median(force[_within(frequency, band, "off_resonance_hz")]) for band in bands]))
    if not off > 0.0:
        raise IdentificationError(f"is {off:g} N off resonance", field="force", allowed="above zero")
    near = np.flatnonzero(_within(frequency, searched, "resonance_hz"))
    lowest = int(near[np.argmin(force[near])])
    largest = lowest + int(np.argmax(force[lowest:]))
    row = sweep.index(response) if response is not None else find_role(sweep.channels, "drive")
    channel = sweep.channels[row]
    amplitude = np.abs(sweep.fundamentals[row])
    displacement_m = amplitude / (2.0 * np.pi * frequency) ** MOTION_ORDER[channel.motion]
    top = int(near[np.argmax(displacement_m[near])])
    return ForceDropOut(
        off_resonance_n=off,
        off_resonance_hz=bands,
        minimum_n=float(force[lowest]),
        minimum_time_s=float(sweep.time_s[lowest]),
        minimum_frequency_hz=float(frequency[lowest]),
        overshoot_n=float(force[largest]),
        overshoot_time_s=float(sweep.time_s[largest]),
        overshoot_frequency_hz=float(frequency[largest]),
        peak=float(amplitude[top]),
        peak_m=float(displacement_m[top]),
        peak_time_s=float(sweep.time_s[top]),
        peak_frequency_hz=float(frequency[top]),
        peak_channel=channel.name,
        peak_unit=channel.unit,
        window_periods=sweep.window_periods,
    )


def _sorted(one: float, other: float) -> Band:
    return min(one, other), max(one, other)


def _within(frequency: Float, band: Band, name: str) -> NDArray[np.bool_]:
    inside = (frequency >= band[0]) & (frequency <= band[1])
    if not inside.any():
        reason = f"is {band[0]:g} to {band[1]:g} Hz, the sweep covers {frequency.min():.4g} to {frequency.max():.4g} Hz"
        raise IdentificationError(reason, field=name)
    return np.asarray(inside)

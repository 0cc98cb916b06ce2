"""Instantaneous frequency and magnitude of a force from its zero crossings, as in the founding paper.

Scheel et al., prediction of transients under swept sine: the frequency from the time between successive zero crossings, the
magnitude as the largest value between them. Both are inaccurate if harmonics or noise are a large part of the signal, as in
the force near resonance; `identification.demodulate` is then the better choice.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from identification.errors import IdentificationError
from identification.validation import finite_array, positive
from vibrolock.arrays import Float


@dataclass(frozen=True, eq=False)
class HalfPeriods:
    """Half or whole periods of a signal between successive zero crossings.

    Parameters
    ----------
    time_s
        float[n], time midway between two crossings, relative to the first sample.
    frequency_hz
        float[n], inverse of the time between crossings in the same direction; for half periods, half the inverse of the time.
    magnitude
        float[n], largest absolute sample between two crossings, in the unit of the signal.
    """

    time_s: Float
    frequency_hz: Float
    magnitude: Float


def zero_crossings(signal: ArrayLike, *, sample_rate_hz: float, whole_periods: bool = False) -> HalfPeriods:
    """Find the periods of a signal between zero crossings, which are interpolated linearly between samples.

    Raises `IdentificationError` if values are NaN or infinite, or there are
    fewer than two crossings.

    Parameters
    ----------
    signal
        The signal, float[n].
    sample_rate_hz
        Samples per second.
    whole_periods
        Whether only upward crossings count. A mean or an even harmonic, which makes both halves of a period unequal, then
        does not affect the frequency.
    """
    values = finite_array("signal", signal, np.float64, 1)
    rate_hz = positive("sample_rate_hz", sample_rate_hz, "Hz")
    moved = np.flatnonzero(values)  # drop samples of exactly zero: they neither count as crossings nor hide them
    value = values[moved]
    before = np.flatnonzero(np.diff(value > 0.0))
    if whole_periods:
        before = before[value[before] < 0.0]
    if before.size < 2:
        upward = "upward " if whole_periods else ""
        raise IdentificationError(f"has {before.size} {upward}zero crossings", field="signal", allowed="at least 2")
    share = value[before] / (value[before] - value[before + 1])
    crossing_s = (moved[before] + share * (moved[before + 1] - moved[before])) / rate_hz
    largest = np.maximum.reduceat(np.abs(value), before + 1)[:-1]
    return HalfPeriods(
        time_s=0.5 * (crossing_s[1:] + crossing_s[:-1]),
        frequency_hz=(1.0 if whole_periods else 0.5) / np.diff(crossing_s),
        magnitude=largest,
    )

"""Momentary frequency and magnitude of a force from its zero crossings, as the founding paper took them.

Scheel et al., prediction of transients under swept sine: the frequency from the time between successive zero crossings,
the magnitude as the largest value between them. Both suffer where harmonics or noise make a good part of the signal, as
they do in the force near resonance: then `identification.demodulate` is the better choice.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from identification.errors import IdentificationError
from identification.validation import finite_array, positive

__all__ = ["HalfPeriods", "zero_crossings"]

Float = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class HalfPeriods:
    """What lies between successive zero crossings of a signal: half periods, or whole ones.

    Parameters
    ----------
    time_s
        float[n], middle between two crossings, from the first sample on.
    frequency_hz
        float[n], one over the time between crossings in the same direction; of half periods half of one over the time.
    magnitude
        float[n], largest absolute sample between them, in the unit of the signal.
    """

    time_s: Float
    frequency_hz: Float
    magnitude: Float


def zero_crossings(signal: ArrayLike, *, sample_rate_hz: float, whole_periods: bool = False) -> HalfPeriods:
    """Periods of ``signal``, float[n]; a crossing lies on the straight line between the samples around it.

    With ``whole_periods`` the upward crossings count alone: what makes both halves of a period unequal, a mean or an even
    harmonic, then leaves the frequency alone. Raises `IdentificationError` on NaN or inf, or fewer than two crossings.
    """
    values = finite_array("signal", signal, np.float64, 1)
    rate_hz = positive("sample_rate_hz", sample_rate_hz, "Hz")
    moved = np.flatnonzero(values)  # a sample of exactly zero neither is a crossing nor hides one
    value = values[moved]
    before = np.flatnonzero(np.diff(value > 0.0))
    if whole_periods:
        before = before[value[before] < 0.0]
    if before.size < 2:
        upward = "upward " if whole_periods else ""
        raise IdentificationError(f"signal: has {before.size} {upward}zero crossings, needs at least 2")
    share = value[before] / (value[before] - value[before + 1])
    crossing_s = (moved[before] + share * (moved[before + 1] - moved[before])) / rate_hz
    largest = np.maximum.reduceat(np.abs(value), before + 1)[:-1]
    return HalfPeriods(
        time_s=0.5 * (crossing_s[1:] + crossing_s[:-1]),
        frequency_hz=(1.0 if whole_periods else 0.5) / np.diff(crossing_s),
        magnitude=largest,
    )

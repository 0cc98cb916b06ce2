"""How a device goes on with the vibration when an output is missing: the last period that the host has sent, repeated.

The rule is that of the protocol's page (docs/reference/wire-protocol.md), on integers alone, so that every device and every
host computes the same counts. Nothing here knows of a wire. Outputs are counts of the converter, by the index of the sample
at which they are due; a period is in steps of 1/65536 sample.

It reads outputs that were handed over, never its own: errors of the interpolation do not accumulate.
"""

import math

import numpy as np

from vibrolock.compiled import Record, kernel

STEPS = 1 << 16
"""Steps of a period in one sample."""
SHORTEST_PERIOD = 4
"""Samples: a cubic through four outputs says nothing of a shorter period."""
LOWEST_CONTINUED_HZ = 2.0
"""Lowest frequency of which a period is continued, Hz; chosen: below the first mode of what is tested."""
_REACH = 4  # outputs that are read beside a period: the points of the cubic
_UNIT = 1 << 30  # of the factor of a ramp
_NO_RUN = -1  # no block ends there

SOURCE = np.dtype(
    [
        ("longest", "i8"),
        ("armed", "i8"),
        ("run_begin", "i8"),
        ("run_end", "i8"),
        ("end", "i8"),
        ("period", "i8"),
        ("ramp", "i8"),
        ("is_bounded", "i8"),
        ("lowest", "i8"),
        ("highest", "i8"),
    ]
)
"""What a device goes on with (one record). ``longest``: longest period, samples; ``armed``: instant of ARM; ``run_begin``,
``run_end``: consecutive outputs with a period. The source is the period before ``end``: ``period`` (steps; 0: there is no
source, outputs are held), ``ramp`` (samples from ``end`` to 0 V; 0: none), and its extremes, valid where ``is_bounded``."""


def longest_period(rate_hz: float) -> int:
    """Return the longest period that is continued at a rate (Hz), samples."""
    return math.ceil(rate_hz / LOWEST_CONTINUED_HZ)


def ring_for(longest_period: int) -> np.ndarray:
    """Return an empty ring of counts int64[size] that is long enough for periods up to ``longest_period`` samples."""
    return np.zeros(2 * longest_period + _REACH, np.int64)


@kernel
def period_steps(period_samples: float) -> int:
    """Return a period in steps, to the nearest; 0 for one that is not positive, not finite, or beyond 32 bits."""
    steps = period_samples * STEPS
    return round(steps) if 0.0 < steps < 2.0**32 - 1.0 else 0


@kernel
def ramp_length(ramp_samples: float) -> int:
    """Return the samples until a ramp is over, rounded up; 0 where there is none, at most 32 bits."""
    return math.ceil(min(ramp_samples, 2.0**32 - 1.0)) if ramp_samples > 0.0 else 0


@kernel
def begin(source: Record, longest_period: int) -> None:
    """Begin with nothing kept, as at the start of sampling; periods up to ``longest_period`` samples can be continued."""
    source.longest = longest_period
    forget(source, 0)


@kernel
def forget(source: Record, instant: int) -> None:
    """Forget the run and the source, as at ARM: outputs due before ``instant`` never count."""
    source.armed = instant
    source.run_begin = source.run_end = _NO_RUN
    source.period = 0


@kernel
def keep(source: Record, ring: np.ndarray, first: int, counts: np.ndarray, period: int, ramp: int) -> None:
    """Keep a valid block of outputs: counts int64[n] due from sample ``first`` on, late or not.

    ``period`` is in steps, 0 for none; ``ramp`` in samples from the block's end to 0 V, 0 for none. ``ring`` is that of
    `ring_for`.
    """
    end = first + counts.size
    if end > source.end + source.longest:
        source.period = 0
    if period < SHORTEST_PERIOD * STEPS or period > source.longest * STEPS:
        source.run_end = _NO_RUN
        source.period = 0
        return
    for index in range(max(first, max(source.run_end, end) - ring.size), end):
        ring[index % ring.size] = counts[index - first]
    source.is_bounded = 0
    if first < source.run_end:
        return
    if first > source.run_end:
        source.run_begin = max(first, source.armed)
    source.run_end = end
    if end - source.run_begin >= period // STEPS + _REACH:
        source.end, source.period, source.ramp = end, period, ramp


@kernel
def count_at(source: Record, ring: np.ndarray, instant: int) -> int:
    """Return the count with which to go on at ``instant``, not cut to the converter's range; only where there is a source.

    A cubic of Lagrange through four outputs of the source's period, cut to the extremes of that period. During a ramp it is
    multiplied by the square of the share of the time that is left: the host's raised cosine is never below it.
    """
    end, period = source.end, source.period
    beyond = instant - end
    place = (end - 2) * STEPS - period + (beyond + 2) * STEPS % period
    at, part = place // STEPS, place % STEPS
    size = ring.size
    p, q, r, s = ring[(at - 1) % size], ring[at % size], ring[(at + 1) % size], ring[(at + 2) % size]
    value = (-p + 3 * q - 3 * r + s) << 8  # 6 * 2**8 times the cubic, by Horner's rule
    value = (value * part >> 16) + ((3 * p - 6 * q + 3 * r) << 8)
    value = (value * part >> 16) + ((-2 * p - 3 * q + 6 * r - s) << 8)
    value = (value * part >> 16) + (6 * q << 8)
    _bound(source, ring)
    count = min(max((value + 768) // 1536, source.lowest), source.highest)
    if source.ramp > 0:
        left = max(source.ramp - beyond, 0)
        share = min(_UNIT, left * _UNIT // (source.ramp + end - at))
        size_of = (abs(count) * share // _UNIT) * share // _UNIT
        count = size_of if count >= 0 else -size_of
    return int(count)


@kernel
def _bound(source: Record, ring: np.ndarray) -> None:
    """Find the extremes of the source, once for each."""
    if source.is_bounded:
        return
    lowest = highest = ring[(source.end - 1) % ring.size]
    for index in range(source.end - source.period // STEPS - _REACH, source.end - 1):
        count = ring[index % ring.size]
        lowest, highest = min(lowest, count), max(highest, count)
    source.lowest, source.highest, source.is_bounded = lowest, highest, 1

"""How late blocks arrived, and at what rate, from the instants of their arrival."""

import math

import numpy as np

HORIZON_S = 0.5  # a block is late only if the device's clock is seen to go on within this time


def lateness_s(arrivals_s: np.ndarray, period_s: float, horizon_s: float = HORIZON_S) -> np.ndarray:
    """Return how late each block arrived, s, float64[n]; ``arrivals_s`` float64[n] in order, with one block each ``period_s``.

    A block is late by the most that it could have come earlier, as later blocks show: arrivals less their number of periods,
    above the lowest such value among those that follow within ``horizon_s`` to twice that. A stall of the host is made up for,
    block by block, and counts. A device whose clock has stood still is not made up for, and does not count.
    """
    since = arrivals_s - period_s * np.arange(arrivals_s.size)
    out = np.zeros(since.size)
    window = max(1, math.ceil(horizon_s / period_s))
    for first in range(0, since.size, window):
        ahead = since[first : first + 2 * window]
        lowest = np.minimum.accumulate(ahead[::-1])[::-1]
        out[first : first + window] = (ahead - lowest)[:window]
    return out


def reached_blocks_s(arrivals_s: np.ndarray, period_s: float) -> float:
    """Return the blocks per second of ``arrivals_s`` float64[n]; 0 if there are too few.

    They are counted from the block that is least late in the first fifth to that in the last fifth, so that a block late at
    either end does not count as a lower rate.
    """
    if arrivals_s.size < 2:
        return 0.0
    since = arrivals_s - period_s * np.arange(arrivals_s.size)
    part = max(1, arrivals_s.size // 5)
    first, last = int(np.argmin(since[:part])), arrivals_s.size - part + int(np.argmin(since[-part:]))
    return (last - first) / max(1e-9, float(arrivals_s[last] - arrivals_s[first]))

"""What an input does to its signal: the delay of its digital filter, and its AC coupling."""

import numpy as np

from vibrolock.arrays import Float
from vibrolock.compiled import kernel

SHORTEST_FILTER = 8.0
"""Delay from which on a filter has room for a windowed sinc, samples; shorter ones are linear between two samples."""
WINDOW = 8.0
"""Shape of the Kaiser window: side lobes below -80 dB."""


def delay_taps(delay: float) -> Float:
    """Taps [n] of a filter that delays by ``delay`` samples, 0 or more, and passes what is well below half the rate.

    A sinc about the delay in a Kaiser window (Laakso et al., Splitting the unit delay, 1996, section 3.2); linear between two
    samples where the delay is short.
    """
    whole = int(delay)
    if delay < SHORTEST_FILTER:
        taps = np.zeros(whole + 2)
        taps[whole : whole + 2] = 1.0 - (delay - whole), delay - whole
        return taps
    away = np.arange(2 * whole + 2) - delay
    inside = np.sqrt(np.maximum(0.0, 1.0 - (away / (delay + 2.0)) ** 2))
    taps = np.sinc(away) * np.i0(WINDOW * inside)
    return np.asarray(taps / taps.sum())


def high_pass(corner_hz: float, rate_hz: float) -> tuple[float, float]:
    """Gain and pole of a high-pass of first order, by the bilinear transform."""
    warped = float(np.tan(np.pi * corner_hz / rate_hz))
    return 1.0 / (1.0 + warped), (1.0 - warped) / (1.0 + warped)


class Filters:
    """The filters of inputs by column, at rest when they are made: a delay each, and a high-pass if the input is AC coupled."""

    def __init__(self, delays: Float, high_passes: list[tuple[float, float]]) -> None:
        taps = [delay_taps(delay) for delay in delays]
        self._taps = np.zeros((len(taps), max(each.size for each in taps)))
        for row, each in zip(self._taps, taps, strict=True):
            row[: each.size] = each
        self._past = np.zeros((self._taps.shape[1] - 1, len(taps)))
        self._high_passes = np.array(high_passes)
        self._states = np.zeros((len(taps), 2))

    def __call__(self, rows: Float, largest_v: float) -> Float:
        """Filter the next rows [n, columns], V; readings are clipped at ``largest_v``."""
        joined = np.vstack((self._past, rows))
        self._past = joined[rows.shape[0] :]
        out = np.empty(rows.shape)
        _filter(joined, self._taps, self._high_passes, self._states, largest_v, out)
        return out


@kernel
def _filter(joined: Float, taps: Float, high_passes: Float, states: Float, largest_v: float, out: Float) -> None:
    """Filter rows [past + n, columns] into ``out`` [n, columns]. A gain of 0 stands for no high-pass."""
    length = taps.shape[1]
    for column in range(joined.shape[1]):
        gain, pole = high_passes[column]
        for index in range(out.shape[0]):
            total = 0.0
            for lag in range(length):
                total += taps[column, lag] * joined[index + length - 1 - lag, column]
            if gain > 0.0:
                high = gain * (total - states[column, 0]) + pole * states[column, 1]
                states[column, 0], states[column, 1] = total, high
                total = high
            out[index, column] = min(max(total, -largest_v), largest_v)

"""Resampling by a rational factor: a low-pass in its phases, for every sample of the result the taps that meet a sample.

The result is that of `scipy.signal.resample_poly` to rounding. To import `scipy.signal` takes a second, in which minutes of a
recording are resampled.
"""

import math

import numpy as np

from vibrolock.arrays import Float

_BLOCK = 2048  # samples of the result that are computed at once; chosen: some megabytes


def low_pass(taps: int, corner: float, beta: float) -> Float:
    """float[taps]: `scipy.signal.firwin` with a Kaiser window; ``corner`` over half the sample rate, gain 1 at 0 Hz."""
    ago = np.arange(taps) - 0.5 * (taps - 1)
    h = np.sinc(corner * ago) * np.kaiser(taps, beta)
    return np.asarray(h / h.sum())


def resampled(signals: Float, up: int, down: int, taps: Float) -> Float:
    """float[..., ceil(n up/down)]: float[..., n] at ``up/down`` times its rate, with zeros beyond its ends.

    ``taps`` is an odd number of taps of a low-pass at ``up`` times the old rate, with gain 1 at 0 Hz; its delay is removed.
    """
    common = math.gcd(up, down)
    up, down, half = up // common, down // common, (taps.size - 1) // 2
    n = signals.shape[-1]
    count = -(-n * up // down)
    length = -(-taps.size // up)
    before, last = length, (half + (count - 1) * down) // up
    edges = [(0, 0)] * (signals.ndim - 1)
    padded = np.pad(signals, [*edges, (before, max(0, last + 1 - n))])
    out = np.empty((*signals.shape[:-1], count))
    for first in range(min(up, count)):
        newest, phase = divmod(half + first * down, up)
        of_phase = up * taps[phase::up][::-1]  # the oldest sample first
        start = before + newest - of_phase.size + 1
        windows = np.lib.stride_tricks.sliding_window_view(padded, of_phase.size, axis=-1)[..., start::down, :]
        size = -(-(count - first) // up)
        for at in range(0, size, _BLOCK):
            block = slice(at, min(at + _BLOCK, size))
            found = np.ascontiguousarray(windows[..., block, :]) @ of_phase
            out[..., first + up * block.start : first + up * (block.stop - 1) + 1 : up] = found
    return out


def resampled_beside_a_line(signals: Float, up: int, taps: Float) -> Float:
    """float[..., n up]: as `resampled`, but beyond its ends a signal goes on along the line through its two end values."""
    n, length = signals.shape[-1], -(-taps.size // up)
    first, last = signals[..., :1], signals[..., -1:]
    slope, ago = (last - first) / max(1, n - 1), np.arange(1.0, length + 1)
    longer = np.concatenate([first - slope * ago[::-1], signals, last + slope * ago], axis=-1)
    return resampled(longer, up, 1, taps)[..., length * up : (length + n) * up]

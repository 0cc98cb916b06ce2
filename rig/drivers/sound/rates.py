"""Between the sample rate of a sound device and that of a bench: linear-phase interpolation and decimation by a whole factor.

Both filters are the same low-pass, designed by the window method with a Kaiser window (`scipy.signal.firwin`). They pass up to
`PASS_BAND` of the bench's rate, and stop from the rate less that on, so that what folds back lies above what passes. The length
is such that the delay is a whole number of the bench's samples.
"""

from typing import NamedTuple

import numpy as np
import scipy

from rig.errors import DaqRefused
from vibrolock.arrays import Float
from vibrolock.compiled import kernel

PASS_BAND = 0.35
"""Highest frequency that passes unchanged, of the bench's sample rate; chosen: between a short delay and a wide band."""
STOP_DB = 90.0
"""Attenuation of images and of what folds back, dB; chosen: a 16-bit converter has 98."""
RATES_HZ = (44100.0, 48000.0, 88200.0, 96000.0, 176400.0, 192000.0)
"""Sample rates of sound devices, Hz."""
WHOLE = 1e-9
"""Relative difference up to which a ratio of two rates is whole; far above rounding."""


def factor_of(device_hz: float, bench_hz: float) -> int:
    """Return the whole number of frames of the device in a sample of the bench; 0 where it is none."""
    factor = round(device_hz / bench_hz)
    return factor if factor >= 1 and abs(device_hz / bench_hz - factor) <= WHOLE * factor else 0


class LowPass(NamedTuple):
    """A linear-phase low-pass between two rates."""

    taps: Float
    """Coefficients [2 delay factor + 1], of gain 1 at 0 Hz."""
    delay: int
    """Delay, samples of the bench."""


def low_pass(factor: int) -> LowPass:
    """Return the filter for a factor between the rates; of factor 1 none, with no delay."""
    if factor == 1:
        return LowPass(np.ones(1), 0)
    taps, beta = scipy.signal.kaiserord(STOP_DB, 2.0 * (1.0 - 2.0 * PASS_BAND) / factor)
    delay = -(-(taps - 1) // (2 * factor))
    return LowPass(scipy.signal.firwin(2 * delay * factor + 1, 1.0 / factor, window=("kaiser", beta)), delay)


@kernel
def _weighted(rows: np.ndarray, step: int, weights: np.ndarray, out: np.ndarray) -> None:
    """Fill ``out[i]`` [columns] with the sum of ``rows[i step + k] weights[k]`` over all k."""
    out[:] = 0.0
    for index in range(out.shape[0]):
        for tap in range(weights.shape[0]):
            for column in range(out.shape[1]):
                out[index, column] += rows[index * step + tap, column] * weights[tap, column]


class Interpolator:
    """Interpolates blocks of outputs from the bench's rate to the device's, with the state from one block to the next."""

    def __init__(self, factor: int) -> None:
        self._factor, filter_ = factor, low_pass(factor)
        self.delay = filter_.delay
        padded = np.zeros((2 * self.delay + 1) * factor)
        padded[: filter_.taps.size] = factor * filter_.taps
        self._phases = padded.reshape(2 * self.delay + 1, factor)[::-1].copy()
        self._before = np.zeros(2 * self.delay)

    def __call__(self, samples: Float) -> Float:
        """Return the frames [n factor] of the next samples [n]; ``delay`` samples late."""
        if self._factor == 1:
            return samples
        both = np.concatenate((self._before, samples))
        self._before = both[samples.size :]
        out = np.empty((samples.size, self._factor))
        _weighted(both[:, None].repeat(self._factor, axis=1), 1, self._phases, out)
        return out.ravel()


class Decimator:
    """Decimates blocks of inputs from the device's rate to the bench's, with the state from one block to the next.

    A frame that is not a number makes the samples around it NaN that it counts in, and no others.
    """

    def __init__(self, factor: int, channels: int) -> None:
        self._factor, filter_ = factor, low_pass(factor)
        self.delay = filter_.delay
        self._taps = filter_.taps[:, None].repeat(channels, axis=1)
        self._before = np.zeros((2 * self.delay * factor, channels))

    def __call__(self, frames: Float) -> Float:
        """Return the samples [n, channels] of the next frames [n factor, channels]; ``delay`` samples late."""
        if self._factor == 1:
            return frames
        both = np.concatenate((self._before, frames))
        self._before = both[frames.shape[0] :]
        out = np.empty((frames.shape[0] // self._factor, both.shape[1]))
        _weighted(both, self._factor, self._taps, out)
        return out


def chosen_rate(bench_hz: float, supported: list[float], asked_hz: float | None, device: str) -> float:
    """Return the device's rate: the one asked for, or the lowest of those supported that the bench's rate divides.

    Raises `DaqRefused` where there is none.
    """
    fitting = [rate for rate in sorted(supported) if factor_of(rate, bench_hz)]
    if asked_hz is None and fitting:
        return fitting[0]
    if asked_hz is not None and asked_hz in supported and factor_of(asked_hz, bench_hz):
        return asked_hz
    has = ", ".join(f"{rate:g}" for rate in sorted(supported)) or "no rate with these channels"
    if asked_hz is not None and asked_hz not in supported:
        raise DaqRefused(where=device, field="driver.options.device_rate_hz", value=asked_hz, allowed=f"{has} Hz")
    near = sorted({rate / round(rate / bench_hz) for rate in supported if rate >= bench_hz})
    raise DaqRefused(
        f"no rate of the device ({has} Hz) is a whole multiple of it",
        where=device,
        field="sample_rate_hz",
        value=bench_hz,
        allowed=", ".join(f"{rate:.6g}" for rate in near) + " Hz" if near else "a lower rate",
    )

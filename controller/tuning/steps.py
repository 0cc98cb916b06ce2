"""Step responses of transfer functions that need not be rational."""

import math
from collections.abc import Callable

import numpy as np

from vibrolock.arrays import Complex, Float


def step_response(
    transfer: Callable[[Complex], Complex], end_s: float, n: int = 2048, *, highest_rad_s: float = math.inf
) -> tuple[Float, Float]:
    """Return times [n] up to ``end_s`` and the response of a stable transfer function to a unit step.

    The Laplace transform is inverted along a vertical line, as a Fourier series of period ``4 end_s`` (Dubner and Abate,
    1968), on a grid eight times finer than the output. Lanczos's factors reduce the ringing of the truncated series; a jump is
    smeared over a few of the fine steps. The transfer function is faded out around ``highest_rad_s``, above which it is not
    trusted.
    """
    period, fine = 4.0 * end_s, 32 * n
    shift = math.log(1e6) / period
    order = np.arange(fine // 2 + 1)
    s = np.asarray(shift + 2j * np.pi / period * order, np.complex128)
    fading = np.clip(
        3.0 - 2.0 * s.imag / highest_rad_s, 0.0, 2.0
    )  # 2 up to 0.5 highest_rad_s, 0 from 1.5 highest_rad_s
    taper = np.sinc(2.0 * order / fine) * np.sin(0.25 * np.pi * fading) ** 2
    kept = np.flatnonzero(taper)  # what is faded out is not evaluated
    spectrum = np.zeros(order.size, np.complex128)
    spectrum[kept] = transfer(s[kept]) / s[kept] * taper[kept]
    damped = np.fft.irfft(spectrum, fine)[: fine // 4 : 8]
    time = np.asarray(np.arange(n) * (end_s / n), np.float64)
    return time, np.asarray(damped * (fine / period) * np.exp(shift * time), np.float64)


def settling_s(time_s: Float, error: Float, within: float) -> float:
    """Return the time (s) after which ``|error|`` stays within a bound; infinite if it does not."""
    outside = np.flatnonzero(np.abs(error) > within)
    if outside.size == 0:
        return 0.0
    last = int(outside[-1]) + 1
    return float(time_s[last]) if last < time_s.size else math.inf

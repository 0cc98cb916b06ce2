"""Step responses of transfer functions that need not be rational."""

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

__all__ = ["settling_s", "step_response"]

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]


def step_response(transfer: Callable[[Complex], Complex], end_s: float, n: int = 2048) -> tuple[Real, Real]:
    """Times [n] up to ``end_s`` and the response of a stable transfer function to a unit step.

    Inversion of the Laplace transform along a vertical line, as a Fourier series of period ``2 end_s`` (Dubner and Abate,
    1968), eight times finer than the output; exact to about 1e-4 of the final value where the response has no jump.
    """
    period, fine = 2.0 * end_s, 16 * n
    shift = math.log(1e6) / period
    s = shift + 2j * np.pi / period * np.arange(fine // 2 + 1)
    time = period / fine * np.arange(fine)
    response = np.fft.irfft(transfer(s) / s, fine) * fine / period * np.exp(shift * time)
    return time[: fine // 2 : 8], response[: fine // 2 : 8]


def settling_s(time_s: Real, error: Real, within: float) -> float:
    """Time after which ``|error|`` stays within a bound; infinite where it does not."""
    outside = np.flatnonzero(np.abs(error) > within)
    if outside.size == 0:
        return 0.0
    last = int(outside[-1]) + 1
    return float(time_s[last]) if last < time_s.size else math.inf

"""Effect of a converter's rounding on Fourier coefficients.

A sample is rounded to a whole number of steps q. Over a settled vibration the rounding error ``e(x)`` repeats with the
period, so that more periods do not average it out. Noise ahead of the converter does: under Gaussian noise of standard
deviation sigma the mean of the error is (Widrow & Kollar, Quantization Noise, the expansion of the sawtooth)

    e(x) = sum_n (-1)^n q/(pi n) exp(-2 (pi n sigma/q)^2) sin(2 pi n x/q).

``G_n,h`` denotes the Fourier coefficients of ``exp(2 pi i n x(theta)/q)``. If the position of the vibration between two steps
is unknown, harmonic h has an error of variance ``sum_n (q/(pi n))^2 exp(-4 (pi n sigma/q)^2) (|G_n,h|^2 + |G_n,-h|^2)``, half
of it in each of its two parts. With noise above about half a step the error vanishes.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

__all__ = ["rounding_errors"]

Complex = NDArray[np.complex128]
Float = NDArray[np.float64]

_INSTANTS = 16384  # per period: enough for vibrations of some hundred steps, beyond which the error is negligible
_ORDERS = 6
_NEGLIGIBLE = 1e-3


def rounding_errors(harmonics: Complex, resolution: Float, residual_rms: Float) -> Float:
    """Standard error of the real and of the imaginary part of each coefficient due to rounding.

    Parameters
    ----------
    harmonics
        complex[n_channels, H + 1], as measured.
    resolution
        float[n_channels], step q of the converter in the unit of the channel; 0 for none.
    residual_rms
        float[n_channels], RMS residual of the harmonics: noise plus the rounding's own variance ``q^2/12``.

    Returns
    -------
    float[n_channels, H + 1]
    """
    out = np.zeros(harmonics.shape)
    orders = np.arange(harmonics.shape[1])
    turns = _turns(orders.size - 1)
    for row in np.flatnonzero(resolution > 0.0):
        step = resolution[row]
        noise = max((residual_rms[row] / step) ** 2 - 1.0 / 12.0, 0.0)
        sizes: list[float] = []
        for order in range(1, _ORDERS + 1):
            size = step / (np.pi * order) * np.exp(-2.0 * (np.pi * order) ** 2 * noise)
            if size < _NEGLIGIBLE * step:
                break
            sizes.append(size)
        if not sizes:
            continue
        position = np.real(turns @ harmonics[row, 1:]) / step
        first = np.exp(2j * np.pi * position)
        turn = np.ones_like(first)
        variance = np.zeros(orders.size)
        for size in sizes:
            turn = turn * first
            spectrum = np.fft.fft(turn)
            above, below = (np.abs(spectrum[side] / _INSTANTS) ** 2 for side in (orders, -orders))
            variance += size**2 * 0.5 * (above + below)
        variance[0] *= 0.5
        out[row] = np.sqrt(variance)
    return out


@lru_cache(maxsize=4)
def _turns(harmonics: int) -> Complex:
    """complex[_INSTANTS, H]: the harmonics 1..H over one period, of size 1."""
    turns = np.exp(2j * np.pi * np.outer(np.arange(_INSTANTS) / _INSTANTS, np.arange(1, harmonics + 1)))
    turns.setflags(write=False)
    return np.asarray(turns)

"""Effect of a converter's rounding on Fourier coefficients.

A sample is rounded to a whole number of steps q. Over a settled vibration the rounding error ``e(x)`` repeats with the
period, so that neither more periods nor another run average it out. Noise ahead of the converter does: under Gaussian noise of
standard deviation sigma the mean of the error is (Widrow & Kollar, Quantization Noise, the expansion of the sawtooth)

    e(x) = sum_n (-1)^n q/(pi n) exp(-2 (pi n sigma/q)^2) sin(2 pi n x/q).

With noise above about half a step it vanishes. Its coefficients depend on where the vibration stands between two steps and on
its size to a fraction of a step. Neither is known well enough to correct for it: their variance is taken over sizes within one
step, and over the two positions in which odd and even harmonics have the largest error (the mean on a step, which is that of an
AC-coupled sensor, and a quarter of a step above). The error of a vibration that is nearly a sine is in phase with the fundamental: it
is one of the amplitude, not of the phase. Both parts are therefore stated by themselves.
"""

import numpy as np
from numpy.typing import NDArray

__all__ = ["part_of_each", "rounding_errors"]

Complex = NDArray[np.complex128]
Float = NDArray[np.float64]

_INSTANTS = (512, 16384)
"""Least and largest number of instants in a period: enough for vibrations of some hundred steps, beyond which the error is
negligible."""
_PER_STEP = 48
"""Instants in a period for each step of the amplitude and each term of the sawtooth."""
_ORDERS = 6
_NEGLIGIBLE = 1e-3
_SIZES = (-0.375, -0.125, 0.125, 0.375)
"""Changes of the peak of the vibration in steps: one step in all."""


def rounding_errors(harmonics: Complex, resolution: Float, noise_rms: Float) -> Complex:
    """Standard errors of each coefficient due to rounding: in phase with the coefficient (real), in quadrature (imaginary).

    Parameters
    ----------
    harmonics
        complex[n_channels, H + 1], as measured.
    resolution
        float[n_channels], step q of the converter in the unit of the channel; 0 for none.
    noise_rms
        float[n_channels], RMS of the noise ahead of the converter.

    Returns
    -------
    complex[n_channels, H + 1]
    """
    out = np.zeros(harmonics.shape, np.complex128)
    for row in np.flatnonzero(resolution > 0.0):
        sizes = _sizes(noise_rms[row] / resolution[row])
        if sizes:
            out[row] = resolution[row] * _of_a_channel(harmonics[row] / resolution[row], sizes)
    return out


def part_of_each(rounding: Complex) -> Float:
    """Standard error of the real and of the imaginary part alike, if the phase of the coefficient is not told apart."""
    return np.asarray(np.abs(rounding) / np.sqrt(2.0))


def _sizes(noise_steps: float) -> list[float]:
    """Sizes of the terms of the mean error in steps, with their signs, as long as they matter."""
    sizes: list[float] = []
    for order in range(1, _ORDERS + 1):
        size = np.exp(-2.0 * (np.pi * order * noise_steps) ** 2) / (np.pi * order)
        if size < _NEGLIGIBLE:
            break
        sizes.append(float((-1) ** order * size))
    return sizes


def _of_a_channel(steps: Complex, sizes: list[float]) -> Complex:
    """complex[H + 1]: standard errors in steps of a channel whose harmonics are given in steps."""
    orders = np.arange(steps.size)
    bound = float(np.sum(np.abs(steps[1:]))) + 1.0
    instants = int(np.clip(2 ** np.ceil(np.log2(_PER_STEP * bound * len(sizes))), *_INSTANTS))
    turns = np.exp(2j * np.pi * np.outer(np.arange(instants) / instants, orders[1:]))
    position = np.real(turns @ steps[1:])
    peak = max(float(np.max(np.abs(position))), 1e-9)
    unit = np.divide(steps, np.abs(steps), out=np.ones_like(steps), where=steps != 0.0)
    squares = np.zeros((2, steps.size))
    for change in _SIZES:
        first = np.exp(2j * np.pi * max(1.0 + change / peak, 0.0) * position)
        for offset in (1.0, 1j):  # the mean on a step, and a quarter of a step above
            turn, error = np.ones_like(first), np.zeros(instants)
            for size in sizes:
                turn = turn * first * offset
                error += size * turn.imag
            found = np.fft.rfft(error)[: steps.size] * (2.0 / instants)
            found[0] *= 0.5
            along = found * np.conj(unit)
            squares += [along.real**2 / len(_SIZES), along.imag**2 / len(_SIZES)]
    return np.asarray(np.sqrt(squares[0]) + 1j * np.sqrt(squares[1]))

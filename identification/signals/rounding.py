"""Effect of a converter's rounding on Fourier coefficients.

A sample is rounded to a whole number of steps q. Over a settled vibration the rounding error ``e(x)`` repeats with the
period, so that neither more periods nor another run average it out. Noise ahead of the converter does: under Gaussian noise of
standard deviation sigma the mean of the error is (Widrow & Kollar, Quantization Noise, the expansion of the sawtooth)

    e(x) = sum_n (-1)^n q/(pi n) exp(-2 (pi n sigma/q)^2) sin(2 pi n x/q).

With noise above about half a step it vanishes. What is left of it in a coefficient is the sum over the samples: that over the
period, and what a rate of nearly a whole number of samples in a few periods leaves, as the same instants of the period are
then read again and again. Both depend on where the vibration stands between two steps and on its size to a fraction of a step.
Neither is known well enough to correct for it. The variance is the sum of those at the two positions in which odd and even
harmonics have the largest error (the mean on a step, which is that of an AC-coupled sensor, and a quarter of a step above),
and the largest of three sizes that are a quarter of a step apart. The error of a vibration that is nearly a sine is in phase
with the fundamental: it is one of the amplitude, not of the phase. Both parts are therefore stated by themselves.
"""

import numpy as np
from numpy.typing import NDArray

__all__ = ["JUDGED", "part_of_each", "rounding_errors"]

Complex = NDArray[np.complex128]
Float = NDArray[np.float64]

JUDGED = 16384
"""Number of samples of a record from which its rounding is judged; a longer record has no more of it."""
_ORDERS = 6
_NEGLIGIBLE = 1e-3
_SIZES = (-0.25, 0.0, 0.25)
"""Changes of the peak of the vibration in steps."""
_SPREAD = np.sqrt(0.5)
"""Standard deviation of a sine of unknown phase over its largest value, as the error is over the size of the vibration. The
part in quadrature depends on the shape besides, and is not reduced."""


def rounding_errors(theta_rad: Float, harmonics: Complex, resolution: Float, noise_rms: Float) -> Complex:
    """Standard errors of each coefficient due to rounding: in phase with the coefficient (real), in quadrature (imaginary).

    Parameters
    ----------
    theta_rad
        float[n], phase of the vibration at every sample, whole periods.
    harmonics
        complex[n_channels, H + 1], as measured; all that are a hundredth of a step or more.
    resolution
        float[n_channels], step q of the converter in the unit of the channel; 0 for none.
    noise_rms
        float[n_channels], RMS of the noise ahead of the converter.

    Returns
    -------
    complex[n_channels, H + 1]
    """
    out = np.zeros(harmonics.shape, np.complex128)
    orders = np.arange(harmonics.shape[1])
    turns = np.exp(1j * np.outer(orders, theta_rad if np.any(resolution > 0.0) else theta_rad[:0]))
    for row in np.flatnonzero(resolution > 0.0):
        sizes = _sizes(noise_rms[row] / resolution[row])
        if sizes:
            out[row] = resolution[row] * _of_a_channel(harmonics[row] / resolution[row], sizes, turns)
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


def _of_a_channel(steps: Complex, sizes: list[float], turns: Complex) -> Complex:
    """complex[H + 1]: standard errors in steps of a channel whose harmonics are given in steps.

    ``turns``, complex[H + 1, n], are the harmonics of size 1 at every sample.
    """
    position = np.real(steps[1:] @ turns[1:])
    peak = max(float(np.max(np.abs(position))), 1e-9)
    unit = np.divide(steps, np.abs(steps), out=np.ones_like(steps), where=steps != 0.0)
    largest = np.zeros((2, steps.size))
    for change in _SIZES:
        squares = np.zeros((2, steps.size))
        first = np.exp(2j * np.pi * max(1.0 + change / peak, 0.0) * position)
        for offset in (1.0, 1j):  # the mean on a step, and a quarter of a step above
            turn, error = np.ones_like(first), np.zeros(position.size)
            for size in sizes:
                turn = turn * first * offset
                error += size * turn.imag
            found = (turns @ error).conj() * (2.0 / error.size)
            found[0] *= 0.5
            along = found * np.conj(unit)
            squares += [along.real**2, along.imag**2]
        largest = np.maximum(largest, squares)
    return np.asarray(_SPREAD * np.sqrt(largest[0]) + 1j * np.sqrt(largest[1]))

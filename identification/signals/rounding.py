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

from vibrolock.arrays import Complex, Float

JUDGED = 16384
"""Number of samples of a record from which its rounding is judged; a longer record has no more of it."""
_ORDERS = 6
"""Orders of the harmonics of rounding that are summed, at most. Chosen."""
_NEGLIGIBLE = 1e-3
"""Size of a harmonic of rounding, in steps of the converter, below which the sum ends. Chosen."""
_SIZES = (-0.25, 0.0, 0.25)
"""Changes of the peak of the vibration in steps."""
_SPREAD = np.sqrt(0.5)
"""Standard deviation of a sine of unknown phase over its largest value, as the error is over the size of the vibration. The
part in quadrature depends on the shape besides, and is not reduced."""


def turns_of(theta_rad: Float, highest: int) -> Complex:
    """complex[highest + 1, n]: ``exp(i h theta)`` of the harmonics from 0 up, each from two lower ones."""
    turns = np.empty((highest + 1, theta_rad.size), np.complex128)
    turns[0] = 1.0
    if highest:
        turns[1] = np.exp(1j * theta_rad)
    for order in range(2, highest + 1):
        np.multiply(turns[order // 2], turns[order - order // 2], out=turns[order])
    return turns


def rounding_errors(
    theta_rad: Float, harmonics: Complex, resolution: Float, noise_rms: Float, wanted: int | None = None
) -> Complex:
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
    wanted
        Highest harmonic W whose error is wanted; H if None.

    Returns
    -------
    complex[n_channels, W + 1]
    """
    highest = harmonics.shape[1] - 1
    wanted = highest if wanted is None else wanted
    out = np.zeros((harmonics.shape[0], wanted + 1), np.complex128)
    sizes = {row: _sizes(noise_rms[row] / resolution[row]) for row in np.flatnonzero(resolution > 0.0)}
    rounded = [row for row, terms in sizes.items() if terms]
    if rounded:
        turns = turns_of(theta_rad, highest)
        steps = harmonics[rounded] / resolution[rounded, None]
        for row, of_channel, position in zip(rounded, steps, np.real(steps[:, 1:] @ turns[1:]), strict=True):
            out[row] = resolution[row] * _of_a_channel(
                of_channel[: wanted + 1], position, sizes[row], turns[: wanted + 1]
            )
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


def _of_a_channel(steps: Complex, position: Float, sizes: list[float], turns: Complex) -> Complex:
    """complex[W + 1]: standard errors in steps of a channel whose harmonics and position over time are given in steps.

    ``turns``, complex[W + 1, n], are the harmonics of size 1 at every sample.
    """
    peak = max(float(np.max(np.abs(position))), 1e-9)
    unit = np.divide(steps, np.abs(steps), out=np.ones_like(steps), where=steps != 0.0)
    errors = np.zeros((2 * len(_SIZES), position.size))
    for change, (on_a_step, between) in zip(_SIZES, errors.reshape(len(_SIZES), 2, -1), strict=True):
        turn = first = np.exp(2j * np.pi * max(1.0 + change / peak, 0.0) * position)
        for order, size in enumerate(sizes, 1):
            if order > 1:
                turn = turn * first
            on_a_step += size * turn.imag
            # A quarter of a step above, the turn of this order is i^n times as far.
            between += (size, size, -size, -size)[order % 4] * (turn.real if order % 2 else turn.imag)
    found = (turns @ errors.T).conj() * (2.0 / position.size)
    found[0] *= 0.5
    along = (found * np.conj(unit)[:, None]).reshape(steps.size, len(_SIZES), 2)
    in_phase, across = (np.max(np.sum(part**2, axis=2), axis=1) for part in (along.real, along.imag))
    return np.asarray(_SPREAD * np.sqrt(in_phase) + 1j * np.sqrt(across))

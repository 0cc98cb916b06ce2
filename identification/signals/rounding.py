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
_BLOCK = 1024
"""Samples that are evaluated at once. Chosen: the errors of so many fit the cache of a core."""
_ORDERS = 6
"""Orders of the harmonics of rounding that are summed, at most. Chosen."""
_NEGLIGIBLE = 1e-3
"""Size of a harmonic of rounding, in steps of the converter, below which the sum ends. Chosen."""
_SIZES = (-0.25, 0.0, 0.25)
"""Changes of the peak of the vibration in steps."""
_SPREAD = np.sqrt(0.5)
"""Standard deviation of a sine of unknown phase over its largest value, as the error is over the size of the vibration. The
part in quadrature depends on the shape besides, and is not reduced."""


def rounding_errors(
    turns: Float, harmonics: Complex, resolution: Float, noise_rms: Float, wanted: int | None = None
) -> Complex:
    """Standard errors of each coefficient due to rounding: in phase with the coefficient (real), in quadrature (imaginary).

    Parameters
    ----------
    turns
        float[2, H + 1, n], `identification.signals.turns.turns_of` the phase at every sample, whole periods.
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
    has_steps = np.flatnonzero(resolution > 0.0)
    terms = _terms(noise_rms[has_steps] / resolution[has_steps])
    rounded, terms = has_steps[terms[0] != 0.0], terms[:, terms[0] != 0.0]
    if rounded.size:
        steps = harmonics[rounded] / resolution[rounded, None]
        factors = np.hstack([steps.real, steps.imag])
        position = factors[:, 1:] @ turns.reshape(factors.shape[1], -1)[1:]  # without its mean
        found = _coefficients(turns[:, : wanted + 1], position, terms)
        out[rounded] = resolution[rounded, None] * _largest(found, steps[:, : wanted + 1])
    return out


def part_of_each(rounding: Complex) -> Float:
    """Standard error of the real and of the imaginary part alike, if the phase of the coefficient is not told apart."""
    return np.asarray(np.abs(rounding) / np.sqrt(2.0))


def _terms(noise_steps: Float) -> Float:
    """float[orders, n_channels]: terms of the mean error in steps, with their signs, as long as they matter; then 0."""
    orders = np.arange(1.0, _ORDERS + 1)[:, None]
    sizes = np.exp(-2.0 * (np.pi * orders * noise_steps) ** 2) / (np.pi * orders)
    return np.asarray(np.where(sizes < _NEGLIGIBLE, 0.0, (-1.0) ** orders * sizes))


def _coefficients(turns: Float, position: Float, terms: Float) -> Complex:
    """complex[n_channels, sizes, 2, W + 1]: Fourier coefficients of the error in steps, on a step and a quarter above.

    ``position``, float[n_channels, n], is the vibration in steps.
    """
    peak = np.maximum(np.max(np.abs(position), axis=1), 1e-9)
    sizes = np.maximum(1.0 + np.divide.outer(np.array(_SIZES), peak), 0.0)
    sums = np.zeros((2 * sizes.size, 2 * turns.shape[1]))
    for start in range(0, position.shape[1], _BLOCK):
        block = slice(start, start + _BLOCK)
        cosine, sine = _cosine_and_sine(sizes[..., None] * position[:, block])
        # A quarter of a step above, the turn is a quarter farther.
        errors = np.stack([_sine_series(cosine, sine, terms), _sine_series(-sine, cosine, terms)])
        sums += errors.reshape(sums.shape[0], -1) @ turns[:, :, block].reshape(sums.shape[1], -1).T
    found = (2.0 / position.shape[1]) * (sums[:, : turns.shape[1]] + 1j * sums[:, turns.shape[1] :])
    found[:, 0] *= 0.5
    return np.asarray(np.moveaxis(found.reshape(2, *sizes.shape, -1), 2, 0).swapaxes(1, 2))


def _cosine_and_sine(turns: Float) -> tuple[Float, Float]:
    """Cosine and sine of a number of turns: the sine of a quarter of the angle, within an eighth of a turn, gives both."""
    sine = np.sin(0.5 * np.pi * (turns - np.rint(turns)))
    squared = 2.0 * sine * sine
    sine_of_half, cosine_of_half = 2.0 * sine * np.sqrt(1.0 - 0.5 * squared), 1.0 - squared
    return 1.0 - 2.0 * sine_of_half**2, 2.0 * sine_of_half * cosine_of_half


def _sine_series(cosine: Float, sine: Float, terms: Float) -> Float:
    """``sum_n terms[n - 1] sin(n x)`` from cosine and sine of x (Clenshaw); ``terms`` is float[orders, n_channels]."""
    double = 2.0 * cosine
    above, last = np.zeros_like(cosine), np.zeros_like(cosine) + terms[-1, :, None]
    for term in terms[-2::-1, :, None]:
        np.subtract(term, above, out=above)
        above += double * last
        above, last = last, above
    last *= sine
    return last


def _largest(found: Complex, steps: Complex) -> Complex:
    """complex[n_channels, W + 1]: standard errors in steps from those of each size, in phase and in quadrature."""
    unit = np.divide(steps, np.abs(steps), out=np.ones_like(steps), where=steps != 0.0)
    along = found * np.conj(unit)[:, None, None]
    in_phase, across = (np.max(np.sum(part**2, axis=2), axis=1) for part in (along.real, along.imag))
    return np.asarray(_SPREAD * np.sqrt(in_phase) + 1j * np.sqrt(across))

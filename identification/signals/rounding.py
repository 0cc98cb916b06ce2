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

from collections.abc import Callable
from functools import cache

import numpy as np

from vibrolock.arrays import Complex, Float
from vibrolock.compiled import kernel

JUDGED = 16384
"""Number of samples of a record from which its rounding is judged; a longer record has no more of it."""
_BLOCK = 2048
"""Samples that are evaluated at once. Chosen: the errors of so many fit the cache of a core."""
_ORDERS = 6
"""Orders of the harmonics of rounding that are summed, at most. Chosen."""
_NEGLIGIBLE = 1e-3
"""Size of a harmonic of rounding, in steps of the converter, below which the sum ends. Chosen."""
_SIZES = np.array([-0.25, 0.0, 0.25])
"""Changes of the peak of the vibration in steps."""
_ODD = np.array([[1.0, -1.0, 1.0], [0.0, 4.0, -12.0], [0.0, 0.0, 16.0]])
_EVEN = np.array([[2.0, -4.0, 6.0], [0.0, 8.0, -32.0], [0.0, 0.0, 32.0]])
"""``sin(n x)/sin(x)`` for n = 1, 3, 5, and that over cos(x) for n = 2, 4, 6: factors of 1, cos(x)^2, cos(x)^4 in columns."""
_ROUNDS = 1.5 * 2.0**52
"""Added and subtracted again it leaves the nearest whole number (below 2^51), in vectors on any processor."""
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
    """complex[n_channels, 2, sizes, W + 1]: Fourier coefficients of the error in steps, on a step and a quarter above.

    ``position``, float[n_channels, n], is the vibration in steps.
    """
    peak = np.maximum(np.max(np.abs(position), axis=1), 1e-9)
    sizes = np.maximum(1.0 + np.multiply.outer(1.0 / peak, _SIZES), 0.0)
    factors = [_in_cosine(sines) for sines in terms.T]
    half_angle = _half_angle()
    sums = np.zeros((2, position.shape[0] * 2 * len(_SIZES), turns.shape[1]))
    for start in range(0, position.shape[1], _BLOCK):
        block = slice(start, start + _BLOCK)
        errors = np.empty((position.shape[0], 2, len(_SIZES), position[0, block].size))
        for scale, where, known, out in zip(sizes, position[:, block], factors, errors, strict=True):
            mean_errors(where, scale, *half_angle, *known, out)
        sums += errors.reshape(sums.shape[1], -1) @ turns[:, :, block].transpose(0, 2, 1)
    cosines, sines = sums.reshape(2, *errors.shape[:-1], -1)
    found = (2.0 / position.shape[1]) * (cosines + 1j * sines)
    found[..., 0] *= 0.5
    return np.asarray(found)


def _in_cosine(terms: Float) -> tuple[Float, Float]:
    """Coefficients of P and Q in ``sum_n terms[n - 1] sin(n x) = sin(x) (P(c^2) + c Q(c^2))``, c = cos(x); three each."""
    return _ODD @ terms[::2], _EVEN @ terms[1::2]


@kernel
def mean_errors(
    where: Float, scale: Float, for_sine: Float, for_cosine: Float, odd: Float, even: Float, out: Float
) -> None:
    """Put the mean errors at ``where`` times each ``scale``, in steps, and those a quarter of a step farther, into ``out``.

    ``where`` float[n], ``out`` float[2, n_scales, n]; the other arguments are those of `_half_angle` and `_in_cosine`.
    """
    s0, s1, s2, s3, s4, s5, s6 = for_sine
    c0, c1, c2, c3, c4, c5, c6, c7 = for_cosine
    p0, p1, p2 = odd
    q0, q1, q2 = even
    for j in range(scale.size):
        factor = scale[j]
        for k in range(where.size):
            turns = factor * where[k]
            turns -= (turns + _ROUNDS) - _ROUNDS
            x = turns * turns
            half = ((((((s6 * x + s5) * x + s4) * x + s3) * x + s2) * x + s1) * x + s0) * turns
            other = ((((((c7 * x + c6) * x + c5) * x + c4) * x + c3) * x + c2) * x + c1) * x + c0
            cosine, sine = 1.0 - 2.0 * (half * half), 2.0 * (other * half)
            at, across = cosine * cosine, sine * sine
            out[0, j, k] = sine * ((p2 * at + p1) * at + p0 + ((q2 * at + q1) * at + q0) * cosine)
            out[1, j, k] = cosine * ((p2 * across + p1) * across + p0 - ((q2 * across + q1) * across + q0) * sine)


@cache
def _half_angle() -> tuple[Float, Float]:
    """Polynomials in the square of a number of turns u up to a half: ``sin(pi u)/u`` and ``cos(pi u)``, to 1e-13."""
    return _fitted(lambda squared: np.pi * np.sinc(np.sqrt(squared)), 6), _fitted(
        lambda squared: np.cos(np.pi * np.sqrt(squared)), 7
    )


def _fitted(function: Callable[[Float], Float], degree: int) -> Float:
    fit = np.polynomial.Chebyshev.interpolate(function, degree, domain=(0.0, 0.25))
    return np.asarray(fit.convert(kind=np.polynomial.Polynomial).coef)


def _largest(found: Complex, steps: Complex) -> Complex:
    """complex[n_channels, W + 1]: standard errors in steps from those of each size, in phase and in quadrature."""
    unit = np.divide(steps, np.abs(steps), out=np.ones_like(steps), where=steps != 0.0)
    along = found * np.conj(unit)[:, None, None]
    in_phase, across = (np.max(np.sum(part**2, axis=1), axis=1) for part in (along.real, along.imag))
    return np.asarray(_SPREAD * np.sqrt(in_phase) + 1j * np.sqrt(across))

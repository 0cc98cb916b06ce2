"""Compiled adaptive filter: estimates the mean and several harmonics of a signal at once.

It is a least-mean-squares filter (Hippold et al. 2024).
Arrays are complex128. Entry 0 is the mean, entry h is harmonic h, up to H = ``harmonics``; an array may be longer.
"""

import math

import numpy as np

from vibrolock.compiled import kernel

MOST_HARMONICS = 12
"""Highest harmonic that an adaptive filter may follow."""


@kernel
def turn_phasors(phasors: np.ndarray, harmonics: int, cos_theta: float, sin_theta: float) -> None:
    """Fill ``phasors`` with ``exp(i h theta)``."""
    phasors[0] = 1.0
    turn = complex(cos_theta, sin_theta)
    for order in range(1, harmonics + 1):
        phasors[order] = phasors[order - 1] * turn


@kernel
def adapt(coefficients: np.ndarray, phasors: np.ndarray, harmonics: int, value: float, gain: float) -> None:
    """Update the estimates of the mean and all harmonics with one sample of the signal.

    ``y_hat = Re sum C_h exp(i h theta)``, ``C_h <- C_h + 2 gain exp(-i h theta) (y - y_hat)``; the mean takes half the step.
    On average every C_h follows the signal's Y_h through a first-order low-pass with ``gain = 1 - exp(-w_LP dt)``. Only
    harmonics above H cause ripple.
    """
    error = value - coefficients[0].real
    for order in range(1, harmonics + 1):
        c, p = coefficients[order], phasors[order]
        error -= c.real * p.real - c.imag * p.imag
    coefficients[0] += gain * error
    step = 2.0 * gain * error
    for order in range(1, harmonics + 1):
        p = phasors[order]
        coefficients[order] += complex(step * p.real, -step * p.imag)


@kernel
def root_mean_square(coefficients: np.ndarray, harmonics: int) -> float:
    """Return the root mean square of all harmonics of an adaptive filter, without the mean."""
    total = 0.0
    for order in range(1, harmonics + 1):
        c = coefficients[order]
        total += c.real * c.real + c.imag * c.imag
    return math.sqrt(0.5 * total)

"""Compiled demodulation: from samples to complex amplitudes, and from these to a lag."""

import math

import numpy as np

from vibrolock.compiled import kernel


@kernel
def demodulate(estimate: complex, value: float, cos_theta: float, sin_theta: float, gain: float) -> complex:
    """Two-phase (synchronous) demodulation: low-passed ``2 y exp(-i theta)``, which settles on Y_1.

    Passes a ripple at 2 Omega of relative size a/(2 Omega), and harmonics h of y likewise at (h +- 1) Omega.
    """
    return complex(
        estimate.real + gain * (2.0 * value * cos_theta - estimate.real),
        estimate.imag + gain * (-2.0 * value * sin_theta - estimate.imag),
    )


@kernel
def turn_phasors(phasors: np.ndarray, cos_theta: float, sin_theta: float) -> None:
    """Fill ``phasors`` (complex128[H+1]) with ``exp(i h theta)``."""
    phasors[0] = 1.0
    turn = complex(cos_theta, sin_theta)
    for order in range(1, phasors.size):
        phasors[order] = phasors[order - 1] * turn


@kernel
def adapt(coefficients: np.ndarray, phasors: np.ndarray, value: float, gain: float) -> None:
    """Adaptive filter (least mean squares; Hippold et al. 2024): one step towards all harmonics and the mean at once.

    ``y_hat = Re sum C_h exp(i h theta)``, ``C_h <- C_h + 2 gain exp(-i h theta) (y - y_hat)``, the mean with half the step.
    On average every C_h follows its Y_h through the first-order low-pass of ``gain = 1 - exp(-w_LP dt)``; what the model
    holds makes no ripple, only harmonics beyond H do.
    """
    error = value - coefficients[0].real
    for order in range(1, coefficients.size):
        c, p = coefficients[order], phasors[order]
        error -= c.real * p.real - c.imag * p.imag
    coefficients[0] += gain * error
    step = 2.0 * gain * error
    for order in range(1, coefficients.size):
        p = phasors[order]
        coefficients[order] += complex(step * p.real, -step * p.imag)


@kernel
def root_mean_square(coefficients: np.ndarray) -> float:
    """Root mean square of all harmonics of an adaptive filter, without the mean."""
    total = 0.0
    for order in range(1, coefficients.size):
        c = coefficients[order]
        total += c.real * c.real + c.imag * c.imag
    return math.sqrt(0.5 * total)


@kernel
def sign_product(force: float, acceleration: float) -> float:
    """Sign detector: sign(force) sign(displacement-like signal), the acceleration's sign reversed standing for displacement.

    For two sines its mean is ``(2/pi) e`` with the phase error e to phase resonance. Harmonics of either signal move
    the zero crossings and bias it.
    """
    if force == 0.0 or acceleration == 0.0:
        return 0.0
    return -1.0 if (force > 0.0) == (acceleration > 0.0) else 1.0


@kernel
def phase_lag(force: complex, response: complex) -> float:
    """Phase lag ``arg F_1 - arg Y_1`` in rad, in [-pi, pi)."""
    product = force * complex(response.real, -response.imag)
    return math.atan2(product.imag, product.real)

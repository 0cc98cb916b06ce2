"""Truncated Fourier series in real coefficients: samples of a period, and phase shifts.

``y(theta) = c_0 + sum_h a_h cos(h theta) + b_h sin(h theta) = Re sum_h Y_h exp(i h theta)`` with ``Y_h = a_h - i b_h``; the
coefficients are ordered ``c_0, a_1, b_1, a_2, b_2, ...``.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from vibrolock.arrays import Complex, Float


@dataclass(frozen=True)
class Basis:
    """Fourier series of ``harmonics`` harmonics and a static term, over ``samples`` samples of a period."""

    harmonics: int
    samples: int

    @property
    def size(self) -> int:
        """Number of coefficients."""
        return 2 * self.harmonics + 1

    @cached_property
    def number(self) -> NDArray[np.int64]:
        """int[size]: harmonic number of each coefficient."""
        return (np.arange(self.size) + 1) // 2

    @cached_property
    def to_time(self) -> Float:
        """T, float[samples, size]: transform from coefficients to samples."""
        return self.at(2.0 * np.pi * np.arange(self.samples) / self.samples)

    @cached_property
    def to_coefficients(self) -> Float:
        """T^+, float[size, samples]: transform from samples to coefficients; exact if no harmonic aliases."""
        return np.asarray(self.to_time.T * np.where(self.number == 0, 1.0, 2.0)[:, None] / self.samples)

    @cached_property
    def products(self) -> Float:
        """float[size^2, samples]: matrix whose product with s is ``T^+ diag(s) T``."""
        both = self.to_coefficients[:, None, :] * self.to_time.T[None]
        return np.ascontiguousarray(both.reshape(self.size**2, self.samples))

    def at(self, phase_rad: Float) -> Float:
        """float[n, size]: values of each basis function at phases."""
        angle = np.asarray(phase_rad)[:, None] * self.number
        cosine = (np.arange(self.size) % 2 == 1) | (self.number == 0)
        return np.where(cosine, np.cos(angle), np.sin(angle))

    def turned(self, angle_rad: float) -> tuple[Float, Float]:
        """Return R, float[size, size], which shifts coefficients to ``y(theta + angle)``, and its derivative by the angle."""
        turn, slope = np.zeros((self.size, self.size)), np.zeros((self.size, self.size))
        turn[0, 0] = 1.0
        for h in range(1, self.harmonics + 1):
            c, s, here = np.cos(h * angle_rad), np.sin(h * angle_rad), slice(2 * h - 1, 2 * h + 1)
            turn[here, here] = [[c, s], [-s, c]]
            slope[here, here] = [[-h * s, h * c], [-h * c, -h * s]]
        return turn, slope


def harmonics_of(coefficients: Float) -> Complex:
    """complex[H + 1, ...]: complex harmonics of real coefficients [2 H + 1, ...]."""
    return np.concatenate([coefficients[:1].astype(complex), coefficients[1::2] - 1j * coefficients[2::2]])


def real_coefficients(harmonics: Complex) -> Float:
    """float[2 H + 1, ...]: real coefficients of complex harmonics, the inverse of `harmonics_of`."""
    out = np.empty((2 * len(harmonics) - 1, *harmonics.shape[1:]))
    out[0], out[1::2], out[2::2] = harmonics[0].real, harmonics[1:].real, -harmonics[1:].imag
    return out


def complex_product(factor: Complex) -> Float:
    """float[..., 2, 2]: matrix that acts on (a, b) as the complex factor acts on ``a - i b``."""
    p, q = np.real(factor), np.imag(factor)
    return np.stack([np.stack([p, q], axis=-1), np.stack([-q, p], axis=-1)], axis=-2)

"""Fourier series: real coefficients, samples over a period, complex harmonics."""

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

__all__ = ["Series"]

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]


class Series:
    """Series ``y(theta) = Re sum_h Y_h exp(i h theta)`` up to harmonic H, sampled N times over a period.

    Its real coefficients are ``[Y_0, Re Y_1 ... Re Y_H, Im Y_1 ... Im Y_H]``, P = 2 H + 1 of them.
    """

    def __init__(self, harmonics: int, samples: int) -> None:
        self.harmonics = harmonics
        self.samples = samples
        self.size = 2 * harmonics + 1
        self.orders = np.arange(harmonics + 1)

    @cached_property
    def basis(self) -> Real:
        """Samples from coefficients [N, P]."""
        angles = np.outer(2.0 * np.pi * np.arange(self.samples) / self.samples, self.orders[1:])
        return np.ascontiguousarray(np.hstack([np.ones((self.samples, 1)), np.cos(angles), -np.sin(angles)]))

    @cached_property
    def projection(self) -> Real:
        """Coefficients from samples [P, N]."""
        projection = self.basis.T * (2.0 / self.samples)
        projection[0] *= 0.5
        return np.ascontiguousarray(projection)

    def to_complex(self, coefficients: Real) -> Complex:
        """Harmonics [n, H + 1, ...] from coefficients [n, P, ...]."""
        packed = coefficients[:, : self.harmonics + 1].astype(np.complex128)
        packed[:, 1:] += 1j * coefficients[:, self.harmonics + 1 :]
        return packed

    def to_real(self, harmonics: Complex) -> Real:
        """Coefficients [n, P, ...] from harmonics [n, H + 1, ...]."""
        return np.concatenate([harmonics.real, harmonics[:, 1:].imag], axis=1)

    def waveforms(self, harmonics: Complex) -> Real:
        """Samples [n, N] from harmonics [n, H + 1]."""
        return np.asarray(self.to_real(harmonics) @ self.basis.T)

"""Harmonics of a phase that advances by the same step from sample to sample.

``exp(i h (theta_0 + (B a + b) step))`` is a product of a factor of a and one of b, so that sums over n samples and signals of
harmonics are products of matrices with about sqrt(n) rows: the harmonics at each sample are never computed.
"""

import math

import numpy as np

from vibrolock.arrays import Complex, Float


class EvenPhase:
    """Phases ``first + k step`` (rad) of ``size`` samples, for harmonics from 0 up to H = ``highest``."""

    def __init__(self, first: float, step: float, size: int, highest: int) -> None:
        self.size = size
        orders = 1j * np.arange(highest + 1)
        width = math.isqrt(max(size - 1, 0)) + 1
        self._rows = -(-size // width)
        self._starts: Complex = np.exp(np.multiply.outer(first + step * width * np.arange(self._rows), orders))
        self._within: Complex = np.exp(np.multiply.outer(step * np.arange(width), orders))

    def sums(self, signal: Float) -> Complex:
        """complex[H + 1]: sums of a signal, float[size], times ``exp(-i h theta)``."""
        padded = np.zeros((self._rows, self._within.shape[0]))
        padded.reshape(-1)[: self.size] = signal
        within = (padded @ self._within.view(np.float64)).view(np.complex128)
        return np.asarray(np.conj(np.sum(self._starts * within, axis=0)))

    def signal(self, coefficients: Complex | Float) -> Float:
        """float[size]: ``Re sum_h Y_h exp(i h theta)`` of coefficients Y, complex or real [H + 1]."""
        turned = np.conj(self._starts * coefficients)
        rows = turned.view(np.float64) @ self._within.view(np.float64).T
        return np.asarray(rows.reshape(-1)[: self.size])

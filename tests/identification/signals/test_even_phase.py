"""Harmonics of a phase that advances evenly, by products of two factors."""

import numpy as np
import pytest

from identification.signals.even_phase import EvenPhase

HIGHEST = 5


@pytest.mark.parametrize("size", [1, 2, 9, 10, 30, 2001])
def test_sums_and_signals_are_those_of_the_harmonics_at_each_sample(size):
    first, step = 0.7, 0.31
    turns = np.exp(1j * np.outer(np.arange(HIGHEST + 1), first + step * np.arange(size)))
    random = np.random.default_rng(size)
    signal = random.normal(size=size)
    coefficients = random.normal(size=(HIGHEST + 1, 2)) @ np.array([1.0, 1j])
    even = EvenPhase(first, step, size, HIGHEST)
    np.testing.assert_allclose(even.sums(signal), np.conj(turns) @ signal, atol=1e-13 * size)
    np.testing.assert_allclose(even.signal(coefficients), (coefficients @ turns).real, atol=1e-12)
    np.testing.assert_allclose(even.signal(coefficients.real), coefficients.real @ turns.real, atol=1e-12)

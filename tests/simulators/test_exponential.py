"""The matrix exponential against scipy, closed forms, and itself."""

import numpy as np
import pytest
from scipy.linalg import expm

from simulators.plant.exponential import balancing, exponential


def test_it_agrees_with_scipy_on_matrices_without_scales():
    random = np.random.default_rng(3)
    for size, n in ((0.0, 3), (1e-8, 4), (0.3, 5), (4.0, 12), (30.0, 6)):
        matrix = size * random.normal(size=(n, n)) / n
        assert exponential(matrix) == pytest.approx(expm(matrix), rel=1e-11, abs=1e-12 * np.abs(expm(matrix)).max())


def test_every_entry_of_a_stiff_oscillator_is_right_to_rounding():
    """A damped oscillator of 1 kHz over a step of 0.1 ms: the entries differ by eight orders of magnitude."""
    omega, zeta, step = 2.0 * np.pi * 1000.0, 0.01, 1e-4
    damped = omega * np.sqrt(1.0 - zeta**2)
    decay, sine, cosine = np.exp(-zeta * omega * step), np.sin(damped * step), np.cos(damped * step)
    exact = decay * np.array(
        [
            [cosine + zeta * omega / damped * sine, sine / damped],
            [-(omega**2) / damped * sine, cosine - zeta * omega / damped * sine],
        ]
    )
    found = exponential(step * np.array([[0.0, 1.0], [-(omega**2), -2.0 * zeta * omega]]))
    assert np.abs(found / exact - 1.0).max() < 2e-14


def test_a_nilpotent_matrix_has_a_series_of_two_terms():
    matrix = np.array([[0.0, 3e6, 0.0], [0.0, 0.0, 2e-7], [0.0, 0.0, 0.0]])
    assert exponential(matrix) == pytest.approx(np.eye(3) + matrix + 0.5 * matrix @ matrix, rel=1e-14, abs=0.0)


def test_balancing_undoes_a_change_of_units():
    random = np.random.default_rng(5)
    matrix = random.uniform(0.5, 1.0, size=(6, 6))
    units = 2.0 ** random.integers(-30, 30, size=6)
    scale = balancing(matrix * units[:, None] / units)
    balanced = matrix * units[:, None] / units * scale / scale[:, None]
    assert np.linalg.norm(balanced, 1) < 2.0 * np.linalg.norm(matrix, 1)
    assert np.array_equal(scale, 2.0 ** np.round(np.log2(scale)))

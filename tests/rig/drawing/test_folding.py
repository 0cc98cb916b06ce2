"""Where a response folds back, against the slow dynamics of an oscillator with cubic stiffness."""

import numpy as np
import pytest
from scipy.optimize import fsolve

from rig.drawing.folding import RESOLVED, folds_back

DAMPING, FORCE = 0.01, 0.02


def response(cubic: float, lags_rad: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Amplitude and frequency of ``x'' + 2 D x' + x + c x^3 = f cos W t`` at given lags, one harmonic."""
    out, guess = [], np.array([FORCE, 1.0])
    for lag in lags_rad:
        guess, _, done, _ = fsolve(
            lambda z, lag=lag: (
                2.0 * DAMPING * z[1] * z[0] - FORCE * np.sin(lag),
                (1.0 + 0.75 * cubic * z[0] ** 2 - z[1] ** 2) * z[0] - FORCE * np.cos(lag),
            ),
            guess,
            full_output=True,
        )
        assert done == 1
        out.append(guess)
    amplitude, frequency = np.transpose(out)
    return amplitude, frequency


def saddle(cubic: float, amplitude: float, frequency: float, lag: float) -> bool:
    """Whether the averaged equations of amplitude and lag have one growing and one decaying solution there."""

    def rates(state: np.ndarray) -> np.ndarray:
        a, phi = state
        detuning = (frequency**2 - 1.0 - 0.75 * cubic * a**2) / (2.0 * frequency)
        half = FORCE / (2.0 * frequency)
        return np.array([-DAMPING * a + half * np.sin(phi), detuning + half * np.cos(phi) / a])

    steps = np.diag([1e-6 * amplitude, 1e-6])
    at = np.array([amplitude, lag])
    jacobian = np.array([(rates(at + s) - rates(at - s)) / (2.0 * s.sum()) for s in steps]).T
    return bool(np.linalg.det(jacobian) < 0.0)


@pytest.mark.parametrize("cubic", [0.3, -0.1], ids=["hardening", "softening"])
def test_the_piece_that_folds_back_is_a_saddle_of_the_slow_dynamics(cubic: float) -> None:
    lags = np.radians(np.arange(5.0, 176.0, 2.5))
    amplitude, frequency = response(cubic, lags)
    folded = folds_back(frequency, np.degrees(lags))
    unstable = np.array([saddle(cubic, *state) for state in zip(amplitude, frequency, lags, strict=True)])
    assert 3 < unstable.sum() < lags.size - 3
    both_ends_alike = unstable[1:] == unstable[:-1]
    np.testing.assert_array_equal(folded[both_ends_alike], unstable[1:][both_ends_alike])
    np.testing.assert_array_equal(folds_back(frequency[::-1], np.degrees(lags)[::-1]), folded[::-1])


def test_a_linear_response_and_scatter_of_the_frequency_do_not_fold_back() -> None:
    lags = np.arange(10.0, 171.0, 5.0)
    _, frequency = response(0.0, np.radians(lags))
    assert not folds_back(frequency, lags).any()
    scatter = 24.0 * (1.0 + 0.4 * RESOLVED * np.resize([1.0, -1.0], lags.size))
    assert not folds_back(scatter, lags).any()
    assert folds_back(np.array([24.0]), np.array([90.0])).size == 0

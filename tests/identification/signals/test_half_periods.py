import numpy as np
import pytest

from identification import IdentificationError, zero_crossings
from tests.refused import refused

RATE_HZ = 5000.0


def test_a_chirp_has_its_own_frequency_and_magnitude() -> None:
    time = np.arange(20_000) / RATE_HZ
    result = zero_crossings(3.0 * np.cos(2 * np.pi * (10.0 + 3.75 * time) * time), sample_rate_hz=RATE_HZ)
    # Between two crossings half a turn passes, at the frequency of the middle; lines between samples add 1e-4.
    np.testing.assert_allclose(result.frequency_hz, 10.0 + 7.5 * result.time_s, rtol=5e-4)
    np.testing.assert_allclose(result.magnitude, 3.0, rtol=1e-3)


def test_an_even_harmonic_makes_half_periods_unequal_and_their_sum_a_period() -> None:
    time = np.arange(10_000) / RATE_HZ
    turn = 2 * np.pi * 25.0 * time + 0.3
    result = zero_crossings(np.sin(turn) + 0.3 * np.cos(2 * turn), sample_rate_hz=RATE_HZ)
    halves = 0.5 / result.frequency_hz
    assert np.abs(np.diff(halves)).min() > 1e-3
    np.testing.assert_allclose(halves[1:] + halves[:-1], 1 / 25.0, rtol=1e-3)
    whole = zero_crossings(np.sin(turn) + 0.3 * np.cos(2 * turn), sample_rate_hz=RATE_HZ, whole_periods=True)
    np.testing.assert_allclose(whole.frequency_hz, 25.0, rtol=1e-3)
    np.testing.assert_allclose(whole.magnitude, 1.3, rtol=1e-3)  # -1 - 0.3, at three quarters of the turn


def test_samples_of_exactly_zero_are_neither_missed_nor_counted_twice() -> None:
    # up through a zero, touching zero from above and from below, down through two zeros, up without any
    signal = [-1.0, 0.0, 2.0, 0.0, 1.0, 0.0, 0.0, -1.0, 0.0, -3.0, 3.0, 1.0]
    result = zero_crossings(signal, sample_rate_hz=1.0)
    crossings = [2 / 3, 5.5, 9.5]
    assert result.time_s.tolist() == pytest.approx([(2 / 3 + 5.5) / 2, 7.5])
    assert (0.5 / result.frequency_hz).tolist() == pytest.approx(np.diff(crossings))
    assert result.magnitude.tolist() == [2.0, 3.0]


def test_a_signal_that_never_returns_is_refused() -> None:
    with refused(IdentificationError, "has-zero-crossings", field="signal", allowed="at least 2"):
        zero_crossings(np.linspace(-1.0, 2.0, 100), sample_rate_hz=RATE_HZ)
    with refused(IdentificationError, "has-upward-zero-crossings", field="signal", allowed="at least 2"):
        zero_crossings([1.0, -1.0, 1.0, -1.0], sample_rate_hz=RATE_HZ, whole_periods=True)

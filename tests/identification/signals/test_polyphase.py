"""Resampling agrees with SciPy's."""

import numpy as np
import pytest
import scipy

from identification.signals.polyphase import low_pass, resampled, resampled_beside_a_line


@pytest.mark.parametrize(("up", "down"), [(4, 25), (1, 2), (1, 50), (5, 1), (7, 9), (8, 50)])
@pytest.mark.parametrize("n", [37, 5000])
def test_it_is_scipys(up: int, down: int, n: int) -> None:
    signals = np.random.default_rng(n).normal(size=(2, n))
    window = scipy.signal.firwin(64 * down + 1, 0.91 / down, window=("kaiser", 8.6))
    taps = low_pass(64 * down + 1, 0.91 / down, 8.6)
    assert taps == pytest.approx(window, rel=1e-9, abs=1e-15)
    expected = scipy.signal.resample_poly(signals, up, down, axis=-1, window=window)
    assert np.max(np.abs(resampled(signals, up, down, taps) - expected)) < 1e-13 * up


@pytest.mark.parametrize("steps", [2, 3, 5])
def test_beside_a_line_it_is_scipys_too(steps: int) -> None:
    signals = np.random.default_rng(steps).normal(size=(2, 400)).cumsum(axis=1)
    expected = scipy.signal.resample_poly(signals, steps, 1, axis=1, window=("kaiser", 10.0), padtype="line")
    found = resampled_beside_a_line(signals, steps, low_pass(20 * steps + 1, 1.0 / steps, 10.0))
    assert np.max(np.abs(found - expected)) < 1e-12

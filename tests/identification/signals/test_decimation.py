import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from identification.errors import IdentificationError
from identification.signals.decimation import EDGE_SAMPLES, decimated
from tests.refused import refused

INNER = slice(EDGE_SAMPLES, -EDGE_SAMPLES)
RATES = [(5000.0, 800.0), (5000.0, 2500.0), (12800.0, 6400.0), (5000.0, 4000.0), (48000.0, 44100.0)]


def sine(frequency_hz: float, rate_hz: float, n: int) -> np.ndarray:
    return np.cos(2 * np.pi * frequency_hz / rate_hz * np.arange(n) + 0.3)


@pytest.mark.parametrize(("old", "new"), RATES)
@pytest.mark.parametrize("share", [0.01, 0.3, 0.7, 0.82])
def test_sine_in_the_passband_comes_out_sampled_more_slowly(old: float, new: float, share: float) -> None:
    frequency_hz = share * new / 2
    slow = decimated(sine(frequency_hz, old, 5000), old, new)
    assert slow.size == np.ceil(5000 * new / old)
    assert np.max(np.abs(slow - sine(frequency_hz, new, slow.size))[INNER]) < 1.5e-4


@pytest.mark.parametrize(("old", "new"), RATES[:4])
def test_nothing_folds_back(old: float, new: float) -> None:
    for frequency_hz in np.linspace(new / 2, old / 2, 7, endpoint=False):
        assert np.max(np.abs(decimated(sine(frequency_hz, old, 5000), old, new))[INNER]) < 1e-4


def test_only_the_stated_edges_feel_the_ends_of_the_record() -> None:
    slow = decimated(np.ones(5000), 5000.0, 800.0)
    assert np.max(np.abs(slow[INNER] - 1.0)) < 1.5e-4
    assert np.max(np.abs(slow[: EDGE_SAMPLES // 4] - 1.0)) > 1e-2


def test_record_that_begins_and_ends_in_rest_has_no_edges() -> None:
    t = np.arange(5000) / 5000.0
    burst = np.sin(np.pi * t) ** 4 * np.sin(2 * np.pi * 60.0 * t)
    slow_t = np.arange(800) / 800.0
    expected = np.sin(np.pi * slow_t) ** 4 * np.sin(2 * np.pi * 60.0 * slow_t)
    assert np.max(np.abs(decimated(burst, 5000.0, 800.0) - expected)) < 1.5e-4


@settings(max_examples=20, deadline=None)
@given(st.integers(1, 4), st.integers(100, 700))
def test_channels_are_taken_one_by_one(n_channel: int, n: int) -> None:
    signals = np.random.default_rng(n).standard_normal((n_channel, n))
    together = decimated(signals, 5000.0, 800.0)
    for signal, slow in zip(signals, together, strict=True):
        assert slow == pytest.approx(decimated(signal, 5000.0, 800.0), abs=1e-14)


def test_same_rate_gives_a_copy() -> None:
    signal = np.arange(5.0)
    copy = decimated(signal, 5000.0, 5000.0)
    assert np.array_equal(copy, signal)
    copy[0] = 1.0
    assert signal[0] == 0.0


@pytest.mark.parametrize(
    ("rates", "message"),
    [
        ((800.0, 5000.0), {"field": "new_rate_hz", "value": 5000.0, "allowed": "at most rate_hz = 800 Hz"}),
        ((5000.0, 0.0), {"field": "new_rate_hz", "allowed": "finite and above zero"}),
        (
            (5000.0, 800.0 * np.sqrt(2)),
            {"says": "its-ratio-to-rate-hz-hz", "field": "new_rate_hz"},
        ),
        ((5000.0, 1.0), {"says": "its-ratio-to-rate-hz-hz-2", "field": "new_rate_hz", "value": 1.0}),
    ],
)
def test_rates_that_do_not_go_are_named(rates: tuple[float, float], message: str) -> None:
    with refused(IdentificationError, **message):
        decimated(np.zeros(100), *rates)


def test_signal_with_gaps_is_refused() -> None:
    with refused(IdentificationError, "value-at-2", field="signals"):
        decimated([0.0, np.nan, 1.0], 5000.0, 2500.0)

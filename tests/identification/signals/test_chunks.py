"""Records in chunks: the phase is that of the whole record, and so is the vibration."""

import numpy as np
import pytest

from identification import Channel, IdentificationError, periodic_vibration
from identification.signals import chunks
from identification.signals.chunks import ArrayRecord, Line, Phase
from identification.signals.columns import even_products
from tests.refused import refused

RATE_HZ, FREQUENCY_HZ = 5000.0, 24.37
CHANNELS = (
    Channel("force", "force", "N"),
    Channel("drive", "drive", "m/s^2"),
    Channel("response", "response", "m/s^2"),
)
SIZES = {"force": 0.3, "drive": 2.0, "response": 0.7}


def turned(n):
    """A phase that advances with a slowly changing frequency and ripples within each period."""
    time_s = np.arange(n) / RATE_HZ
    smooth = 2.0 * np.pi * FREQUENCY_HZ * time_s + 2e-4 * time_s**2
    return smooth, smooth + 1e-3 * np.sin(smooth)


def recorded(n, noise=1e-3, seed=0):
    """Wrapped phase and three signals of known fundamentals, the drive with a third harmonic of 0.1."""
    smooth, theta = turned(n)
    signals = np.array([size * np.cos(smooth - number) for number, size in enumerate(SIZES.values())])
    signals[1] += 0.1 * np.cos(3.0 * smooth)
    signals += noise * np.random.default_rng(seed).standard_normal(signals.shape)
    return np.mod(theta, 2.0 * np.pi), signals


@pytest.fixture
def small_chunks(monkeypatch):
    monkeypatch.setattr(chunks, "CHUNK", 1000)


def record_of(theta):
    return ArrayRecord(theta, np.zeros((1, theta.size)), np.zeros(theta.size, bool))


def test_the_phase_is_unwrapped_across_chunks(small_chunks):
    _, theta = turned(3456)
    phase = Phase(record_of(np.mod(theta, 2.0 * np.pi)))
    found = np.concatenate([phase.read(start, stop) for start, stop in chunks.spans(3456)])
    np.testing.assert_allclose(found, theta, atol=1e-9)
    np.testing.assert_allclose(phase.read(2000, 3300), theta[2000:3300], atol=1e-9)
    assert phase.at(2345) == pytest.approx(theta[2345])
    assert (phase.first, phase.last) == pytest.approx((theta[0], theta[-1]))


@pytest.mark.parametrize("sample", [1, 999, 1000, 1001, 3000, 3455])
def test_samples_below_a_phase_are_counted_across_chunks(small_chunks, sample):
    _, theta = turned(3456)
    phase = Phase(record_of(np.mod(theta, 2.0 * np.pi)))
    assert phase.samples_below(theta[sample] - theta[0] - 1e-6) == sample
    assert phase.samples_below(1e9) == 3456


def test_a_phase_that_falls_from_one_chunk_to_the_next_is_refused_with_its_place(small_chunks):
    _, theta = turned(3456)
    theta[2000:] -= theta[2000] - theta[1999] + 1e-3
    with refused(IdentificationError, "does-not-rise-from-to", field="theta_rad"):
        Phase(record_of(theta))


def test_a_line_read_in_stretches_is_linspace():
    whole = np.linspace(-0.5, 0.5, 777)
    line = Line(-0.5, 0.5, 777)
    found = np.concatenate([line.read(start, min(start + 100, 777)) for start in range(0, 777, 100)])
    assert np.array_equal(found, whole)


@pytest.mark.parametrize("lost", [(), (0, 999, 1000, 5001, 20_000)])
def test_a_vibration_in_chunks_is_that_of_the_whole_record(monkeypatch, lost):
    theta, signals = recorded(20_500)
    gone = np.zeros(theta.size, bool)
    gone[list(lost)] = True
    signals[:, gone] = np.nan

    def found():
        return periodic_vibration(
            theta, signals, CHANNELS, sample_rate_hz=RATE_HZ, resolution=[1e-3, 1e-3, 0.0], lost=gone
        )

    whole = found()
    monkeypatch.setattr(chunks, "CHUNK", 1000)
    pieces = found()
    assert (pieces.frequency_hz, pieces.periods) == pytest.approx((whole.frequency_hz, whole.periods), rel=1e-13)
    np.testing.assert_allclose(pieces.harmonics, whole.harmonics, atol=1e-10)
    np.testing.assert_allclose(pieces.residual_rms, whole.residual_rms, rtol=1e-9)
    np.testing.assert_allclose(pieces.harmonics_std, whole.harmonics_std, rtol=1e-5)
    np.testing.assert_allclose(pieces.drift, whole.drift, atol=1e-9)


def test_a_record_of_many_chunks_gives_the_fundamentals_that_it_was_made_of():
    theta, signals = recorded(300_000)
    found = periodic_vibration(theta, signals, CHANNELS, sample_rate_hz=RATE_HZ)
    at = np.exp(1j * np.angle(found.harmonics[0, 1]))
    expected = np.array([size * np.exp(-1j * number) for number, size in enumerate(SIZES.values())])
    error = np.abs(found.harmonics[:, 1] / at - expected)
    assert np.all(error < 5.0 * found.harmonics_std[:, 1] + 1e-5 * np.abs(expected))  # what a ripple of 1e-3 rad leaves
    assert abs(abs(found.harmonics[1, 3]) - 0.1) < 5.0 * found.harmonics_std[1, 3]
    np.testing.assert_allclose(found.residual_rms, 1e-3, rtol=0.01)


@pytest.mark.parametrize(("size", "step"), [(30, 0.4), (2001, 0.07), (65_000, 0.31)])
def test_the_products_of_harmonics_of_an_even_phase_are_their_sums(size, step):
    middle, orders = 0.7, np.arange(6)
    theta = np.outer(middle + step * (np.arange(size) - 0.5 * (size - 1)), orders)
    columns = np.hanning(size)[:, None] * np.hstack([np.cos(theta)[:, 1:], -np.sin(theta)])
    np.testing.assert_allclose(even_products(middle, step, size, 5), columns.T @ columns, atol=1e-12 * size)

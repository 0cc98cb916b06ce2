import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from identification import Channel, IdentificationError, periodic_vibration
from tests.identification.rigs import sampled
from tests.refused import refused

CHANNELS = (Channel("force", "force", "N"), Channel("drive", "drive", "m/s2"), Channel("tip", "response", "m/s2"))
RATE_HZ = 5000.0


def random_harmonics(seed: int, highest: int = 7) -> np.ndarray:
    rng = np.random.default_rng(seed)
    harmonics = rng.normal(size=(3, highest + 1)) + 1j * rng.normal(size=(3, highest + 1))
    harmonics[:, 0] = harmonics[:, 0].real
    return harmonics


def phase(frequency_hz: float, periods: float, start: float = 0.3) -> np.ndarray:
    samples = int(periods * RATE_HZ / frequency_hz)
    return 2 * np.pi * frequency_hz * np.arange(samples) / RATE_HZ + start


@settings(max_examples=40, deadline=None)
@given(
    frequency_hz=st.floats(5.0, 250.0),
    periods=st.floats(1.02, 60.0),
    start=st.floats(-10.0, 10.0),
    seed=st.integers(0, 1000),
)
def test_every_harmonic_of_a_clean_record_is_recovered(
    frequency_hz: float, periods: float, start: float, seed: int
) -> None:
    harmonics = random_harmonics(seed)
    theta = phase(frequency_hz, periods + 20.0 / RATE_HZ * frequency_hz, start)
    wrapped = np.mod(theta, 2 * np.pi)
    result = periodic_vibration(wrapped, sampled(harmonics, theta), CHANNELS, sample_rate_hz=RATE_HZ)
    np.testing.assert_allclose(result.harmonics, harmonics, atol=1e-8)
    assert result.frequency_hz == pytest.approx(frequency_hz, rel=1e-9)
    assert result.periods >= int(periods)


def test_a_wandering_frequency_smears_nothing() -> None:
    theta = phase(24.37, 50.0)
    theta = theta + 0.4 * np.sin(theta / 17.0)
    harmonics = random_harmonics(1)
    result = periodic_vibration(theta, sampled(harmonics, theta), CHANNELS, sample_rate_hz=RATE_HZ)
    np.testing.assert_allclose(result.harmonics, harmonics, atol=1e-5)


def test_an_oscillator_that_swings_within_the_period_mixes_no_harmonics() -> None:
    even = phase(24.37, 50.0)
    swinging = even + 2e-3 * np.cos(even + 0.4) + 1e-3 * np.sin(2 * even)
    harmonics = random_harmonics(2)
    result = periodic_vibration(swinging, sampled(harmonics, even), CHANNELS, sample_rate_hz=RATE_HZ)
    np.testing.assert_allclose(result.harmonics, harmonics, atol=5e-5)


def test_only_whole_periods_are_used_and_the_rest_is_reported() -> None:
    theta = phase(25.0, 10.5)
    result = periodic_vibration(theta, sampled(random_harmonics(0), theta), CHANNELS, sample_rate_hz=RATE_HZ)
    assert result.periods == 10
    assert result.warnings == ("100 samples beyond 10 whole periods are left out",)


def test_exactly_whole_periods_raise_no_warning_in_single_precision() -> None:
    theta = np.mod(phase(25.0, 40.0), 2 * np.pi).astype(np.float32)
    result = periodic_vibration(theta, sampled(random_harmonics(0), theta), CHANNELS, sample_rate_hz=RATE_HZ)
    assert result.periods == 40
    assert result.warnings == ()
    assert result.frequency_hz == pytest.approx(25.0, rel=1e-7)


def test_a_slow_drift_is_reported_and_spares_the_small_harmonics() -> None:
    theta = phase(24.37, 20.0)
    harmonics = np.tile(np.array([0.0, 1.0, 0.0, 1e-4 + 0j]), (3, 1))
    position = np.linspace(-0.5, 0.5, theta.size)
    relative = 0.05 - 0.02j
    data = sampled(harmonics, theta) + np.real(position * relative * np.exp(1j * theta))
    plain = np.linalg.lstsq(np.exp(1j * np.outer(theta, np.arange(-3, 4))), data[0], rcond=None)[0]
    result = periodic_vibration(theta, data, CHANNELS, sample_rate_hz=RATE_HZ, harmonics=3)
    assert result.drift is not None
    np.testing.assert_allclose(result.drift, relative, rtol=1e-3)
    assert abs(result.harmonics[0, 3] - 1e-4) < 1e-6
    assert abs(2 * plain[6] - 1e-4) > 1e-4, "the drift matters in this case"


@pytest.mark.parametrize("coloured", [False, True])
def test_standard_errors_match_the_scatter_over_many_records(coloured: bool) -> None:
    theta = phase(25.0, 40.0)
    harmonics = random_harmonics(2, highest=3)
    clean = sampled(harmonics, theta)
    errors, stated = [], []
    for seed in range(120):
        noise = np.random.default_rng(seed).normal(size=clean.shape)
        if coloured:
            noise = np.apply_along_axis(np.convolve, 1, noise, np.exp(-np.arange(300) / 30.0), "same")
        result = periodic_vibration(theta, clean + noise, CHANNELS, sample_rate_hz=RATE_HZ, harmonics=3)
        errors.append(result.harmonics - harmonics)
        stated.append(result.harmonics_std)
    scatter = np.sqrt(np.mean(np.abs(errors) ** 2, axis=(0, 1)) / np.array([1.0, 2.0, 2.0, 2.0]))
    claimed = np.sqrt(np.mean(np.square(stated), axis=(0, 1)))
    np.testing.assert_allclose(claimed, scatter, rtol=0.15)


def test_the_residual_is_what_was_added_to_the_harmonics() -> None:
    theta = phase(25.0, 40.0)
    noise = 0.01 * np.sqrt(2.0) * np.sin(11 * theta)
    result = periodic_vibration(theta, sampled(random_harmonics(3), theta) + noise, CHANNELS, sample_rate_hz=RATE_HZ)
    np.testing.assert_allclose(result.residual_rms, 0.01, rtol=1e-4)


def test_less_than_one_period_is_refused() -> None:
    theta = phase(25.0, 0.9)
    with refused(IdentificationError, "covers-periods", field="theta_rad", allowed="at least one whole period"):
        periodic_vibration(theta, np.zeros((3, theta.size)), CHANNELS, sample_rate_hz=RATE_HZ)


def test_too_few_samples_per_period_are_refused() -> None:
    theta = phase(400.0, 40.0)
    with refused(IdentificationError, "need-more-than-samples-per-period", field="harmonics"):
        periodic_vibration(theta, np.zeros((3, theta.size)), CHANNELS, sample_rate_hz=RATE_HZ)


def test_a_falling_phase_is_refused() -> None:
    theta = -phase(25.0, 5.0)
    with refused(IdentificationError, "does-not-rise-from-to-2", field="theta_rad"):
        periodic_vibration(theta, np.zeros((3, theta.size)), CHANNELS, sample_rate_hz=RATE_HZ)


def test_nan_and_unequal_lengths_are_named() -> None:
    theta = phase(25.0, 5.0)
    data = sampled(random_harmonics(0), theta)
    data[2, 17] = np.nan
    with refused(IdentificationError, "value-at-is-nan-3", field="samples"):
        periodic_vibration(theta, data, CHANNELS, sample_rate_hz=RATE_HZ)
    with refused(
        IdentificationError, "shape-5", field="samples", allowed="(3, 1000): channels by samples of theta_rad"
    ):
        periodic_vibration(theta, data[:2], CHANNELS, sample_rate_hz=RATE_HZ)

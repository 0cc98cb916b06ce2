"""Intervals hold the truth, whatever the noise."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.stats import binomtest

from identification import decay_backbone
from tests.identification.decays.signals import DRIVE, FREQUENCY_HZ, hardening, hardening_frequency_hz, linear

RATE_HZ, DAMPING, START_M, RUNS = 1280.0, 0.004, 0.6, 12


@pytest.fixture(scope="module")
def decay():
    x, _ = hardening(DAMPING, 5.5, RATE_HZ, START_M)
    grid = np.linspace(0.01, 0.62, 62)
    return x, CubicSpline(grid, hardening_frequency_hz(grid))


@pytest.mark.slow
@pytest.mark.parametrize("signal_to_noise_db", [20, 40, 60])
def test_intervals_of_frequency_and_damping_hold_at_least_93_percent(decay, signal_to_noise_db):
    x, frequency_hz = decay
    noise = START_M / np.sqrt(2.0) * 10.0 ** (-signal_to_noise_db / 20.0)
    inside = {"frequency": [], "damping": []}
    for seed in range(RUNS):
        seen = x + noise * np.random.default_rng(seed).normal(size=x.size)
        mode = decay_backbone([seen], DRIVE, sample_rate_hz=RATE_HZ).mode()
        expected = frequency_hz(mode.amplitude_m)
        inside["frequency"] += list(np.abs(mode.modal_frequency_hz - expected) < mode.modal_frequency_bound_95_hz)
        damping = DAMPING * FREQUENCY_HZ / expected
        inside["damping"] += list(np.abs(mode.damping_ratio - damping) < mode.damping_ratio_bound_95)
    for name, held in inside.items():
        assert len(held) > 10 * RUNS, name
        assert binomtest(sum(held), len(held), 0.93, alternative="less").pvalue > 0.01, name


@pytest.mark.parametrize("signal_to_noise_db", [20, 40])
def test_intervals_are_not_much_wider_than_they_need_to_be(signal_to_noise_db):
    x = linear(DAMPING, 5.5, RATE_HZ)
    noise = np.sqrt(0.5) * 10.0 ** (-signal_to_noise_db / 20.0)
    errors = []
    for seed in range(10):
        seen = x + noise * np.random.default_rng(seed).normal(size=x.size)
        mode = decay_backbone([seen], DRIVE, sample_rate_hz=RATE_HZ).mode()
        errors += list(np.abs(mode.damping_ratio - DAMPING) / mode.damping_ratio_bound_95)
    assert np.median(errors) > 0.1  # 0.34 for a normal error and an exact interval


def test_ten_channels_are_worth_more_than_one():
    x = linear(DAMPING, 5.5, RATE_HZ)
    rng = np.random.default_rng(3)
    shape = np.linspace(0.5, 1.4, 10)
    seen = shape[:, None] * x + 0.01 * rng.normal(size=(10, x.size))
    channels = [type(DRIVE[0])(f"p{k}", "drive" if k == 4 else "response", "m") for k in range(10)]
    one = decay_backbone(seen[4:5], channels[4:5], sample_rate_hz=RATE_HZ).mode()
    ten = decay_backbone(seen, channels, sample_rate_hz=RATE_HZ).mode()
    assert ten.reference == "p4"
    assert np.median(ten.damping_ratio_std) < 0.6 * np.median(one.damping_ratio_std)
    np.testing.assert_allclose(np.median(ten.deflection.real, axis=0), shape / shape[4], rtol=0.01)

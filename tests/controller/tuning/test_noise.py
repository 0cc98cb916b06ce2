"""The low-pass from noise, against noise that is known."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from controller.tuning import low_pass_from_densities, low_pass_from_noise
from tests.refused import refused

RATE, OMEGA = 5000.0, 2 * math.pi * 149.0


def record(force_std, acceleration_std, seconds=4.0, seed=1):
    draw = np.random.default_rng(seed)
    time = np.arange(round(seconds * RATE)) / RATE
    theta = np.mod(OMEGA * time, 2 * math.pi)
    force = 0.1 * np.cos(theta) + 0.05 * np.cos(3 * theta + 1) + 0.2 + force_std * draw.normal(size=time.size)
    acceleration = 3.0 * np.cos(theta + 1.5) + acceleration_std * draw.normal(size=time.size)
    return theta, force, acceleration


def test_the_low_pass_follows_the_noise_beside_the_harmonics():
    std = 0.008
    choice = low_pass_from_noise(*record(std, 0.0), RATE)
    density = 2 * std**2 / RATE  # one-sided
    assert choice.low_pass_rad_s == pytest.approx(math.radians(0.5) ** 2 * 2 * 0.1**2 / density, rel=0.1)
    assert choice.lag_std_deg == pytest.approx(0.5, rel=1e-6)
    assert choice.quiet


def test_the_fluctuation_is_that_of_a_filtered_lag():
    theta, force, acceleration = record(0.03, 0.2, seconds=40.0)
    choice = low_pass_from_noise(theta, force, acceleration, RATE, lag_std_deg=3.0)
    gain = 1 - math.exp(-choice.low_pass_rad_s / RATE)
    turned = 2 * np.exp(-1j * theta)
    # white noise alone, or else the ripple at twice the frequency would be counted
    clean_force, clean_acceleration = record(0.0, 0.0, seconds=40.0)[1:]
    noise_f, noise_a = (
        lfilter([gain], [1, gain - 1], turned * (dirty - clean))[5000:]
        for dirty, clean in ((force, clean_force), (acceleration, clean_acceleration))
    )
    lag = np.angle((0.1 + noise_f) / (3.0 + noise_a * np.exp(-1.5j)))
    assert choice.lag_std_deg == pytest.approx(math.degrees(np.std(lag)), rel=0.1)


def test_a_quiet_rig_gets_a_fifth_and_a_loud_one_a_twentieth_with_a_word():
    quiet = low_pass_from_densities(OMEGA, 0.0, 1.0, 0.0, 1.0)
    loud = low_pass_from_densities(OMEGA, 1.0, 1.0, 1.0, 1.0)
    assert quiet.low_pass_rad_s == pytest.approx(OMEGA / 5)
    assert quiet.quiet
    assert loud.low_pass_rad_s == pytest.approx(OMEGA / 20)
    assert not loud.quiet


def test_a_record_too_short_is_refused():
    theta, force, acceleration = record(0.01, 0.01, seconds=0.1)
    with refused(ValueError, "periods", field="theta_rad", allowed="at least 20"):
        low_pass_from_noise(theta, force, acceleration, RATE)


def test_a_silent_channel_is_refused():
    with refused(ValueError, field="force_amplitude", value=0.0):
        low_pass_from_densities(OMEGA, 0.0, 0.0, 0.0, 1.0)

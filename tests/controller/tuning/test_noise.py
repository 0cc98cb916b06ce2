"""The low-pass from noise, against noise that is known."""

import math

import numpy as np
import pytest
from scipy.signal import lfilter

from controller.tuning import low_pass_from_densities
from tests.refused import refused

RATE, OMEGA = 5000.0, 2 * math.pi * 149.0


def test_the_low_pass_follows_the_noise():
    density = 2 * 0.008**2 / RATE  # one-sided
    choice = low_pass_from_densities(OMEGA, density, 0.1, 0.0, 3.0)
    assert choice.low_pass_rad_s == pytest.approx(math.radians(0.5) ** 2 * 2 * 0.1**2 / density)
    assert choice.lag_std_deg == pytest.approx(0.5, rel=1e-6)
    assert choice.quiet


def test_the_fluctuation_is_that_of_a_filtered_lag():
    draw, force_std, acceleration_std = np.random.default_rng(1), 0.03, 0.2
    densities = (2 * std**2 / RATE for std in (force_std, acceleration_std))
    choice = low_pass_from_densities(OMEGA, next(densities), 0.1, next(densities), 3.0, lag_std_deg=3.0)
    gain = 1 - math.exp(-choice.low_pass_rad_s / RATE)
    turned = 2 * np.exp(-1j * OMEGA * np.arange(round(40.0 * RATE)) / RATE)
    noise_f, noise_a = (
        lfilter([gain], [1, gain - 1], turned * std * draw.normal(size=turned.size))[5000:]
        for std in (force_std, acceleration_std)
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


def test_a_silent_channel_is_refused():
    with refused(ValueError, field="force_amplitude", value=0.0):
        low_pass_from_densities(OMEGA, 0.0, 0.0, 0.0, 1.0)

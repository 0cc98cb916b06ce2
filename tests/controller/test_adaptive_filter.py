"""The adaptive filter against closed forms and scipy: what it settles on, how fast, how noisy, and when it is unstable."""

import math

import numpy as np
import pytest
from scipy import signal

from controller.adaptive_filter import MOST_HARMONICS, adapt, root_mean_square, turn_phasors
from controller.detector import DetectorSettings
from tests.refused import refused

FS = 5000.0
OMEGA = 2 * math.pi * 24.37
LOW_PASS = OMEGA / 10


def follow(values, harmonics=5, low_pass=LOW_PASS, omega=OMEGA):
    """Coefficients complex[n, H+1] of the filter over the samples of a signal."""
    gain = -math.expm1(-low_pass / FS)
    coefficients, phasors = np.zeros(harmonics + 1, complex), np.zeros(harmonics + 1, complex)
    history = np.empty((values.size, harmonics + 1), complex)
    turn = np.exp(1j * omega * np.arange(values.size) / FS)
    for k, value in enumerate(values.tolist()):
        turn_phasors(phasors, harmonics, turn.real[k], turn.imag[k])
        adapt(coefficients, phasors, harmonics, value, gain)
        history[k] = coefficients
    return history


def synthesise(amplitudes, n, omega=OMEGA):
    theta = omega * np.arange(n) / FS
    return np.real(sum(a * np.exp(1j * h * theta) for h, a in enumerate(amplitudes)))


def test_mean_and_harmonics_are_found_exactly_and_leave_no_ripple():
    wanted = np.array([0.7, 1.0 - 0.4j, 0.3j, 0.2, -0.1 + 0.05j, 0.02j])
    found = follow(synthesise(wanted, 5000))
    late = found[-500:]  # after 15 time constants
    np.testing.assert_allclose(late, np.broadcast_to(wanted, late.shape), atol=3e-6)


def test_synchronous_demodulation_has_the_ripple_that_the_filter_has_not():
    late = follow(synthesise([0.5, 1.0], 5000))[-500:, 1]
    plain = signal.lfilter(
        [-math.expm1(-LOW_PASS / FS)],
        [1.0, -math.exp(-LOW_PASS / FS)],
        2 * synthesise([0.5, 1.0], 5000) * np.exp(-1j * OMEGA * np.arange(5000) / FS),
    )[-500:]
    assert np.abs(plain - 1.0).max() > 0.05
    assert np.abs(late - 1.0).max() < 1e-5


def test_only_harmonics_beyond_those_followed_make_ripple():
    with_sixth = follow(synthesise([0, 1.0, 0, 0, 0, 0, 0.1], 5000))[-1000:, 1]
    ripple = np.abs(with_sixth - with_sixth.mean()).max()
    # 2 w_LP/(5 Omega) of the sixth at its nearest distance, 5 Omega, and as much from the other side
    assert 0.2 < ripple / (0.1 * LOW_PASS / (5 * OMEGA)) < 3.0


@pytest.mark.parametrize("part", [1.0, 1j, 0.6 - 0.8j])
def test_a_step_of_the_fundamental_is_followed_as_by_a_first_order_low_pass(part):
    low_pass = OMEGA / 40  # slow beside the vibration: there the averaging is exact
    found = follow(synthesise([0, part], 6000), low_pass=low_pass)[:, 1]
    expected = part * (1 - np.exp(-low_pass * (np.arange(6000) + 1) / FS))
    assert np.abs(found - expected).max() < 0.03


@pytest.mark.parametrize("modulation_hz", [0.3, 1.0, 3.0])
def test_a_slow_modulation_passes_with_gain_and_phase_of_the_low_pass(modulation_hz):
    low_pass, n = OMEGA / 20, 60_000
    t = np.arange(n) / FS
    found = follow((1 + 0.1 * np.cos(2 * math.pi * modulation_hz * t)) * np.cos(OMEGA * t), low_pass=low_pass)[
        :, 1
    ].real
    whole = slice(n // 2, n // 2 + round(FS / modulation_hz) * int(n / 2 * modulation_hz / FS))
    got = 2 * np.mean(found[whole] * np.exp(-2j * math.pi * modulation_hz * t[whole])) / 0.1
    assert got == pytest.approx(1 / (1 + 2j * math.pi * modulation_hz / low_pass), abs=0.02)


def test_noise_makes_the_phase_variance_of_the_formula():
    amplitude, sigma, n = 2.0, 0.3, 150_000
    noise = np.random.default_rng(4).normal(0.0, sigma, n)
    for low_pass in (OMEGA / 20, OMEGA / 5):
        found = follow(synthesise([0, amplitude], n) + noise, low_pass=low_pass)[2000:, 1]
        two_sided = sigma**2 / FS  # density per Hz over both signs of the frequency
        # N0 w_LP / (2 A^2) with N0 the one-sided density
        assert np.angle(found).var() == pytest.approx(2 * two_sided * low_pass / (2 * amplitude**2), rel=0.15)


@pytest.mark.parametrize("harmonics", [1, 5, MOST_HARMONICS])
def test_the_filter_is_stable_up_to_the_bound_and_not_beyond(harmonics):
    noise = np.random.default_rng(5).normal(size=4000)
    bound = 2.0 / (2 * harmonics + 1)  # 0 < gain (1 + 2 H) < 2: the error after an update is (1 - gain (1 + 2H)) of it
    for factor, stable in ((0.9, True), (1.2, False)):
        low_pass = -math.log1p(-factor * bound) * FS
        with np.errstate(over="ignore", invalid="ignore"):
            size = np.abs(follow(noise, harmonics, low_pass)[-1]).max()
        assert bool(np.isfinite(size) and size < 100.0) is stable


@pytest.mark.parametrize("harmonics", [1, 5, MOST_HARMONICS])
def test_settings_keep_half_way_off_the_bound_and_name_the_largest_bandwidth(harmonics):
    largest = -math.log1p(-1.0 / (2 * harmonics + 1)) * FS
    near = DetectorSettings(detector="adaptive", harmonics_followed=harmonics, low_pass_rad_s=0.999 * largest)
    assert near.build_detector(FS)["gain"][0] * (2 * harmonics + 1) == pytest.approx(0.999, rel=5e-3)
    beyond = near.model_copy(update={"low_pass_rad_s": 1.001 * largest})
    with refused(ValueError, "allows-up-to", field="low_pass_rad_s"):
        beyond.build_detector(FS)


def test_the_root_mean_square_is_that_of_the_signal_without_its_mean():
    amplitudes = np.array([3.0, 1.0 - 0.4j, 0.3j, 0.2, -0.1 + 0.05j, 0.02j])
    theta = 2 * math.pi * np.arange(1000) / 1000
    values = np.real(sum(a * np.exp(1j * h * theta) for h, a in enumerate(amplitudes)))
    assert root_mean_square(amplitudes, amplitudes.size - 1) == pytest.approx(values.std(), rel=1e-12)

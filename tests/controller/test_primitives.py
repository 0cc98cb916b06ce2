"""Primitives, detectors and lock of the control law against closed forms and scipy."""

import math

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy import signal

from controller.detector import demodulate, phase_lag, sign_product
from controller.lock import LOCK, THRESHOLDS, LockState, next_lock_state
from controller.primitives import advance_phase, proportional_integral, track, wrap

FS = 5000.0


@given(st.floats(-1e4, 1e4))
def test_wrapping_keeps_the_angle_and_lands_within_half_a_turn(angle):
    wrapped = wrap(angle)
    assert -math.pi <= wrapped <= math.pi
    assert math.isclose(math.cos(wrapped), math.cos(angle), abs_tol=1e-9)
    assert math.isclose(math.sin(wrapped), math.sin(angle), abs_tol=1e-9)


def test_the_oscillator_keeps_its_phase_in_one_turn_and_its_frequency_exact():
    theta, turns, omega = 0.0, 0, 2 * math.pi * 24.37
    for _ in range(50_000):
        new = advance_phase(theta, omega, 1 / FS)
        turns += new < theta
        theta = new
    assert turns + theta / (2 * math.pi) == pytest.approx(24.37 * 10.0, abs=1e-9)


def test_the_tracking_filter_is_the_exact_first_order_low_pass():
    gain = -math.expm1(-2 * math.pi / FS)
    values = np.random.default_rng(1).normal(size=400)
    got, mean = [], 0.0
    for value in values:
        mean = track(mean, value, gain)
        got.append(mean)
    # state space of a/(s + a) with a held input, by scipy
    a = np.array([[2 * math.pi]])
    ad, bd, *_ = signal.cont2discrete((-a, a, np.eye(1), np.zeros((1, 1))), 1 / FS, method="zoh")
    expected = signal.lfilter([bd[0, 0]], [1.0, -ad[0, 0]], values)
    np.testing.assert_allclose(got, expected, rtol=1e-9, atol=1e-12)


@given(st.floats(0.01, 100.0), st.floats(-3.1, 3.1))
def test_demodulation_settles_on_the_complex_amplitude(size, angle):
    amplitude = size * complex(math.cos(angle), math.sin(angle))
    omega, corner = 2 * math.pi * 24.37, 2 * math.pi
    gain = -math.expm1(-corner / FS)
    estimate, history = 0j, []
    for k in range(10_000):
        theta = omega * k / FS
        value = (amplitude * complex(math.cos(theta), math.sin(theta))).real
        estimate = demodulate(estimate, value, math.cos(theta), math.sin(theta), gain)
        history.append(estimate)
    ripple = corner / math.hypot(
        2 * omega, corner
    )  # |a/(a + 2 i Omega)|: what the low-pass leaves at twice the frequency
    last = np.array(history[-2000:])
    assert abs(last.mean() - amplitude) < 3e-3 * size
    assert np.abs(last - last.mean()).max() == pytest.approx(ripple * size, rel=0.1)


def test_a_lag_is_the_angle_of_the_force_minus_that_of_the_response():
    force, response = 2.0 * np.exp(0.3j), 5.0 * np.exp(1.1j)
    assert phase_lag(complex(force), complex(response)) == pytest.approx(-0.8)


@pytest.mark.parametrize("psi_deg", [20.0, 60.0, 90.0, 130.0])
def test_the_sign_product_of_two_sines_averages_to_two_over_pi_times_the_phase_error(psi_deg):
    theta = 2 * math.pi * (np.arange(100_000) + 0.5) / 100_000
    force = np.cos(theta)
    acceleration = -np.cos(theta - math.radians(psi_deg))  # the displacement lags by psi
    mean = np.mean([sign_product(f, a) for f, a in zip(force, acceleration, strict=True)])
    assert 0.5 * math.pi * mean == pytest.approx(math.radians(90.0 - psi_deg), abs=1e-3)


def test_harmonics_of_the_force_bias_the_sign_product():
    theta = 2 * math.pi * (np.arange(100_000) + 0.5) / 100_000
    force = np.cos(theta) + 1.8 * np.cos(2 * theta + 0.7)
    acceleration = -np.cos(theta - math.pi / 2)
    mean = np.mean([sign_product(f, a) for f, a in zip(force, acceleration, strict=True)])
    assert abs(mean) > 0.02


def test_the_pi_law_gives_its_gains_inside_the_bounds():
    output, integral = proportional_integral(0.1, 0.5, 2.0, 6.0, 0.01, 150.0, 0.0, 1000.0)
    assert integral == pytest.approx(0.5 + 6.0 * 0.1 * 0.01)
    assert output == pytest.approx(150.0 + 2.0 * 0.1 + integral)


@given(st.lists(st.floats(-3.0, 3.0), min_size=1, max_size=200))
def test_the_pi_law_never_leaves_its_bounds_and_never_winds_up(errors):
    integral = 0.0
    for error in errors:
        output, integral = proportional_integral(error, integral, 2.0, 50.0, 0.05, 150.0, 140.0, 160.0)
        assert 140.0 <= output <= 160.0
        # conditional integration cannot push the integral further out than one step from where the bound lies
        assert abs(integral) <= 10.0 + 2.0 * 3.0 + 50.0 * 3.0 * 0.05


def test_an_integral_that_stood_at_the_bound_turns_round_at_once():
    integral = 0.0
    for _ in range(10_000):
        output, integral = proportional_integral(1.0, integral, 2.0, 50.0, 0.01, 150.0, 140.0, 160.0)
    assert output == 160.0
    output, integral = proportional_integral(-1.0, integral, 2.0, 50.0, 0.01, 150.0, 140.0, 160.0)
    assert output < 160.0


def _lock():
    thresholds = np.zeros(1, THRESHOLDS)
    thresholds["locked_rad"], thresholds["locked_periods"] = math.radians(5), 10
    thresholds["lost_rad"], thresholds["lost_periods"] = math.radians(30), 20
    thresholds["waiting_rad"] = math.radians(30)
    return np.zeros(1, LOCK), thresholds


def _periods(lock, thresholds, count, error_deg, present=True, held=True, waits=False):
    for _ in range(count):
        next_lock_state(lock[0], thresholds[0], present, held, math.radians(error_deg), waits)
    return LockState(int(lock["state"][0]))


def test_the_lock_goes_from_searching_over_acquiring_to_locked():
    lock, thresholds = _lock()
    assert _periods(lock, thresholds, 5, 0.0, present=False) is LockState.SEARCHING
    assert _periods(lock, thresholds, 3, 60.0) is LockState.ACQUIRING
    assert _periods(lock, thresholds, 9, 1.0) is LockState.ACQUIRING
    assert _periods(lock, thresholds, 1, 1.0) is LockState.LOCKED


def test_a_lock_is_lost_after_far_periods_at_a_held_level_only():
    lock, thresholds = _lock()
    _periods(lock, thresholds, 10, 0.0)
    assert _periods(lock, thresholds, 100, 20.0, held=False) is LockState.LOCKED
    assert _periods(lock, thresholds, 19, 50.0) is LockState.LOCKED
    assert _periods(lock, thresholds, 1, 50.0) is LockState.LOST


def test_a_phase_that_swings_to_and_fro_beyond_the_threshold_is_a_lost_lock():
    lock, thresholds = _lock()
    _periods(lock, thresholds, 10, 0.0)
    swing_deg = 60.0 * np.sin(2 * np.pi * (np.arange(300) + 0.5) / 24)
    states = [_periods(lock, thresholds, 1, error) for error in swing_deg]
    assert states[-1] is LockState.LOST
    few, _ = _lock()
    _periods(few, thresholds, 10, 0.0)
    knocks = [90.0 if period % 10 < 4 else 0.0 for period in range(300)]
    assert all(_periods(few, thresholds, 1, error) is LockState.LOCKED for error in knocks)


def test_a_lock_that_a_ramp_shakes_off_is_sought_again_and_not_a_loss():
    lock, thresholds = _lock()
    _periods(lock, thresholds, 10, 0.0)
    assert _periods(lock, thresholds, 100, 50.0, held=False) is LockState.ACQUIRING
    assert _periods(lock, thresholds, 10, 0.0) is LockState.LOCKED


def test_a_phase_that_swings_in_a_ramp_that_waits_for_it_is_a_lost_lock():
    swing_deg = 80.0 * np.sin(2 * np.pi * (np.arange(200) + 0.5) / 9)
    for waits, expected in ((True, LockState.LOST), (False, LockState.ACQUIRING)):
        lock, thresholds = _lock()
        _periods(lock, thresholds, 10, 0.0)
        states = [_periods(lock, thresholds, 1, error, held=False, waits=waits) for error in swing_deg]
        assert states[-1] is expected
    lagging, _ = _lock()
    _periods(lagging, thresholds, 10, 0.0)
    assert _periods(lagging, thresholds, 500, 50.0, held=False, waits=True) is LockState.ACQUIRING
    assert _periods(lagging, thresholds, 10, 0.0, held=False, waits=True) is LockState.LOCKED


def test_a_large_error_before_the_first_lock_is_no_loss():
    lock, thresholds = _lock()
    assert _periods(lock, thresholds, 500, 90.0) is LockState.ACQUIRING


def test_a_lock_whose_signals_vanish_is_lost():
    lock, thresholds = _lock()
    _periods(lock, thresholds, 10, 0.0)
    assert _periods(lock, thresholds, 20, 0.0, present=False) is LockState.LOST

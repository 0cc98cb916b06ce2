import numpy as np
import pytest

from tests.reference.harmonic_balance import backbone_at_voltages
from tests.reference.parameters import ONE_SIDED, SYMMETRIC
from tests.reference.sign_detector import detector_output, mean_sign_product, sign_lock
from tests.reference.time_integration import TimeDomain

THETA = 2 * np.pi * np.arange(2048) / 2048


@pytest.mark.parametrize("shift_deg", [0.0, 30.0, 90.0, 133.3, 180.0])
def test_two_sines_give_the_triangle_over_their_lag(shift_deg: float) -> None:
    mean = mean_sign_product(np.cos(THETA + 0.1), np.cos(THETA + 0.1 - np.radians(shift_deg)))
    assert mean == pytest.approx(1 - shift_deg / 90, abs=1e-5)


def test_a_third_harmonic_in_quadrature_moves_the_zero_by_its_closed_form() -> None:
    # sin t + a cos 3t against a sine shifted by the crossing: cos c = a cos 3c has its root nearest pi/2 here
    a = 0.2
    signal = np.cos(THETA) + a * np.sin(3 * THETA)
    crossings = np.roots([4 * a, 0.0, -3 * a, 0.0])
    assert crossings.size == 3
    # cos t + a sin 3t = cos t (1 + a (sin 3t / cos t)); with t = pi/2 + d: -sin d - a cos 3d = 0
    lo, hi = -1.0, 0.0
    for _ in range(60):
        mid = 0.5 * (lo + hi)
        lo, hi = (mid, hi) if -np.sin(mid) - a * np.cos(3 * mid) > 0 else (lo, mid)
    assert mean_sign_product(signal, -np.sin(THETA + np.pi - hi)) == pytest.approx(0.0, abs=1.0)


def test_small_levels_are_hardly_biased() -> None:
    for rig in (ONE_SIDED, SYMMETRIC):
        assert abs(sign_lock(rig, [0.05])[0].lag_deg + 90.0) < 0.2


def test_the_one_sided_magnet_biases_the_lock_by_tens_of_degrees() -> None:
    voltages = [0.17, 0.52, 0.9, 1.25, 1.5, 1.8, 2.1]
    locked, resonant = sign_lock(ONE_SIDED, voltages), backbone_at_voltages(ONE_SIDED, voltages)
    errors = np.array([abs(state.lag_deg + 90.0) for state in locked])
    assert 25.0 < errors.max() < 31.0
    shifts = [one.frequency_hz / other.frequency_hz - 1 for one, other in zip(locked, resonant, strict=True)]
    assert max(map(abs, shifts)) == pytest.approx(2.6e-3, abs=1e-4)
    assert all(abs(detector_output(state)) < 1e-6 for state in locked)


def test_the_settled_rig_in_time_agrees_that_the_detector_reads_zero() -> None:
    state = sign_lock(ONE_SIDED, [1.0, 2.1])[-1]
    domain = TimeDomain(ONE_SIDED, state.voltage_v, state.omega_rad_s)
    states = domain.with_return_map(60)
    force = domain.force_n(states)
    order = np.arange(states.shape[0] // 2)
    spectrum = domain.harmonics(states @ domain.drive_row) * order**2
    minus_acceleration = np.fft.irfft(np.append(spectrum, 0.0) * states.shape[0] / 2, states.shape[0])
    assert abs(mean_sign_product(force - force.mean(), minus_acceleration)) < 2e-3

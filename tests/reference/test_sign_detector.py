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


def test_a_third_harmonic_shifts_the_detector_by_its_zero_crossings() -> None:
    # cos t + a sin 3t crosses zero at pi/2 + d and 3 pi/2 + d where sin d = -a cos 3d
    d = -0.1
    signal = np.cos(THETA) - np.sin(d) / np.cos(3 * d) * np.sin(3 * THETA)
    assert mean_sign_product(signal, np.cos(THETA - d)) == pytest.approx(1.0, abs=1e-5)
    assert mean_sign_product(signal, np.sin(THETA - d)) == pytest.approx(0.0, abs=1e-5)
    assert mean_sign_product(signal, np.sin(THETA)) == pytest.approx(2 * d / np.pi, abs=1e-5)


def test_small_levels_are_hardly_biased() -> None:
    for rig in (ONE_SIDED, SYMMETRIC):
        assert abs(sign_lock(rig, [0.05])[0].lag_deg + 90.0) < 0.2


def test_the_one_sided_magnet_biases_the_lock_by_tens_of_degrees() -> None:
    voltages = [0.17, 0.52, 1.25, 2.1]
    locked, resonant = sign_lock(ONE_SIDED, voltages), backbone_at_voltages(ONE_SIDED, voltages)
    errors = np.array([state.lag_deg + 90.0 for state in locked])
    # ahead at low level, far behind at high level: the documents give 2 to 31 degrees and 0.26 % of frequency
    assert 5.0 < errors.max() < 20.0
    assert -31.0 < errors.min() < -20.0
    shifts = [one.frequency_hz / other.frequency_hz - 1 for one, other in zip(locked, resonant, strict=True)]
    assert max(map(abs, shifts)) == pytest.approx(2.6e-3, abs=5e-4)
    assert all(abs(detector_output(state)) < 1e-6 for state in locked)


def test_the_settled_rig_in_time_agrees_that_the_detector_reads_zero() -> None:
    state = sign_lock(ONE_SIDED, [2.1])[0]
    domain = TimeDomain(ONE_SIDED, state.voltage_v, state.omega_rad_s)
    states = domain.with_return_map(60)
    force = domain.force_n(states)
    order = np.arange(states.shape[0] // 2)
    spectrum = domain.harmonics(states @ domain.drive_row) * order**2
    minus_acceleration = np.fft.irfft(np.append(spectrum, 0.0) * states.shape[0] / 2, states.shape[0])
    assert abs(mean_sign_product(force - force.mean(), minus_acceleration)) < 2e-3

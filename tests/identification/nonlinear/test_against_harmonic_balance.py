"""Sampled periodic states of the coupled rig, exciter included, against what harmonic balance says of them."""

from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator

from identification import Backbone, Channel, NonlinearMode, PeriodicVibration, nonlinear_mode, periodic_vibration
from tests.identification.rigs import sampled
from tests.reference.harmonic_balance import Periodic, backbone
from tests.reference.parameters import ONE_SIDED, SYMMETRIC

FORCES_N = (0.026, 0.05, 0.1, 0.2, 0.3, 0.4, 0.48, 0.56)
RIGS = {"one-sided": ONE_SIDED, "symmetric": SYMMETRIC}
CHANNELS = (Channel("force", "force", "N"), Channel("drive", "drive", "m/s2"))
RATE_HZ = 5000.0


@cache
def states(rig: str, lag_deg: float = -90.0) -> tuple[Periodic, ...]:
    return tuple(backbone(RIGS[rig], FORCES_N, lag_deg))


def recorded(state: Periodic) -> PeriodicVibration:
    theta = np.arange(8000) / RATE_HZ * state.omega_rad_s
    acceleration = state.drive_m * (1j * state.omega_rad_s * np.arange(state.drive_m.size)) ** 2
    samples = sampled(np.array([state.force_n, acceleration]), theta)
    return periodic_vibration(theta, samples, CHANNELS, sample_rate_hz=RATE_HZ, harmonics=state.drive_m.size - 1)


def identified(rig: str, measured: Sequence[Periodic]) -> NonlinearMode:
    points = tuple(recorded(state) for state in measured)
    return nonlinear_mode(Backbone(points, rig, RIGS[rig].linear_mode[1]))


@pytest.mark.parametrize("rig", RIGS)
def test_a_sampled_backbone_gives_the_modal_properties_of_harmonic_balance(rig: str) -> None:
    mode = identified(rig, states(rig))
    np.testing.assert_allclose(mode.modal_frequency_hz, [s.frequency_hz for s in states(rig)], rtol=1e-9)
    np.testing.assert_allclose(mode.damping_ratio, [s.damping_ratio for s in states(rig)], rtol=1e-8)
    total = [s.damping_ratio_of_total_power for s in states(rig)]
    np.testing.assert_allclose(mode.damping_ratio_total_power, total, rtol=1e-8)
    np.testing.assert_allclose(mode.phase_lag_deg, 90.0, atol=1e-6)


@pytest.mark.parametrize(("rig", "shift", "last"), [("one-sided", 0.0371, 0.00450), ("symmetric", 0.0374, 0.00449)])
def test_the_whole_backbone_shifts_and_damps_as_documented(rig: str, shift: float, last: float) -> None:
    mode = identified(rig, states(rig))
    assert mode.frequency_shift == pytest.approx(shift, abs=3e-4)
    assert mode.damping_ratio[0] == pytest.approx(0.00400, abs=5e-5)
    assert mode.damping_ratio[-1] == pytest.approx(last, abs=5e-5)


@pytest.mark.parametrize("rig", RIGS)
@pytest.mark.parametrize("error_deg", [-6.0, 6.0])
def test_a_residual_phase_error_is_corrected_for(rig: str, error_deg: float) -> None:
    true = identified(rig, states(rig))
    off = identified(rig, states(rig, -90.0 + error_deg))
    inside = off.modal_amplitude >= true.modal_amplitude[0]
    q = off.modal_amplitude[inside]
    expected_hz = PchipInterpolator(true.modal_amplitude, true.modal_frequency_hz)(q)
    expected_damping = PchipInterpolator(true.modal_amplitude, true.damping_ratio)(q)
    assert q.size >= 7
    assert np.abs(off.frequency_hz[inside] / expected_hz - 1.0).min() > 4e-4, "the error matters if left"
    np.testing.assert_allclose(off.modal_frequency_hz[inside], expected_hz, rtol=3e-5)
    np.testing.assert_allclose(off.damping_ratio[inside], expected_damping, rtol=1e-3)

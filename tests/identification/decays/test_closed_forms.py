"""Decays of oscillators whose frequency and damping over the amplitude are known in closed form."""

import numpy as np
import pytest

from identification import Channel, decay_backbone
from tests.identification.decays.signals import (
    DRIVE,
    FREQUENCY_HZ,
    hardening,
    hardening_by_elliptic_integral,
    hardening_frequency_hz,
    linear,
    rubbing,
)

RATE_HZ = 1280.0


@pytest.mark.parametrize(("damping", "seconds"), [(0.0005, 30.0), (0.004, 8.0), (0.02, 2.0)])
def test_a_linear_oscillator_has_its_frequency_and_damping_at_every_amplitude(damping, seconds):
    mode = decay_backbone([linear(damping, seconds, RATE_HZ)], DRIVE, sample_rate_hz=RATE_HZ).mode()
    np.testing.assert_allclose(mode.modal_frequency_hz, FREQUENCY_HZ, rtol=1e-6)
    np.testing.assert_allclose(mode.damping_ratio, damping, rtol=2e-4)
    expected = np.exp(-damping * 2.0 * np.pi * FREQUENCY_HZ * mode.time_s)
    np.testing.assert_allclose(mode.amplitude_m, expected, rtol=2e-4)


def test_harmonic_balance_of_the_tests_agrees_with_elliptic_integrals():
    for start_m in (0.05, 0.2, 0.5):
        frequency_hz, fundamental_m = hardening_by_elliptic_integral(start_m)
        np.testing.assert_allclose(hardening_frequency_hz(fundamental_m), frequency_hz, rtol=1e-7)


@pytest.mark.parametrize("motion", ["displacement", "acceleration"])
@pytest.mark.parametrize(("damping", "accuracy"), [(0.002, 1e-4), (0.006, 2e-4)])
def test_a_cubic_oscillator_has_its_conservative_backbone_and_its_damping_over_a_decade(damping, accuracy, motion):
    x, a = hardening(damping, 2.8 / (damping * 2.0 * np.pi * FREQUENCY_HZ) + 0.5, RATE_HZ)
    unit, signal = ("m", x) if motion == "displacement" else ("m/s2", a)
    mode = decay_backbone([signal], [Channel("drive", "drive", unit)], sample_rate_hz=RATE_HZ).mode()
    assert mode.amplitude_m[0] > 8.0 * mode.amplitude_m[-1]
    assert mode.modal_frequency_hz[0] > 1.06 * FREQUENCY_HZ
    frequency_hz = hardening_frequency_hz(mode.amplitude_m)
    np.testing.assert_allclose(mode.modal_frequency_hz, frequency_hz, rtol=accuracy)
    np.testing.assert_allclose(mode.damping_ratio, damping * FREQUENCY_HZ / frequency_hz, rtol=5e-3)


def test_coulomb_friction_adds_damping_inversely_to_the_amplitude():
    damping, friction_m = 0.001, 0.0005
    x = rubbing(damping, friction_m, 13.0, RATE_HZ)
    mode = decay_backbone([x], DRIVE, sample_rate_hz=RATE_HZ).mode()
    known = mode.amplitude_m > 0.05
    assert mode.amplitude_m[0] > 8.0 * mode.amplitude_m[known][-1]
    expected = damping + 2.0 * friction_m / (np.pi * mode.amplitude_m)
    np.testing.assert_allclose(mode.damping_ratio[known], expected[known], rtol=0.01)
    assert np.all(np.abs(mode.damping_ratio - expected) < mode.damping_ratio_bound_95)
    np.testing.assert_allclose(mode.modal_frequency_hz[known], FREQUENCY_HZ, rtol=1e-4)


def test_a_drifting_offset_and_harmonics_of_the_sensor_have_no_effect():
    x = linear(0.004, 8.0, RATE_HZ)
    seen = x + 0.05 * x**2 + 0.03 * x**3 + 0.5 + 0.1 * np.linspace(0.0, 1.0, x.size)
    mode = decay_backbone([seen], DRIVE, sample_rate_hz=RATE_HZ, near_hz=FREQUENCY_HZ).mode()
    np.testing.assert_allclose(mode.modal_frequency_hz, FREQUENCY_HZ, rtol=2e-6)
    low = mode.amplitude_m < 0.1  # at larger amplitudes the sensor's cubic term is in the fundamental
    np.testing.assert_allclose(mode.damping_ratio[low], 0.004, rtol=1e-3)


def test_harmonics_of_the_displacement_are_those_of_the_vibration():
    x, _ = hardening(0.004, 6.0, RATE_HZ)
    mode = decay_backbone([x], DRIVE, sample_rate_hz=RATE_HZ).mode()
    ratio = mode.harmonics_m[:, 3] / mode.harmonics_m[:, 1]
    squared = (mode.modal_frequency_hz / FREQUENCY_HZ) ** 2
    expected = 0.25 * mode.amplitude_m**2 / (9.0 * squared - 1.0)  # balance of the third harmonic, first order
    np.testing.assert_allclose(ratio[5:].real, expected[5:], rtol=0.05)

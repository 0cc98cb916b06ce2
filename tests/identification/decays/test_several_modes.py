"""Several modes in one decay are evaluated one by one, or refused where they cannot be told apart."""

import numpy as np
import pytest

from identification import Channel, IdentificationError, decay_backbone
from tests.identification.decays.signals import linear
from tests.refused import refused

RATE_HZ = 1000.0
CHANNELS = (Channel("a", "drive", "m"), Channel("b", "response", "m"))


def two_modes(second_hz, noise=1e-4):
    first = linear(0.003, 20.0, RATE_HZ, frequency_hz=15.0)
    second = linear(0.004, 20.0, RATE_HZ, amplitude=0.3, frequency_hz=second_hz, phase=1.0)
    first = first + 0.05 * first**2
    clean = np.array([first + second, 0.8 * first - second])
    return clean + noise * np.random.default_rng(0).normal(size=clean.shape)


@pytest.mark.parametrize("second_hz", [18.0, 22.0, 27.0, 40.0, 71.3])
@pytest.mark.parametrize("named", [False, True])
def test_both_of_two_modes_are_found_with_their_frequency_and_damping(second_hz, named):
    near = [15.0, second_hz] if named else None
    found = decay_backbone(two_modes(second_hz), CHANNELS, sample_rate_hz=RATE_HZ, near_hz=near)
    assert len(found.modes) == 2
    for mode, frequency_hz, damping in zip(found.modes, (15.0, second_hz), (0.003, 0.004), strict=True):
        upper = slice(0, 7)
        np.testing.assert_allclose(mode.modal_frequency_hz[upper], frequency_hz, rtol=2e-4)
        np.testing.assert_allclose(mode.damping_ratio[upper], damping, rtol=0.03)
    np.testing.assert_allclose(found.modes[0].deflection[:8, 1], 0.8, atol=0.01)
    np.testing.assert_allclose(found.modes[1].deflection[:8, 1], -1.0, atol=0.03)


@pytest.mark.parametrize("second_hz", [29.7, 30.0, 30.4])
def test_a_mode_near_twice_the_frequency_of_another_is_refused_if_it_is_named(second_hz):
    with refused(IdentificationError, "near-harmonic-of-the-mode-at", field="near_hz"):
        decay_backbone(two_modes(second_hz), CHANNELS, sample_rate_hz=RATE_HZ, near_hz=[15.0, second_hz])


def test_a_mode_near_twice_the_frequency_of_another_does_not_disturb_it_and_is_noted():
    found = decay_backbone(two_modes(30.0), CHANNELS, sample_rate_hz=RATE_HZ)
    assert len(found.modes) == 1
    assert any("harmonic 2 of the mode" in note for note in found.notes)
    np.testing.assert_allclose(found.mode().modal_frequency_hz[:8], 15.0, rtol=1e-5)
    np.testing.assert_allclose(found.mode().damping_ratio[:8], 0.003, rtol=2e-3)


def test_a_mode_detuned_from_twice_the_frequency_is_kept_apart():
    found = decay_backbone(two_modes(33.0), CHANNELS, sample_rate_hz=RATE_HZ, near_hz=[15.0, 33.0])
    np.testing.assert_allclose(found.mode(33.0).damping_ratio[:6], 0.004, rtol=0.03)


def test_modes_that_no_filter_separates_are_refused_with_both_frequencies():
    with refused(IdentificationError, "hz-are-too-close-leads-to", field="near_hz"):
        decay_backbone(two_modes(15.6), CHANNELS, sample_rate_hz=RATE_HZ, near_hz=[15.0, 15.6])


def test_one_of_several_modes_has_to_be_named():
    found = decay_backbone(two_modes(40.0), CHANNELS, sample_rate_hz=RATE_HZ)
    with refused(IdentificationError, "the-decay-has-modes-hz-hz", field="near_hz"):
        found.mode()
    assert found.mode(39.0).modal_frequency_hz[0] == pytest.approx(40.0, rel=1e-3)
    with refused(IdentificationError, "that-of-one-mode", field="drive_mode_shape"):
        decay_backbone(two_modes(40.0), CHANNELS, sample_rate_hz=RATE_HZ, drive_mode_shape=1.0)

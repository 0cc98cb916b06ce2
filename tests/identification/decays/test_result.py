"""What a decay hands out: a nonlinear mode, a table, arrays for a file."""

import numpy as np
import pytest

from identification import (
    DecayBackbone,
    IdentificationError,
    ModalProperties,
    decay_backbone,
    frequency_response,
)
from identification.storage import decode, encode
from tests.identification.decays.signals import DRIVE, FREQUENCY_HZ, linear
from tests.refused import refused

SHAPE = 0.8


@pytest.fixture(scope="module")
def found():
    x = 1e-3 * linear(0.004, 8.0, 1280.0) + 1e-7 * np.random.default_rng(0).normal(size=int(8.0 * 1280.0))
    return decay_backbone([x], DRIVE, sample_rate_hz=1280.0, drive_mode_shape=SHAPE, specimen="one mass")


def test_the_nonlinear_mode_of_a_decay_predicts_the_resonance(found):
    mode = found.nonlinear_mode()
    assert mode.source == "free decay"
    properties = ModalProperties.of(mode)
    np.testing.assert_allclose(properties.frequency_rad_s(1e-4), 2.0 * np.pi * FREQUENCY_HZ, rtol=1e-5)
    peak = SHAPE * frequency_response(mode, force_n=0.05).modal_amplitude.max()
    omega = 2.0 * np.pi * FREQUENCY_HZ
    np.testing.assert_allclose(peak, SHAPE**2 * 0.05 / (2.0 * 0.004 * omega**2), rtol=5e-3)


def test_the_force_of_the_nonlinear_mode_holds_the_amplitude_at_resonance(found):
    mode = found.nonlinear_mode()
    omega = 2.0 * np.pi * mode.modal_frequency_hz
    np.testing.assert_allclose(mode.force_n, 2.0 * mode.damping_ratio * omega**2 * mode.amplitude_m / SHAPE**2)
    width = np.diff(mode.interval("damping_ratio"), axis=1)[:, 0]
    half = 1.96 * found.mode().damping_ratio_std + found.mode().damping_ratio_systematic
    np.testing.assert_allclose(width, 2.0 * half)


def test_arrays_and_attributes_make_the_same_decay_again(found):
    again = decode(DecayBackbone, *encode(found))
    assert again.mode().table() == found.mode().table()
    assert again.channels == found.channels
    assert again.specimen == "one mass"


def test_what_is_missing_is_named(found):
    arrays, attributes = encode(found)
    del arrays["mode_0/time_s"]
    with refused(IdentificationError, "mode-time-s-is-missing", where="decay mode mode_0"):
        decode(DecayBackbone, arrays, attributes)


def test_a_decay_shows_itself_as_a_table(found):
    assert "modal frequency Hz" in found._repr_mimebundle_()["text/plain"]
    assert set(found.mode().table()[0]) >= {"amplitude_m", "damping_ratio_bound_95", "modal_frequency_bound_95_hz"}

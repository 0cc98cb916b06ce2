"""Two modes 1 % apart that one motion without known errors cannot tell apart: the misfit of the single mode is said."""

import numpy as np
import pytest

from identification.channels import Channel
from identification.linear.modal_analysis import linear_modes
from identification.linear.response_matrix import FrequencyResponseMatrix

FREQUENCY_HZ = np.arange(10.0, 200.0, 0.25)


def accelerance(modes, noise=1e-3, seed=1):
    """Accelerance of modes (Hz, damping ratio) with a mass of 1 kg each, with noise of a share of its RMS."""
    s = 2j * np.pi * FREQUENCY_HZ
    value = sum(s**2 / (s**2 + 4 * np.pi * z * f * s + (2 * np.pi * f) ** 2) for f, z in modes)
    normal = np.random.default_rng(seed).standard_normal((2, s.size)) / np.sqrt(2.0)
    value = value + noise * np.sqrt(np.mean(np.abs(value) ** 2)) * (normal[0] + 1j * normal[1])
    return FrequencyResponseMatrix(
        outputs=(Channel("drive", "drive", "m/s^2"),),
        inputs=(Channel("force", "force", "N"),),
        frequency_hz=FREQUENCY_HZ,
        value=value[:, None, None],
    )


@pytest.mark.parametrize("noise", [1e-4, 1e-3])
def test_one_mode_fitted_to_two_that_are_close_says_that_its_misfit_is_no_noise(noise):
    found = linear_modes(accelerance([(80.0, 0.01), (80.8, 0.012)], noise))
    mode = found.nearest(80.0)
    if abs(found.damping_ratio[mode] - 0.01) > 4.0 * found.damping_ratio_std[mode]:
        assert any("another mode nearby" in note for note in found.notes)


@pytest.mark.parametrize("noise", [1e-4, 1e-3, 1e-2])
def test_a_single_mode_in_noise_is_not_suspected(noise):
    found = linear_modes(accelerance([(80.0, 0.01)], noise))
    assert found.damping_ratio == pytest.approx([0.01], abs=4.0 * found.damping_ratio_std[0])
    assert not any("another mode nearby" in note for note in found.notes)

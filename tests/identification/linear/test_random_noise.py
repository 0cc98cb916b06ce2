"""A modal test with random noise: an exactly linear oscillator is found within its errors, from the band that was excited."""

import numpy as np
import pytest
from scipy import signal

from identification.channels import Channel
from identification.linear.accelerance import pooled
from identification.linear.auto_regression import regressed_responses
from identification.linear.modal_analysis import linear_modes

RATE_HZ, SAMPLES, OVER = 2048.0, 4096, 8
FORCE = Channel("force", "force", "N")
NUMERATOR = {"m": [0.5], "m/s^2": [0.5, 0.0, 0.0]}  # of a mass of 2 kg


def responses_to_noise(seed, *, unit="m", noise=1e-3, band_hz=(20.0, 300.0), hertz=90.0, damping_ratio=0.01):
    """Responses of an oscillator that SciPy integrates at eight times the rate, with noise in the motion."""
    generator = np.random.default_rng(seed)
    rate = OVER * RATE_HZ
    sections = signal.butter(4, band_hz, "bandpass", fs=rate, output="sos")
    force = signal.sosfilt(sections, generator.standard_normal(OVER * SAMPLES))
    omega = 2.0 * np.pi * hertz
    system = (NUMERATOR[unit], [1.0, 2.0 * damping_ratio * omega, omega**2])
    numerator, denominator, _ = signal.cont2discrete(system, 1.0 / rate, method="foh")
    motion = signal.lfilter(numerator.ravel(), denominator, force)[::OVER]
    motion = motion + noise * np.std(motion) * generator.standard_normal(SAMPLES)
    return regressed_responses(
        [(force[None, ::OVER], motion[None])],
        sample_rate_hz=RATE_HZ,
        inputs=[FORCE],
        outputs=[Channel("drive", "drive", unit)],
    )


@pytest.mark.parametrize("seed", range(6))
def test_a_linear_oscillator_is_found_within_its_errors_and_called_linear(seed):
    found = linear_modes(responses_to_noise(seed))
    mode = found.nearest(90.0)
    assert abs(found.frequency_hz[mode] - 90.0) < 4.0 * found.frequency_std_hz[mode]
    assert abs(found.damping_ratio[mode] - 0.01) < 4.0 * found.damping_ratio_std[mode]
    assert found.damping_ratio_std[mode] < 1e-4
    assert found.drive_shape[mode] == pytest.approx(np.sqrt(0.5), rel=2e-3)
    assert not any("distortion" in note for note in found.notes)


@pytest.mark.parametrize("noise", [0.0, 1e-3])
@pytest.mark.parametrize("unit", NUMERATOR)
def test_clean_records_end_in_no_error_of_the_numbers(noise, unit):
    for seed, band_hz in ((0, (0.1, 700.0)), (1, (20.0, 300.0)), (2, (40.0, 160.0))):
        found = linear_modes(responses_to_noise(seed, unit=unit, noise=noise, band_hz=band_hz))
        assert found.frequency_hz[found.nearest(90.0)] == pytest.approx(90.0, rel=1e-3)


@pytest.mark.parametrize("band_hz", [(20.0, 300.0), (40.0, 160.0)])
def test_no_line_far_outside_the_excited_band_is_fitted(band_hz):
    frequency = responses_to_noise(0, band_hz=band_hz).frequency_hz
    assert 0.3 * band_hz[0] < frequency[0] < 1.1 * band_hz[0]
    assert 0.9 * band_hz[1] < frequency[-1] < 1.8 * band_hz[1]


def test_weights_of_lines_whose_errors_differ_by_many_decades_can_be_inverted():
    variance = np.logspace(0.0, -18.0, 400)[:, None, None].astype(np.complex128)
    assert np.linalg.eigvalsh(pooled(variance)).min() > 0.0
    assert np.all(np.isfinite(np.linalg.inv(pooled(variance))))

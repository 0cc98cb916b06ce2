"""What rounding leaves in Fourier coefficients, against rounded records of vibrations between other two steps each time."""

import numpy as np
import pytest

from identification import Channel, IdentificationError, periodic_vibration
from identification.signals.rounding import rounding_errors

CHANNELS = (Channel("force", "force", "N"), Channel("drive", "drive", "m/s2"))
HARMONICS = np.array([0.0, 1.0, 0.2, 0.05j])


def record(
    peak_steps: float, noise_steps: float, offset: float, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Phase and a record rounded to whole numbers, 205.17 samples a period, fifty periods."""
    theta = 2.0 * np.pi * np.arange(10_260) / 205.17
    exact = offset + np.real(np.exp(1j * np.outer(theta, np.arange(4))) @ (peak_steps * HARMONICS))
    return theta, np.round(exact + noise_steps * rng.standard_normal(theta.size))


@pytest.mark.parametrize(("peak_steps", "noise_steps"), [(9.6, 0.05), (9.6, 0.17), (3.3, 0.1)])
def test_rounding_errors_are_those_of_rounded_records(peak_steps: float, noise_steps: float) -> None:
    rng = np.random.default_rng(3)
    errors = []
    for offset in np.linspace(-0.5, 0.5, 60, endpoint=False):
        theta, rounded = record(peak_steps, noise_steps, offset, rng)
        found = periodic_vibration(theta, [rounded, rounded], CHANNELS, sample_rate_hz=5000.0, harmonics=3)
        errors.append(found.harmonics[0, 1:] - peak_steps * HARMONICS[1:])
    seen = np.sqrt(0.5 * np.mean(np.abs(errors) ** 2, axis=0))
    residual = np.sqrt(noise_steps**2 + 1.0 / 12.0)
    stated = rounding_errors(peak_steps * HARMONICS[None], np.ones(1), np.array([residual]))[0, 1:]
    np.testing.assert_allclose(seen, stated, rtol=0.25)


def test_noise_of_half_a_step_leaves_nothing_of_it_and_no_step_is_no_rounding() -> None:
    peak = 9.6 * HARMONICS[None]
    assert np.all(rounding_errors(peak, np.ones(1), np.array([np.hypot(0.6, 0.29)])) == 0.0)
    assert np.all(rounding_errors(peak, np.zeros(1), np.array([0.3])) == 0.0)


def test_the_scatter_of_a_record_does_not_know_of_the_rounding_that_its_standard_error_counts() -> None:
    theta, rounded = record(9.6, 0.05, 0.2, np.random.default_rng(4))
    options = {"sample_rate_hz": 5000.0, "harmonics": 3}
    blind = periodic_vibration(theta, [rounded, rounded], CHANNELS, **options)
    known = periodic_vibration(theta, [rounded, rounded], CHANNELS, resolution=[1.0, 0.0], **options)
    assert known.harmonics_std[0, 1] > 3.0 * blind.harmonics_std[0, 1]
    np.testing.assert_array_equal(known.harmonics_std[1], blind.harmonics_std[1])


@pytest.mark.parametrize("resolution", [[1.0], [1.0, -1.0]])
def test_steps_that_do_not_fit_are_named(resolution: list[float]) -> None:
    theta, rounded = record(9.6, 0.05, 0.2, np.random.default_rng(5))
    with pytest.raises(IdentificationError, match=r"resolution: is .* needs 2 numbers of 0 or above"):
        periodic_vibration(theta, [rounded, rounded], CHANNELS, sample_rate_hz=5000.0, resolution=resolution)

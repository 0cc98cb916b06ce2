"""Standard errors of the plant's mode: against the scatter of fits to many noisy responses, and against the rigs' own modes."""

import math
from dataclasses import replace

import numpy as np
import pytest

from controller.tuning import PlantModel
from tests.controller.tuning.rigs import LINEAR_HZ, responses, shipped
from tests.refused import refused

RATE = {"sample_rate_hz": 5000.0, "latency_samples": 2.0}
PROPERTIES = {
    "frequency_rad_s": "frequency_std_rad_s",
    "damping_ratio": "damping_ratio_std",
    "drive_shape": "drive_shape_std",
}
DRAWS = 100
NOISE = 0.01


def fits(name, told, correlation=0.6j, seed=0):
    """Values and standard errors [draws, 3] of fits to responses with noise; its covariance, times ``told``, is given."""
    frequency, force, acceleration = responses(name)
    rms = [NOISE * math.sqrt(float(np.mean(np.abs(values) ** 2))) for values in (force, acceleration)]
    one = np.outer(rms, rms) * np.array([[1.0, correlation], [np.conj(correlation), 1.0]])
    covariance = None if told is None else np.broadcast_to(told * one, (frequency.size, 2, 2))
    rng, lower = np.random.default_rng(seed), np.linalg.cholesky(one)
    values, errors = [], []
    for _ in range(DRAWS):
        white = rng.standard_normal((2, frequency.size, 2)) / math.sqrt(2.0)
        noise = (white[0] + 1j * white[1]) @ lower.T
        measured = force + noise[:, 0], acceleration + noise[:, 1]
        found = PlantModel.from_frequency_responses(frequency, *measured, covariance=covariance, **RATE)
        values.append([getattr(found, key) for key in PROPERTIES])
        errors.append([getattr(found, key) for key in PROPERTIES.values()])
    return np.array(values), np.array(errors)


def truth(name):
    modes = shipped(name).linear_modes
    k = modes.nearest(LINEAR_HZ[name])
    return np.array([2 * math.pi * modes.frequency_hz[k], modes.damping_ratio[k], modes.drive_shape[k]])


@pytest.mark.parametrize("name", ["magnet-beam", "friction-beam"])
def test_the_interval_holds_the_truth_as_often_as_it_says(name):
    values, errors = fits(name, 1.0)
    inside = np.mean(np.abs(values - truth(name)) < 1.96 * errors, axis=0)
    assert np.all(inside > 0.86)  # 0.95 less four standard deviations of a share of a hundred
    assert np.std(values, axis=0) == pytest.approx(np.mean(errors, axis=0), rel=0.3)


def test_without_a_covariance_the_noise_is_taken_from_the_residuals():
    values, errors = fits("magnet-beam", None, correlation=0.0, seed=1)
    assert np.std(values, axis=0) == pytest.approx(np.mean(errors, axis=0), rel=0.25)


@pytest.mark.slow
def test_a_misfit_beyond_the_stated_noise_increases_the_errors():
    """A covariance that is a hundred times too small is corrected by the ratio of the costs."""
    _, stated = fits("magnet-beam", 1.0, correlation=0.0)
    _, too_small = fits("magnet-beam", 0.01, correlation=0.0)
    assert np.mean(too_small, axis=0) == pytest.approx(np.mean(stated, axis=0), rel=0.1)


def test_a_covariance_of_another_shape_is_refused():
    frequency, force, acceleration = responses("magnet-beam")
    with refused(ValueError, "shape", field="covariance", allowed="finite numbers of shape (201, 2, 2)"):
        PlantModel.from_frequency_responses(frequency, force, acceleration, covariance=np.ones(3), **RATE)


def test_a_negative_standard_error_is_refused():
    with refused(ValueError, field="drive_shape_std", value=-1.0, allowed="0 or more"):
        replace(PlantModel.from_frequency_responses(*responses("magnet-beam"), **RATE), drive_shape_std=-1.0)

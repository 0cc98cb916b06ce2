"""An exciter without a moving mass is found, and how well it is told from the structure is said, against a closed form."""

import math

import numpy as np
import pytest

from controller.tuning import PlantModel
from controller.tuning.plant_fit import _alpha_std

FREQUENCY_RAD_S, RATE_HZ = 157.0, 5000.0
VOLTS_PER_NEWTON = 0.5


def fitted(seed, damping, noise, mass_kg=0.0, shape=1.0, prior=0.3):
    """Plant as fitted to the responses of a force source with a moving mass, with circular noise of this relative size."""
    rng = np.random.default_rng(seed)
    frequency_hz = np.arange(15.0, 40.0, 0.05)
    s = 2j * np.pi * frequency_hz
    accelerance = shape**2 * s**2 / (s**2 + 2.0 * damping * FREQUENCY_RAD_S * s + FREQUENCY_RAD_S**2)
    force = 1.0 / (VOLTS_PER_NEWTON * (1.0 + mass_kg * accelerance))
    true = np.stack([force, accelerance * force])
    std = noise * np.abs(true)
    white = rng.standard_normal((2, *true.shape)) / math.sqrt(2.0)
    value = true + std * (white[0] + 1j * white[1])
    return PlantModel.from_frequency_responses(
        frequency_hz,
        *value,
        sample_rate_hz=RATE_HZ,
        latency_samples=1.0,
        force_std=np.hypot(std[0], 0.02 * np.abs(value[0])),
        acceleration_std=np.hypot(std[1], 0.02 * np.abs(value[1])),
        covariance=np.einsum("ik,ij->kij", std**2, np.eye(2)).astype(np.complex128),
        exciter_prior=prior,
    )


def alpha(plant):
    return complex(plant.exciter(1j * plant.frequency_rad_s)[0])


@pytest.mark.parametrize("damping", [0.002, 0.005, 0.01])
@pytest.mark.parametrize("shape", [0.4, 1.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_force_source_is_not_put_down_to_a_tuned_mass(damping, shape, seed):
    found = fitted(seed, damping, 1e-3, shape=shape)
    assert abs(alpha(found) - VOLTS_PER_NEWTON) < 0.1 * VOLTS_PER_NEWTON


@pytest.mark.parametrize("noise", [1e-3, 1e-2])
@pytest.mark.parametrize("mass_kg", [0.0, 0.3])
def test_the_interval_of_alpha_holds_the_truth_where_no_prior_helps(mass_kg, noise):
    errors = []
    for seed in range(6):
        found = fitted(seed, 0.005, noise, mass_kg, prior=None)
        errors.append(abs(alpha(found) - VOLTS_PER_NEWTON) / found.force_v_n_std)
    assert np.mean(np.square(errors)) < 3.0  # 1 on average; of both parts together
    assert max(errors) < 3.0


@pytest.mark.parametrize("covariance", [np.full((4, 4), np.nan), np.full((4, 4), np.inf), 1e30 * np.eye(4), -np.eye(4)])
def test_an_alpha_that_the_lines_do_not_determine_has_an_error_far_above_itself(covariance):
    std = _alpha_std(np.array([0.5, 0.0, 0.0, 0.0]), covariance, 1.0)
    assert std == pytest.approx(500.0)


def test_the_error_of_alpha_is_that_of_its_two_parts():
    std = _alpha_std(np.array([0.5, 0.0, 0.0, 0.0]), np.diag([9.0, 16.0, 0.0, 0.0]), 1.0)
    assert std == pytest.approx(5.0)

"""The plant near a mode, against the rigs' own modes and frequency responses."""

import math

import numpy as np
import pytest

from controller.tuning import PlantModel, plant_fit
from tests.controller.tuning.rigs import LINEAR_HZ, plant_of, responses, shipped
from tests.refused import refused

NAMES = ["magnet-beam", "friction-beam"]
RATE = {"sample_rate_hz": 5000.0, "latency_samples": 2.0}


def noisy(values, share, seed):
    draw = np.random.default_rng(seed).normal(size=(2, values.size)) / math.sqrt(2)
    return values + share * np.sqrt(np.mean(np.abs(values) ** 2)) * (draw[0] + 1j * draw[1])


@pytest.mark.parametrize("name", NAMES)
def test_the_mode_of_the_structure_is_found_behind_the_exciter(name):
    plant, modes = plant_of(name), shipped(name).linear_modes
    k = modes.nearest(LINEAR_HZ[name])
    assert plant.frequency_rad_s == pytest.approx(2 * math.pi * modes.frequency_hz[k], rel=1e-5)
    assert plant.damping_ratio == pytest.approx(modes.damping_ratio[k], rel=2e-3)
    assert plant.drive_shape == pytest.approx(shipped(name).drive_shape(LINEAR_HZ[name]), rel=1e-3)


@pytest.mark.parametrize("name", NAMES)
def test_the_coupled_pole_is_that_of_the_rig(name):
    modes = shipped(name).coupled_modes
    k = int(np.argmin(np.abs(modes.frequency_hz - LINEAR_HZ[name])))
    omega, zeta = 2 * math.pi * modes.frequency_hz[k], modes.damping_ratio[k]
    pole = omega * complex(-zeta, math.sqrt(1 - zeta**2))
    assert plant_of(name).coupled_pole_rad_s == pytest.approx(pole, abs=0.02)


def test_the_offsets_of_the_coupled_poles_are_the_known_ones():
    assert plant_of("magnet-beam").pole_offset_rad_s() == pytest.approx(-11.5 + 3.9j, abs=0.1)
    assert plant_of("friction-beam").pole_offset_rad_s() == pytest.approx(-5.8 - 24.2j, abs=0.1)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("seed", range(3))
def test_noise_of_a_percent_leaves_the_plant_usable(name, seed):
    frequency, force, acceleration = responses(name)
    found = PlantModel.from_frequency_responses(
        frequency, noisy(force, 0.01, seed), noisy(acceleration, 0.01, seed + 50), **RATE
    )
    assert found.pole_offset_rad_s() == pytest.approx(plant_of(name).pole_offset_rad_s(), abs=0.15)
    assert found.frequency_rad_s == pytest.approx(plant_of(name).frequency_rad_s, rel=3e-4)
    assert found.damping_ratio == pytest.approx(plant_of(name).damping_ratio, rel=0.05)
    assert found.fit_error == pytest.approx(0.01, rel=0.2)


def with_noise(force, acceleration, share, **options):
    """The plant of responses with noise of a share of each, whose covariance is given."""
    noise = [share * np.sqrt(np.mean(np.abs(values) ** 2)) for values in (force, acceleration)]
    covariance = np.broadcast_to(np.diag(np.square(noise)).astype(complex), (force.size, 2, 2))
    std = {"force_std": noise[0], "acceleration_std": noise[1], "covariance": covariance}
    frequency, _, _ = responses("magnet-beam")
    return PlantModel.from_frequency_responses(
        frequency, noisy(force, share, 7), noisy(acceleration, share, 8), **std, **RATE, **options
    )


@pytest.mark.parametrize("share", [0.01, 0.12])
def test_noise_that_is_known_is_no_error_of_the_fit(share):
    _, force, acceleration = responses("magnet-beam")
    lines = force.size
    assert share / lines**0.25 <= with_noise(force, acceleration, share).fit_error * 1.001
    assert with_noise(force, acceleration, share).fit_error <= 1.5 * share / lines**0.25
    assert with_noise(force, acceleration, share).frequency_rad_s == pytest.approx(
        plant_of("magnet-beam").frequency_rad_s, rel=3e-3
    )


def test_a_second_mode_is_an_error_of_the_fit_whatever_the_noise():
    frequency, force, acceleration = responses("magnet-beam")
    s, w = 2j * np.pi * frequency, 2 * np.pi * 28.0
    more = acceleration + 3.0 * force * s**2 / (s**2 + 0.01 * w * s + w**2)
    errors = [with_noise(force, more, share).fit_error for share in (1e-4, 0.1)]
    assert errors[0] > 0.2
    assert errors[1] == pytest.approx(errors[0], rel=0.15)


def test_the_fit_answers_conjugates_at_negative_frequencies():
    plant, s = plant_of("magnet-beam"), 1j * np.linspace(120.0, 180.0, 7)
    np.testing.assert_allclose(plant.force_per_v(-s), plant.force_per_v(s).conj(), rtol=1e-12)


def test_at_a_lag_the_structure_has_that_lag():
    plant = plant_of("friction-beam")
    for lag_deg in (-150.0, -90.0, -30.0):
        y = complex(plant.accelerance(1j * plant.lock_frequency_rad_s(lag_deg)))
        assert math.degrees(-np.angle(y)) == pytest.approx(lag_deg, abs=1e-6)


def test_another_modal_frequency_moves_the_structure_and_leaves_the_exciter():
    plant = plant_of("friction-beam")
    moved = plant.at(0.98 * plant.frequency_rad_s, 0.0133)
    s = 1j * np.linspace(900.0, 950.0, 5)
    np.testing.assert_allclose(moved.exciter(s), plant.exciter(s))
    relation = moved.exciter(s)[0] * moved.force_per_v(s) + moved.exciter(s)[1] * moved.acceleration_per_v(s)
    np.testing.assert_allclose(relation, 1.0, rtol=1e-12)
    assert moved.lock_frequency_rad_s() == pytest.approx(0.98 * plant.frequency_rad_s, rel=1e-3)


def test_a_plant_without_damping_is_refused():
    with refused(ValueError, field="damping_ratio", value=-0.1):
        plant_of("magnet-beam").at(damping_ratio=-0.1)


def test_a_force_sensor_of_wrong_polarity_is_noticed():
    frequency, force, acceleration = responses("magnet-beam")
    with refused(ValueError, "polarity", field="force_per_v, acceleration_per_v"):
        PlantModel.from_frequency_responses(frequency, -force, acceleration, **RATE)


def test_a_band_without_the_mode_is_refused():
    frequency, force, acceleration = responses("magnet-beam")
    above = frequency > 26.0
    with refused(ValueError, "no-damped-resonance"):
        PlantModel.from_frequency_responses(frequency[above], force[above], acceleration[above], **RATE)


@pytest.mark.parametrize("noise", [0.0, 1e-15, 1e-9, 1e-3, 0.05])
def test_responses_without_a_mode_give_no_plant_whatever_the_rounding_and_the_noise(noise):
    frequency, generator = np.linspace(20.0, 30.0, 200), np.random.default_rng(0)
    force = 1.0 / (0.3 + 0.0008j * frequency)
    for _ in range(10):
        accelerance = (0.5 - 2.0 * (frequency / 25.0) ** 2) * (1.0 + noise * generator.standard_normal(200))
        with refused(ValueError, "no-damped-resonance"):
            PlantModel.from_frequency_responses(frequency, force, accelerance * force, **RATE)


def one_mode(damping_ratio, noise=0.0, seed=0):
    """A mode at 25 Hz of lines 0.05 Hz apart behind a plain exciter, force and acceleration each with their own noise."""
    frequency = np.linspace(20.0, 30.0, 201)
    z = 1j * frequency / 25.0
    accelerance = 0.8 * z**2 / (z**2 + 2.0 * damping_ratio * z + 1.0)
    force = 1.0 / (0.3 + 0.05 * z + 0.01 * accelerance)
    return frequency, noisy(force, noise, seed), noisy(accelerance * force, noise, seed + 50)


@pytest.mark.parametrize("seed", range(8))
def test_a_mode_narrower_than_the_lines_is_found_whatever_sign_noise_gives_its_damping(seed):
    found = PlantModel.from_frequency_responses(*one_mode(1e-6, 1e-3, seed), **RATE)
    assert found.frequency_rad_s == pytest.approx(2 * math.pi * 25.0, rel=1e-3)
    assert 0.0 < found.damping_ratio < 2e-3


@pytest.mark.parametrize("seed", [3, 4])
def test_a_light_mode_is_found_where_its_force_at_resonance_is_far_below_the_noise(seed):
    """The ratio of acceleration to force then has its largest values where the noise wills it."""
    frequency, damping_ratio = np.linspace(47.6, 126.9, 6000), 9.4e-4
    z = 1j * frequency / 79.3
    accelerance = 6.6 * z**2 / (z**2 + 2.0 * damping_ratio * z + 1.0) - 1.5 + 0.03 * z**2
    force = 1.0 / (0.05 + 0.01 * accelerance * (1.0 + (0.58 + 0.02 * z) / z**2))
    acceleration = accelerance * force
    noise = [0.15 * np.median(np.abs(values)) for values in (force, acceleration)]
    assert np.min(np.abs(force)) < 0.1 * noise[0]
    draws = np.random.default_rng(seed).normal(size=(2, 2, frequency.size)) / math.sqrt(2)
    read = [
        values + std * (re + 1j * im) for values, std, (re, im) in zip((force, acceleration), noise, draws, strict=True)
    ]
    stds = [np.hypot(std, 0.02 * np.abs(values)) for values, std in zip(read, noise, strict=True)]
    covariance = np.broadcast_to(np.diag(np.square(noise)).astype(complex), (frequency.size, 2, 2))
    found = PlantModel.from_frequency_responses(
        frequency, *read, force_std=stds[0], acceleration_std=stds[1], covariance=covariance, exciter_prior=0.3, **RATE
    )
    assert found.frequency_rad_s == pytest.approx(2.0 * math.pi * 79.3, rel=1e-3)
    assert found.damping_ratio == pytest.approx(damping_ratio, abs=4.0 * found.damping_ratio_std)
    assert found.damping_ratio_std < 2e-4


@pytest.mark.parametrize("damping_ratio", [0.02, 0.05])
def test_a_mode_wider_than_the_lines_needs_a_damping_above_zero(damping_ratio):
    found = PlantModel.from_frequency_responses(*one_mode(damping_ratio, 1e-4), **RATE)
    assert found.damping_ratio == pytest.approx(damping_ratio, rel=0.02)
    with refused(ValueError, "no-damped-resonance"):
        PlantModel.from_frequency_responses(*one_mode(-damping_ratio, 1e-4), **RATE)


def test_a_fit_goes_by_the_derivatives_of_its_model():
    s, centre, step = 2j * math.pi * np.linspace(15.0, 40.0, 60), 2.0 * math.pi * 24.0, 1e-6
    x = np.array([0.01, -5.0, -0.2, 0.3, 0.1, 0.4, 0.1, -0.3, 0.02, 0.2, 0.06, 0.5, -0.04])
    for name, exact in zip(("force", "acceleration"), plant_fit._derivatives(x, s, centre), strict=True):
        for index, along in enumerate(step * np.eye(x.size)):
            ends = [plant_fit._model(x + sign * along, s, centre)[name == "acceleration"] for sign in (1.0, -1.0)]
            numeric = (ends[0] - ends[1]) / (2.0 * step)
            np.testing.assert_allclose(
                exact[index], numeric, atol=1e-6 * np.abs(numeric).max(), err_msg=f"{name} {index}"
            )

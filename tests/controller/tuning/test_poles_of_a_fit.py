"""Poles of a plant's model beyond the band of its fit do not decide on a loop: they belong to the fit, not to the rig."""

import math
from dataclasses import replace

import numpy as np
import pytest

from controller.tuning import ControlLoop, FrequencyErrorLaw, PlantModel, complex_response_law, unstable_poles

OVER_ALL = PlantModel(
    frequency_rad_s=262.655,
    damping_ratio=0.021203,
    drive_shape=1.9017,
    residual_per_kg=(1.57368, 5.2116),
    force_v_n=(-0.002198, 0.00355349, -0.00383752, 0.00168866),
    acceleration_v_s2_m=(0.00167731, 0.00048348, 0.00349562, -2.01e-05),
    centre_rad_s=262.45,
    band_hz=(25.38, 67.57),
    fit_error=0.054,
    sample_rate_hz=2000.0,
    latency_samples=3.946,
)
"""A drawn rig (a beam with magnets and a joint behind a heavy exciter), fitted over 0.6 to 1.6 of its frequency."""
NARROW = PlantModel(
    frequency_rad_s=262.771,
    damping_ratio=0.0207,
    drive_shape=1.81177,
    residual_per_kg=(0.782853, 3.98337),
    force_v_n=(0.00881262, 0.00342874, 0.00226231, 0.00146323),
    acceleration_v_s2_m=(2.485e-05, 0.000453502, 0.001863997, -1.0094e-05),
    centre_rad_s=262.45,
    band_hz=(38.07, 46.42),
    fit_error=0.015,
    sample_rate_hz=2000.0,
    latency_samples=3.946,
)
"""The same responses, fitted over 0.9 to 1.1."""


def growing_hz(plant):
    poles = plant.poles_rad_s[(plant.poles_rad_s.real > 0.0) & (plant.poles_rad_s.imag > 0.0)]
    return np.sort(poles.imag / (2.0 * math.pi))


def loop_of(plant, times=1.0):
    low_pass = OVER_ALL.frequency_rad_s / 5.0
    law = complex_response_law(plant, low_pass, share=0.375 * times)
    return ControlLoop(plant, low_pass, FrequencyErrorLaw(low_pass / 8.0 * times), law)


def test_two_fits_of_a_rig_differ_in_a_growing_pole_beyond_the_band_and_agree_on_the_loop():
    assert growing_hz(OVER_ALL) == pytest.approx([17.7], abs=0.2)
    assert growing_hz(NARROW).size == 0
    for plant in (OVER_ALL, NARROW):
        assert unstable_poles(loop_of(plant)) == 0
        assert unstable_poles(loop_of(plant, times=8.0)) > 0


def test_a_growing_pole_within_the_band_counts():
    assert unstable_poles(loop_of(replace(OVER_ALL, band_hz=(10.0, 67.57)))) == 2


def test_the_coupled_pole_of_an_overdamped_rig_is_none_of_those_that_a_fit_puts_near_zero():
    plant = replace(OVER_ALL)
    w = plant.frequency_rad_s
    growing, slow, rig, quick = 0.001 * w, -0.06 * w, -0.6 * w, -1.5 * w
    vars(plant)["poles_rad_s"] = np.array([growing, slow, rig, quick, (-0.5 + 2.6j) * w, (-0.5 - 2.6j) * w], complex)
    assert plant.coupled_pole_rad_s == rig

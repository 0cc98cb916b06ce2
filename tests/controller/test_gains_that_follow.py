"""Gains that follow the rig: the slope of the force over the response, and the pole of the plant."""

import math

import numpy as np
import pytest

from controller.amplitude import OUTPUT
from controller.detector import VIBRATION
from controller.response import RESPONSE_LOOP_STATE, ResponseSettings, response_proportional
from controller.through_response import REFERENCE_STATE, ThroughResponseSettings, force_slope

POLE, GAIN = complex(-6.0, -24.0), complex(200.0, 30.0)
DT_S, OMEGA, LAG = 1 / 5000.0, 2 * math.pi * 24.3, -0.5 * math.pi


def _slope_of(responses, forces):
    parameters = ThroughResponseSettings(reference_integral_per_s=5.0).build_reference(DT_S, True)[0]
    state, vibration = np.zeros(1, REFERENCE_STATE)[0], np.zeros(1, VIBRATION)[0]
    for response, force in zip(responses, forces, strict=True):
        vibration["rest_drive_m_s2"], vibration["rest_force_n"] = response, force
        slope = force_slope(parameters, state, vibration, LAG, OMEGA)
    return slope


def _response_loop():
    settings = ResponseSettings(
        response_integral_per_s=60.0,
        plant_pole_rad_s=(POLE.real, POLE.imag),
        plant_gain_per_v=(GAIN.real, GAIN.imag),
    )
    return (
        settings.build_response(1e-4, 10.0, DT_S, 0.01)[0],
        np.zeros(1, RESPONSE_LOOP_STATE)[0],
        np.zeros(1, OUTPUT)[0],
    )


@pytest.mark.parametrize(("power", "expected"), [(3.0, 3.0), (0.6, 1.0), (40.0, 10.0)])
def test_the_slope_is_that_of_a_force_that_goes_with_a_power_of_the_response(power, expected):
    response = 1.0 + 0.05 * np.sin(2 * np.pi * np.arange(5000) / 2500.0)
    assert _slope_of(response, 0.3 * response**power) == pytest.approx(expected, rel=0.01)


def test_a_response_that_keeps_still_has_no_slope_whatever_the_force_does():
    noise = np.random.default_rng(1).normal(0.0, 0.01, 5000)
    assert _slope_of(1.0 + 1e-3 * np.abs(noise), 0.3 + noise) == pytest.approx(1.0, abs=0.3)


def test_the_proportional_gain_cancels_a_pole_that_has_moved_under_the_same_residue():
    parameters, state, output = _response_loop()
    moved = complex(-11.0, -12.0)
    state["plant_ratio"], output["command_phase_rad"], output["amplitude_v"] = 1.0, 0.4, 0.5
    drive = complex(GAIN * -POLE / -moved * 0.5 * np.exp(0.4j))
    for _ in range(20_000):
        kp = response_proportional(parameters, state, drive, output)
    assert kp == pytest.approx(60.0 / -moved, rel=1e-6)


def test_it_follows_within_a_factor_only():
    parameters, state, output = _response_loop()
    state["plant_ratio"] = 50.0
    assert abs(response_proportional(parameters, state, 0j, output)) == pytest.approx(3.0 * 60.0 / abs(POLE), rel=1e-6)

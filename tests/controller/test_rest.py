"""The force that is left at rest, against the equation of one mode whose amplitude grows and turns."""

import cmath
import math

import numpy as np
import pytest

from controller.detector import VIBRATION
from controller.rest import REST_STATE, RestSettings, estimate_steady_force

W, ZETA, SHAPE = 2 * math.pi * 24.37, 0.004, 0.9
OMEGA = 2 * math.pi * 24.3  # of the oscillator
DISPLACEMENT_M = 1e-3


FS, LAG = 5000.0, -0.5 * math.pi


def _records(share, corner=100.0):
    parameters = RestSettings(rest_low_pass_rad_s=corner, rest_share=share).build_rest(FS, SHAPE)
    return parameters[0], np.zeros(1, REST_STATE)[0], np.zeros(1, VIBRATION)[0]


def _seen(rate, share=1.0):
    """What `estimate_steady_force` makes of ``exp(rate t)`` in the oscillator's frame, and the force that it takes exactly."""
    parameters, state, vibration = _records(share)
    s = 1j * OMEGA + rate
    per_x = (s * s + 2 * ZETA * W * s + W * W) / SHAPE**2
    for k in range(1000):
        x = DISPLACEMENT_M * cmath.exp(rate / FS * (k - 1000))
        vibration["force"], vibration["drive"] = per_x * x, s * s * x
        estimate_steady_force(parameters, state, vibration, OMEGA, LAG, 0.0)
    at_rest = (W * W - OMEGA**2 + 2j * ZETA * W * OMEGA) / SHAPE**2 / -(OMEGA**2)  # force over acceleration
    lag = LAG - vibration["rest_error_rad"]
    found = vibration["rest_force_n"] / vibration["rest_drive_m_s2"] * cmath.exp(1j * lag)
    return found, at_rest, per_x / (s * s)


@pytest.mark.parametrize("rate", [0.0, 0.5, -0.5, 0.4j, 0.3 - 0.3j])
def test_what_changes_the_vibration_is_taken_out_of_the_force(rate):
    found, at_rest, measured = _seen(rate)
    assert abs(found - at_rest) < 0.01 * abs(at_rest)
    if rate:
        assert abs(measured - at_rest) > 0.25 * abs(at_rest)  # there was something to be taken out


def test_a_share_of_it_may_be_left():
    found, at_rest, measured = _seen(0.5, share=0.8)
    assert np.isclose((found - at_rest) / (measured - at_rest), 0.2, atol=0.02)


def test_without_a_corner_the_force_is_taken_as_it_is():
    parameters, state, vibration = _records(1.0, corner=0.0)
    vibration["force_n"], vibration["error_rad"] = 0.7, 0.1
    estimate_steady_force(parameters, state, vibration, OMEGA, LAG, 0.0)
    assert (vibration["rest_force_n"], vibration["rest_error_rad"]) == (0.7, 0.1)


def test_a_channel_that_is_late_is_turned_back():
    parameters, state, vibration = _records(1.0)
    for _ in range(1000):
        vibration["force"], vibration["drive"] = 1.0, 2.0 * cmath.exp(1j * (0.5 * math.pi - 0.02))
        estimate_steady_force(parameters, state, vibration, OMEGA, LAG, 0.02)
    assert vibration["rest_error_rad"] == pytest.approx(0.0, abs=1e-9)

"""Gains that follow the rig: the slope of the force over the response, and the pole of the plant."""

import math

import numpy as np
import pytest

from controller import AmplitudeLaw, PhaseLockedLoop
from rig.tick.laws.amplitude.kernels import force_slope, response_proportional
from tests.rig.rigs import bench_with, tick_for

POLE, GAIN = complex(-6.0, -24.0), complex(200.0, 30.0)


def _tick():
    law = PhaseLockedLoop(
        detector="adaptive",
        frequency_law="frequency-error",
        frequency_integral_per_s=3.0,
        rest_low_pass_rad_s=100.0,
        centre_frequency_hz=24.3,
        frequency_window_hz=(22.0, 27.0),
        force_loop="through-response",
        response_integral_per_s=60.0,
        plant_pole_rad_s=(POLE.real, POLE.imag),
        plant_gain_per_v=(GAIN.real, GAIN.imag),
        reference_integral_per_s=5.0,
    )
    return tick_for(bench_with(), 2.0, law=law, amplitude_law=AmplitudeLaw.FORCE)


@pytest.mark.parametrize(("power", "expected"), [(3.0, 3.0), (0.6, 1.0), (40.0, 10.0)])
def test_the_slope_is_that_of_a_force_that_goes_with_a_power_of_the_response(power, expected):
    tick = _tick()
    loop = tick.arrays.loop
    for k in range(5000):
        response = 1.0 + 0.05 * math.sin(2 * math.pi * k / 2500.0)
        loop["rest_response"], loop["rest_force"] = response, 0.3 * response**power
        slope = force_slope(tick.arrays)
    assert slope == pytest.approx(expected, rel=0.01)


def test_a_response_that_keeps_still_has_no_slope_whatever_the_force_does():
    tick = _tick()
    rng = np.random.default_rng(1)
    for noise in rng.normal(0.0, 0.01, 5000):
        tick.arrays.loop["rest_response"], tick.arrays.loop["rest_force"] = 1.0 + 1e-3 * abs(noise), 0.3 + noise
        slope = force_slope(tick.arrays)
    assert slope == pytest.approx(1.0, abs=0.3)


def test_the_proportional_gain_cancels_a_pole_that_has_moved_under_the_same_residue():
    tick = _tick()
    loop, drive = tick.arrays.loop, int(tick.arrays.loop["drive_channel"][0])
    moved = complex(-11.0, -12.0)
    loop["plant_ratio"], loop["turn"], tick.arrays.guard["amplitude_v"] = 1.0, 0.4, 0.5
    residue = GAIN * -POLE
    tick.arrays.watches["estimate"][drive] = residue / -moved * 0.5 * np.exp(0.4j)
    for _ in range(20_000):
        kp = response_proportional(tick.arrays)
    assert kp == pytest.approx(60.0 / -moved, rel=1e-6)


def test_it_follows_within_a_factor_only():
    tick = _tick()
    tick.arrays.loop["plant_ratio"] = 50.0
    assert abs(response_proportional(tick.arrays)) == pytest.approx(3.0 * 60.0 / abs(POLE), rel=1e-6)

"""The force that is left at rest, against the equation of one mode whose amplitude grows and turns."""

import cmath
import math

import numpy as np
import pytest

from controller import AmplitudeLaw, PhaseLockedLoop
from rig.tick.laws.frequency.kernels import see_rest
from tests.rig.rigs import bench_with, tick_for

W, ZETA, SHAPE = 2 * math.pi * 24.37, 0.004, 0.9
OMEGA = 2 * math.pi * 24.3  # of the oscillator
DISPLACEMENT_M = 1e-3


def _law(share):
    return PhaseLockedLoop(
        detector="adaptive",
        frequency_law="frequency-error",
        frequency_integral_per_s=3.0,
        drive_mode_shape=SHAPE,
        rest_low_pass_rad_s=100.0,
        rest_share=share,
        centre_frequency_hz=24.3,
        frequency_window_hz=(22.0, 27.0),
    )


def _seen(rate, share=1.0):
    """What `see_rest` makes of a displacement ``exp(rate t)`` in the oscillator's frame and the force that it takes exactly."""
    tick = tick_for(bench_with(), 2.0, law=_law(share), amplitude_law=AmplitudeLaw.VOLTAGE)
    loop, watches = tick.arrays.loop, tick.arrays.watches
    loop["omega"] = OMEGA
    force_channel, drive_channel = int(loop["force_channel"][0]), int(loop["drive_channel"][0])
    s = 1j * OMEGA + rate
    per_x, dt = (s * s + 2 * ZETA * W * s + W * W) / SHAPE**2, 1 / 5000.0
    for k in range(1000):
        x = DISPLACEMENT_M * cmath.exp(rate * dt * (k - 1000))
        watches["estimate"][force_channel], watches["estimate"][drive_channel] = per_x * x, s * s * x
        see_rest(tick.arrays)
    at_rest = (W * W - OMEGA**2 + 2j * ZETA * W * OMEGA) / SHAPE**2 / -(OMEGA**2)  # force over acceleration
    lag = tick.arrays.progress["lag"][0] - loop["rest_error"][0]
    found = loop["rest_force"][0] / loop["rest_response"][0] * cmath.exp(1j * lag)
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
    law = _law(1.0).model_copy(update={"rest_low_pass_rad_s": 0.0})
    tick = tick_for(bench_with(), 2.0, law=law)
    tick.arrays.loop["force_size"], tick.arrays.loop["error"] = 0.7, 0.1
    see_rest(tick.arrays)
    assert (tick.arrays.loop["rest_force"][0], tick.arrays.loop["rest_error"][0]) == (0.7, 0.1)

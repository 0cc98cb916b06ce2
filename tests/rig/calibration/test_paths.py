"""What is fitted to responses whose gain, delay and corners are known."""

import numpy as np
import pytest

from rig.calibration.paths import fitted_paths, high_pass

RATE_HZ = 12000.0
LINES_HZ = np.arange(8.0, 600.0, 0.5)


def responses(output_hz, gains, delays, corners_hz):
    return np.array(
        [
            gain
            * np.exp(-2j * np.pi * LINES_HZ * delay / RATE_HZ)
            * high_pass(LINES_HZ, output_hz)
            * high_pass(LINES_HZ, corner)
            for gain, delay, corner in zip(gains, delays, corners_hz, strict=True)
        ]
    )


@pytest.mark.parametrize("output_hz", [0.0, 2.0, 5.0, 10.0])
def test_corners_delays_and_gains_are_found(output_hz):
    gains, delays, corners = [0.5, -1.02, 0.98], [0.0, 0.25, -1.5], [2.0, 5.0, 10.0]
    rng = np.random.default_rng(3)
    noise = 1e-5 * (rng.normal(size=(3, LINES_HZ.size)) + 1j * rng.normal(size=(3, LINES_HZ.size)))
    found = fitted_paths(("a", "b", "c"), LINES_HZ, responses(output_hz, gains, delays, corners) + noise, RATE_HZ)
    assert found.output_high_pass_hz == pytest.approx(output_hz, abs=0.01)
    for one, gain, delay, corner in zip(found.inputs, gains, delays, corners, strict=True):
        assert one.connected
        assert one.gain == pytest.approx(gain, rel=1e-4)
        assert one.delay_samples == pytest.approx(delay, abs=1e-3)
        assert one.high_pass_hz == pytest.approx(corner, abs=0.01)
        assert one.misfit_deg < 0.05


def test_alike_inputs_have_the_phase_of_both_whatever_is_whose():
    found = fitted_paths(("a", "b"), LINES_HZ, responses(5.0, [1.0, 1.0], [0.0, 0.0], [2.0, 2.0]), RATE_HZ)
    ours = [
        np.angle(high_pass(LINES_HZ, found.output_high_pass_hz) * high_pass(LINES_HZ, one.high_pass_hz))
        for one in found.inputs
    ]
    true = np.angle(high_pass(LINES_HZ, 5.0) * high_pass(LINES_HZ, 2.0))
    assert np.degrees(np.abs(ours - true)).max() < 0.01
    assert found.inputs[0].high_pass_hz == pytest.approx(found.inputs[1].high_pass_hz, abs=1e-3)


def test_an_input_without_a_cable_has_its_crosstalk():
    measured = responses(1.0, [1.0, 0.003], [0.0, 0.0], [1.0, 1.0])
    found = fitted_paths(("a", "b"), LINES_HZ, measured, RATE_HZ)
    assert [one.connected for one in found.inputs] == [True, False]
    assert found.inputs[1].gain == pytest.approx(0.003, rel=0.05)


def test_nothing_connected_is_no_division_by_zero():
    found = fitted_paths(("a", "b"), LINES_HZ, np.zeros((2, LINES_HZ.size), complex), RATE_HZ)
    assert not found.connected


@pytest.mark.parametrize(("output_hz", "inputs_hz"), [(2.0, 5.0), (5.0, 2.0)])
def test_the_output_s_corner_says_whose_is_whose_where_inputs_are_alike(output_hz, inputs_hz):
    measured = responses(output_hz, [1.0, 0.9], [0.0, 0.0], [inputs_hz, inputs_hz])
    found = fitted_paths(("a", "b"), LINES_HZ, measured, RATE_HZ)
    assert found.are_alike
    told = found.exchanged(output_hz + 0.7)
    assert told.output_high_pass_hz == pytest.approx(output_hz, abs=0.01)
    assert [one.high_pass_hz for one in told.inputs] == pytest.approx([inputs_hz, inputs_hz], abs=0.01)
    assert told.exchanged(output_hz) == told


def test_inputs_that_differ_tell_it_themselves():
    found = fitted_paths(("a", "b"), LINES_HZ, responses(2.0, [1.0, 1.0], [0.0, 0.0], [5.0, 7.0]), RATE_HZ)
    assert not found.are_alike
    assert found.exchanged(5.0) == found

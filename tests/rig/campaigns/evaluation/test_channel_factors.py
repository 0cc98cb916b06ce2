"""Corrections of channels for skew and high-pass: against closed forms, and against a simulated sensor."""

import numpy as np
import pytest

from rig.campaigns.evaluation.vibrations import channel_factors, recorded_vibration, skew_turn
from simulators import Simulation, VirtualRig
from tests.rig.rigs import bench_with

CORNER_HZ = 2.0


def with_corner(corner_hz: float):
    """The magnet beam's bench, which says that all its sensors have this corner."""
    table = bench_with().model_dump()
    channels = [channel | {"high_pass_hz": corner_hz} for channel in table["channels"]]
    return bench_with({"channels": channels})


def test_the_high_pass_is_divided_out_and_a_mean_is_left_as_it_is():
    bench, frequency_hz = with_corner(CORNER_HZ), np.array([0.0, 1.0, 24.0, 600.0])
    passed = 1j * frequency_hz / (1j * frequency_hz + CORNER_HZ)
    factors = channel_factors(bench, frequency_hz)
    np.testing.assert_allclose(factors[:, 1:] * passed[1:], 1.0, rtol=1e-12)
    np.testing.assert_array_equal(factors[:, 0], 1.0)


def test_without_a_corner_the_skew_alone_is_removed():
    bench, frequency_hz = with_corner(0.0), np.array([0.0, 24.0, 600.0])
    np.testing.assert_array_equal(channel_factors(bench, frequency_hz), skew_turn(bench, frequency_hz))


@pytest.mark.parametrize("corner_hz", [0.3, CORNER_HZ])
def test_harmonics_of_simulated_sensors_come_out_as_those_of_sensors_without_high_pass(corner_hz):
    """Open loop at 24 Hz and 1 V: force and motion have harmonics."""
    rate_hz, frequency_hz, size = 5000.0, 24.0, 100_000
    theta = 2.0 * np.pi * frequency_hz * np.arange(size) / rate_hz
    found = {}
    for corner in (0.0, corner_hz):
        table = VirtualRig.shipped("magnet-beam", noise_scale=0.0, converter={"adc_bits": 0}).model_dump()
        table["sensors"] = [sensor | {"high_pass_hz": corner} for sensor in table["sensors"]]
        rig = VirtualRig.model_validate(table)
        run = Simulation(rig).run(np.cos(theta))
        last = slice(size - 20_000, size)
        rows = np.zeros(20_000, [("theta_rad", "f8"), ("inputs", "f8", (4,)), ("flags", "u4")])
        rows["theta_rad"] = theta[last]
        rows["inputs"] = np.array([run.measured[name][last] for name in rig.channel_names]).T
        found[corner] = recorded_vibration(with_corner(corner), rows, 3)
    plain, corrected = found[0.0].harmonics[:, 1:], found[corner_hz].harmonics[:, 1:]
    np.testing.assert_allclose(corrected, plain, rtol=2e-5, atol=2e-6 * np.abs(plain).max())
    wrong = np.abs(corrected[:, 0] / np.abs(1.0 - 1j * corner_hz / frequency_hz) - np.abs(plain[:, 0]))
    assert np.all(wrong > 1.5e-5 * np.abs(plain[:, 0]))

"""Excitation without feedback, through the same tick: what goes out, and what comes back against harmonic balance."""

import numpy as np
import pytest

import rig
from rig.campaigns.stepped_sine import SteppedSinePlan
from rig.errors import ConfigurationError
from tests.reference.harmonic_balance import response_to_voltage
from tests.reference.parameters import ONE_SIDED
from tests.rig.rigs import bench_with

QUIET = {"noise_scale": 0.0, "converter": {"adc_bits": 0, "dac_bits": 0}}


def _plan(**changes):
    return SteppedSinePlan.model_validate({"bench": "magnet-beam", "levels_v": (1.0,), **changes})


@pytest.fixture(scope="module")
def stepped():
    plan = _plan(frequencies_hz=(22.0, 24.0, 26.0), levels_v=(0.3, 1.5))
    with rig.run(plan, bench=bench_with(**QUIET)) as run:
        yield run


def test_stepped_sines_find_what_harmonic_balance_finds(stepped):
    assert stepped.complete
    for point in stepped.recording.points:
        truth = response_to_voltage(ONE_SIDED, [0.1, point["level"]], point["frequency_hz"])[-1]
        assert point["frequency_hz"] == pytest.approx(point["asked_frequency_hz"], rel=1e-6)
        assert point["force_n"] == pytest.approx(truth.force_amplitude_n, rel=1e-3)
        assert point["phase_lag_deg"] - 180.0 == pytest.approx(truth.lag_deg, abs=0.1)  # displacement, acceleration


def test_stepped_sines_are_handed_out_as_one_frequency_response_per_level(stepped):
    responses = stepped.frequency_responses()
    assert [response.level for response in responses] == [0.3, 1.5]
    for response in responses:
        points = [point for point in stepped.recording.points if point["level"] == response.level]
        np.testing.assert_allclose(response.force_n, [point["force_n"] for point in points])
        np.testing.assert_allclose(response.amplitude_m, [point["amplitude_m"] for point in points])
        np.testing.assert_allclose(response.phase_lag_deg, [point["phase_lag_deg"] for point in points], atol=1e-6)


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({}, "exactly one"),
        ({"frequencies_hz": (24.0,), "start_hz": 22.0, "stop_hz": 25.0}, "exactly one"),
        ({"start_hz": 22.0}, "exactly one"),
        ({"frequencies_hz": (24.0, -1.0)}, r"frequencies_hz\[1\] = -1"),
        ({"frequencies_hz": ()}, "at least one"),
        ({"frequencies_hz": (24.0,), "levels_v": ()}, "levels_v"),
    ],
)
def test_a_stepped_sine_plan_that_makes_no_sense_is_refused(changes, fault):
    with pytest.raises(ValueError, match=fault):
        _plan(**changes)


@pytest.mark.parametrize(
    ("changes", "fault"),
    [
        ({"frequencies_hz": (24.0, 3000.0)}, "highest frequency = 3000 Hz"),
        ({"frequencies_hz": (24.0, 0.1)}, "lowest frequency = 0.1 Hz"),
        ({"frequencies_hz": (24.0,), "levels_v": (1.0, 50.0)}, r"levels_v\[1\] = 50 V"),
        ({"frequencies_hz": (24.0,), "levels_v": (0.0,)}, r"levels_v\[0\] = 0 V"),
    ],
)
def test_what_the_bench_cannot_do_is_refused_before_anything_moves(changes, fault):
    with pytest.raises(ConfigurationError, match=fault):
        rig.run(_plan(**changes))

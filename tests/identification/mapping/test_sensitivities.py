"""Volts of a sensor become its quantity by the sensitivity of its data sheet, in mappings as in virtual sensors."""

import numpy as np
import pytest
from pydantic import ValidationError

from identification import TimeDataMapping, map_time_data
from tests.refused import refused

VOLTS = np.array([0.01, -0.02, 0.03, 0.005])


def mapping(unit: str, sensitivity: str) -> TimeDataMapping:
    channel = {"name": "a", "role": "drive", "unit": unit, "value": "a", "sensitivity": sensitivity}
    return TimeDataMapping.model_validate({"kind": "time-data", "sample_rate_hz": 100.0, "channels": [channel]})


@pytest.mark.parametrize(("unit", "factor"), [("V", 1.0), ("mV", 1e3)])
def test_stored_volts_become_an_acceleration(unit, factor):
    found = map_time_data({"a": VOLTS * factor}, mapping(unit, "10 mV/g"))
    np.testing.assert_allclose(found.records[0].samples[0], VOLTS / 0.01 * 9.80665, rtol=1e-12)
    assert found.channels[0].unit == "m/s2"


def test_a_sensitivity_beside_another_unit_than_volts_is_refused():
    with refused(ValidationError, field="unit", value="m/s2", allowed="V or mV"):
        mapping("m/s2", "10 mV/g")

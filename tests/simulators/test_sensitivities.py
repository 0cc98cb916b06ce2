"""A virtual sensor has the sensitivity of its data sheet."""

import pytest
from pydantic import ValidationError

from simulators.sensing.parts import Sensor
from tests.refused import refused


def test_a_virtual_sensor_has_the_sensitivity_of_its_data_sheet():
    about = {"name": "a", "kind": "acceleration", "at": "tip", "range_v": 5.0}
    sensor = Sensor.model_validate({**about, "sensitivity": "10 mV/g"})
    assert sensor.sensitivity_v_per_unit == pytest.approx(0.01 / 9.80665, rel=1e-12)
    with refused(ValidationError, field="sensitivity", value="22.4 mV/N", allowed="one per m/s^2"):
        Sensor.model_validate({**about, "sensitivity": "22.4 mV/N"})
    with refused(ValidationError, field="sensitivity", value="10 mV/g", allowed="one of the two"):
        Sensor.model_validate({**about, "sensitivity": "10 mV/g", "sensitivity_v_per_unit": 1.0})

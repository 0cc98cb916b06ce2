"""A virtual sensor has the sensitivity of its data sheet."""

import pytest
from pydantic import ValidationError

from simulators.sensing.parts import Sensor


def test_a_virtual_sensor_has_the_sensitivity_of_its_data_sheet():
    about = {"name": "a", "kind": "acceleration", "at": "tip", "range_v": 5.0}
    sensor = Sensor.model_validate({**about, "sensitivity": "10 mV/g"})
    assert sensor.sensitivity_v_per_unit == pytest.approx(0.01 / 9.80665, rel=1e-12)
    with pytest.raises(ValidationError, match="is per N; allowed: one per m/s"):
        Sensor.model_validate({**about, "sensitivity": "22.4 mV/N"})
    with pytest.raises(ValidationError, match="one of the two"):
        Sensor.model_validate({**about, "sensitivity": "10 mV/g", "sensitivity_v_per_unit": 1.0})

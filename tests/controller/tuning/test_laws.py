"""Rows of complex response control are those of one complex gain: at a real s its parts are plain numbers."""

import math

import numpy as np
import pytest

from controller.tuning.laws import ComplexResponseLaw


@pytest.mark.parametrize("force_per_s", [0.0, 0.7])
def test_rows_and_level_are_the_parts_of_one_complex_gain(force_per_s):
    law, lag_deg = ComplexResponseLaw(0.3 - 0.8j, 1.7, force_per_s, 5.0), -60.0
    s = np.array([0.4, 2.0, 9.0])
    force, force_phase, response, response_phase = 0.11, -0.23, 0.05, 0.37
    # d/dt ln A_ref = -k_F d ln(|F| sin psi) with psi = arg F - arg A at the lag
    wanted = -force_per_s / s * (force + (force_phase - response_phase) / math.tan(math.radians(lag_deg)))
    gain = (law.proportional + law.integral_per_s / s) / (1.0 + s / law.smoothing_rad_s)
    output = gain * (wanted - response - 1j * response_phase)
    rows = law.rows(s.astype(complex), None, lag_deg)
    found = -rows @ np.array([force, force_phase, response, response_phase])
    np.testing.assert_allclose(found, np.stack([output.real, output.imag], axis=-1), rtol=1e-12)
    raised = gain * (force_per_s / s if force_per_s else 1.0)
    level = law.level(s.astype(complex), None, lag_deg)
    np.testing.assert_allclose(level, np.stack([raised.real, raised.imag], axis=-1), rtol=1e-12)

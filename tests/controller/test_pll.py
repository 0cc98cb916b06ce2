"""Configuration of the loop: the paper's table, and refusals."""

import math

import pytest
from pydantic import ValidationError

from controller import AmplitudeLaw, PhaseLockedLoop, preset

TABLE = [  # appendix of the paper: K1, K2, K3, K4, omega_m in rad/s
    ("magnet-beam", "stepped-phase", 2.0, 2 * math.pi, 1.5, 1.0, 48 * math.pi),
    ("magnet-beam", "backbone", 2.0, 2 * math.pi, 0.0, 0.0, 48 * math.pi),
    ("friction-beam", "stepped-phase", 1.0, 10 * math.pi, 5.0, 1.0, 300 * math.pi),
    ("friction-beam", "backbone", 1.0, 10 * math.pi, 0.0, 0.0, 290 * math.pi),
]


@pytest.mark.parametrize(("specimen", "test", "k1", "k2", "k3", "k4", "centre"), TABLE)
@pytest.mark.parametrize("reading", ["A", "B"])
def test_the_presets_hold_the_gains_of_the_paper(specimen, test, k1, k2, k3, k4, centre, reading):
    law = preset(specimen, test, reading)
    assert (law.k1, law.k2, law.k3, law.k4) == (k1, k2, k3, k4)
    assert 2 * math.pi * law.centre_frequency_hz == pytest.approx(centre)
    assert law.low_pass_rad_s == pytest.approx(2 * math.pi)


def test_the_sign_reading_is_a_pi_law_with_the_gains_of_its_low_pass():
    kp, ki = preset("magnet-beam", reading="A").proportional_and_integral()
    # K2/(s+a) has gain K2/a = 1 at rest; the sign product is 2/pi per rad; (s + K1)/s multiplies by 1 + K1/s
    assert kp == pytest.approx(2 / math.pi)
    assert ki == pytest.approx(2 * 2 / math.pi)


def test_the_coefficients_are_those_of_the_sample_rate():
    law = preset("magnet-beam").build(5000.0, AmplitudeLaw.VOLTAGE, 5.0)
    assert law["dt_s"][0] == 1 / 5000
    assert law["demodulator_gain"][0] == pytest.approx(1 - math.exp(-2 * math.pi / 5000))
    assert law["highest_rad_s"][0] == pytest.approx(2 * math.pi * 1.1 * 24.37)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"frequency_window_hz": (25.0, 27.0)}, "frequency_window_hz"),
        ({"frequency_window_hz": (27.0, 22.0)}, "frequency_window_hz"),
        ({"k1": -1.0}, "k1"),
        ({"centre_frequency_hz": 0.0}, "centre_frequency_hz"),
        ({"detector": "sign", "phase_lag_deg": -60.0}, "phase_lag_deg = -60"),
        ({"k9": 1.0}, "k9"),
    ],
)
def test_a_value_that_is_not_allowed_is_named(changes, named):
    table = preset("magnet-beam").model_dump() | changes
    with pytest.raises(ValidationError, match=named):
        PhaseLockedLoop.model_validate(table)


def test_a_window_beyond_a_quarter_of_the_rate_is_refused():
    with pytest.raises(ValueError, match="25 Hz"):
        preset("magnet-beam").build(100.0, AmplitudeLaw.VOLTAGE, 5.0)


def test_levels_in_newtons_need_an_integral_gain():
    with pytest.raises(ValueError, match="k4"):
        preset("magnet-beam", "backbone").build(5000.0, AmplitudeLaw.FORCE, 5.0)

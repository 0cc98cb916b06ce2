"""Configuration of the loop: the paper's table, and refusals."""

import math

import pytest
from pydantic import ValidationError

from controller import AmplitudeLaw, PhaseLockedLoop, preset
from tests.refused import refused

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
    assert law["frequency"]["dt_s"][0] == 1 / 5000
    assert law["detector"]["gain"][0] == pytest.approx(1 - math.exp(-2 * math.pi / 5000))
    assert law["frequency"]["highest_rad_s"][0] == pytest.approx(2 * math.pi * 1.1 * 24.37)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"frequency_window_hz": (25.0, 27.0)}, {"says": "frequency-window-hz"}),
        ({"frequency_window_hz": (27.0, 22.0)}, {"says": "frequency-window-hz"}),
        ({"k1": -1.0}, {"field": "k1", "value": -1.0}),
        ({"centre_frequency_hz": 0.0}, {"field": "centre_frequency_hz", "value": 0.0}),
        ({"detector": "sign", "phase_lag_deg": -60.0}, {"field": "phase_lag_deg", "value": -60.0, "allowed": "-90"}),
        ({"k9": 1.0}, {"field": "k9", "value": 1.0}),
    ],
)
def test_a_value_that_is_not_allowed_is_named(changes, named):
    table = preset("magnet-beam").model_dump() | changes
    with refused(ValidationError, **named):
        PhaseLockedLoop.model_validate(table)


def test_a_window_beyond_a_quarter_of_the_rate_is_refused():
    with refused(ValueError, "at-25-hz"):
        preset("magnet-beam").build(100.0, AmplitudeLaw.VOLTAGE, 5.0)


def test_levels_in_newtons_need_an_integral_gain():
    with refused(ValueError, field="k4", value=0):
        preset("magnet-beam", "backbone").build(5000.0, AmplitudeLaw.FORCE, 5.0)


def _second_generation(**changes):
    table = {
        "detector": "adaptive",
        "low_pass_rad_s": 30.0,
        "frequency_law": "frequency-error",
        "frequency_integral_per_s": 3.0,
        "drive_mode_shape": 0.9,
        "centre_frequency_hz": 24.37,
        "frequency_window_hz": (21.9, 26.8),
        "response_integral_per_s": 7.5,
        "plant_pole_rad_s": (-11.5, 3.9),
    }
    return PhaseLockedLoop.model_validate(table | changes)


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"frequency_law": "phase"}, {"says": "is-missing", "field": "k1"}),
        ({"frequency_law": "phase", "k1": 1.0}, {"says": "is-missing", "field": "k2"}),
        ({"frequency_integral_per_s": 0.0}, {"field": "frequency_integral_per_s", "value": 0}),
        ({"detector": "sign"}, {"field": "detector", "value": "sign", "allowed": "two-phase or adaptive"}),
        ({"period_mean": True}, {"field": "period_mean", "value": True}),
        ({"phase_lag_deg": -2.0}, {"field": "phase_lag_deg", "value": -2.0}),
        ({"phase_lag_deg": 180.0}, {"field": "phase_lag_deg", "value": 180.0}),
        ({"drive_mode_shape": 0.0}, {"field": "drive_mode_shape", "value": 0.0}),
        ({"harmonics_followed": 13}, {"field": "harmonics_followed", "value": 13}),
        ({"force_loop": "cubic"}, {"field": "force_loop", "value": "cubic"}),
    ],
)
def test_what_the_frequency_error_law_cannot_do_is_refused(changes, named):
    with refused(ValidationError, **named):
        _second_generation(**changes)


@pytest.mark.parametrize(
    ("changes", "law", "named"),
    [
        (
            {"drive_mode_shape": None},
            AmplitudeLaw.VOLTAGE,
            {"says": "the-frequency-error-law-needs-it", "field": "drive_mode_shape"},
        ),
        ({"response_integral_per_s": 0.0}, AmplitudeLaw.RESPONSE, {"field": "response_integral_per_s", "value": 0}),
        ({"force_loop": "through-response"}, AmplitudeLaw.FORCE, {"field": "reference_integral_per_s", "value": 0}),
        (
            {"force_loop": "through-response", "reference_integral_per_s": 1.0, "response_integral_per_s": 0.0},
            AmplitudeLaw.FORCE_RMS,
            {"field": "response_integral_per_s", "value": 0},
        ),
        (
            {"plant_pole_rad_s": (3.0, 1.0)},
            AmplitudeLaw.RESPONSE,
            {"says": "real-part-below", "field": "plant_pole_rad_s", "value": [3.0, 1.0]},
        ),
        (
            {"low_pass_rad_s": 600.0},
            AmplitudeLaw.VOLTAGE,
            {"says": "allows-up-to-2", "field": "low_pass_rad_s", "value": 600.0},
        ),
    ],
)
def test_levels_that_no_loop_would_hold_are_refused_for_the_sample_rate_and_levels_at_hand(changes, law, named):
    with refused(ValueError, **named):
        _second_generation(**changes).build(5000.0, law, 5.0)


def test_the_response_gain_cancels_the_plants_pole_and_is_real_for_the_amplitude_alone():
    complex_law = _second_generation().build(5000.0, AmplitudeLaw.RESPONSE, 5.0)
    assert complex_law["amplitude"]["response"]["kp"][0] == pytest.approx(7.5 / (11.5 - 3.9j))
    real_law = _second_generation(response_loop="amplitude").build(5000.0, AmplitudeLaw.RESPONSE, 5.0)
    assert real_law["amplitude"]["response"]["kp"][0] == pytest.approx((7.5 / (11.5 - 3.9j)).real)
    assert [law["amplitude"]["response"]["turns"][0] for law in (complex_law, real_law)] == [1, 0]


def test_the_mode_shape_of_the_controller_goes_before_that_of_the_bench():
    own = _second_generation().build(5000.0, AmplitudeLaw.VOLTAGE, 5.0, drive_mode_shape=0.5)
    benchs = _second_generation(drive_mode_shape=None).build(5000.0, AmplitudeLaw.VOLTAGE, 5.0, drive_mode_shape=0.5)
    assert own["frequency"]["mode_shape_squared"][0] == pytest.approx(0.81)
    assert benchs["frequency"]["mode_shape_squared"][0] == pytest.approx(0.25)

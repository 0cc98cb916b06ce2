"""The frequency error against the exact response of one mode."""

import cmath
import math

import pytest
from hypothesis import given, strategies as st

from controller.frequency import LARGEST_FREQUENCY_ERROR, frequency_error

SHAPE = 0.9


def _measured(omega, natural, zeta):
    """(phi_d^2 |F|/|A|, lag of the acceleration) of one mode at a frequency, exact."""
    ratio = 1 - (natural / omega) ** 2 - 2j * zeta * natural / omega  # phi_d^2 F / A
    return abs(ratio), cmath.phase(ratio)


def _error(omega, natural, zeta, wanted=-0.5 * math.pi):
    compliance, lag = _measured(omega, natural, zeta)
    return frequency_error(wanted - lag, compliance, omega, wanted)


@given(st.floats(-0.03, 0.03), st.floats(1e-4, 0.05))
def test_at_phase_resonance_it_is_the_distance_to_the_natural_frequency_whatever_the_damping(off, zeta):
    natural = 150.0
    omega = natural * (1 + off)
    # exactly (Omega/2)((natural/Omega)^2 - 1): the distance but for a term of second order
    assert _error(omega, natural, zeta) == pytest.approx((natural**2 - omega**2) / (2 * omega), rel=1e-9, abs=1e-9)
    assert _error(omega, natural, zeta) == pytest.approx(
        natural - omega, abs=abs(off) * 0.8 * abs(natural - omega) + 1e-9
    )


@pytest.mark.parametrize("wanted_deg", [-150.0, -120.0, -60.0, -30.0])
@pytest.mark.parametrize("zeta", [0.002, 0.02])
def test_at_any_phase_it_vanishes_there_and_has_slope_minus_one(wanted_deg, zeta):
    natural, wanted = 150.0, math.radians(wanted_deg)
    # lag phi*: Re/Im = cot phi* of 1 - (w/O)^2 - 2 i z w/O
    x = 1.0
    for _ in range(100):  # x = natural/Omega from 1 - x^2 = -2 z x cot(phi*)
        x = math.sqrt(1 + 2 * zeta * x / math.tan(wanted))
    there = natural / x
    assert _error(there, natural, zeta, wanted) == pytest.approx(0.0, abs=1e-9)
    step = 1e-4 * natural
    slope = (_error(there + step, natural, zeta, wanted) - _error(there - step, natural, zeta, wanted)) / (2 * step)
    assert slope == pytest.approx(-1.0, abs=0.05)


def test_it_is_bounded_where_the_response_vanishes():
    assert frequency_error(1.0, 1e9, 150.0, -0.5 * math.pi) == pytest.approx(LARGEST_FREQUENCY_ERROR * 150.0)
    assert frequency_error(-1.0, 1e9, 150.0, -0.5 * math.pi) == pytest.approx(-LARGEST_FREQUENCY_ERROR * 150.0)


def test_where_the_force_brakes_the_sign_is_still_that_of_the_way_to_resonance():
    """Structure near free vibration: force in phase with -velocity. Above the natural frequency it must ask for less."""
    natural, omega = 150.0, 151.0
    ratio = 1 - (natural / omega) ** 2 + 2j * 0.01 * natural / omega  # negative damping: the force takes power out
    error = frequency_error(-0.5 * math.pi - cmath.phase(ratio), abs(ratio), omega, -0.5 * math.pi)
    assert error == pytest.approx(natural - omega, abs=0.01)


def test_a_wrong_mode_shape_scales_the_error_and_never_turns_it():
    compliance, lag = _measured(152.0, 150.0, 0.005)
    right = frequency_error(-0.5 * math.pi - lag, compliance, 152.0, -0.5 * math.pi)
    wrong = frequency_error(-0.5 * math.pi - lag, 1.5**2 * compliance, 152.0, -0.5 * math.pi)
    assert wrong == pytest.approx(2.25 * right)

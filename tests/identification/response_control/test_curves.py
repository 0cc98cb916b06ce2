"""Sections of a force surface whose frequency and force are straight lines over the logarithm of the amplitude."""

import numpy as np
import pytest

from identification.response_control.curves import Section

FREQUENCY_SLOPE, FORCE_SLOPE = 3.0, 0.4
LOG_AMPLITUDE = np.array([-3.0, -2.0, -1.0, 0.0])
COVARIANCE = np.array([[[0.04, 0.003], [0.003, 1e-3]]]) * np.array([1.0, 2.0, 4.0, 8.0])[:, None, None]
SECTION = Section(
    1.2, LOG_AMPLITUDE, 150.0 + FREQUENCY_SLOPE * LOG_AMPLITUDE, 0.7 + FORCE_SLOPE * LOG_AMPLITUDE, COVARIANCE
)


def test_the_amplitude_at_a_force_and_the_frequency_there_lie_on_the_lines():
    (found,) = SECTION.amplitudes_at(0.7 - 1.5 * FORCE_SLOPE)
    assert found == pytest.approx(-1.5, rel=1e-12)
    assert SECTION.omega_at(found) == pytest.approx(150.0 - 1.5 * FREQUENCY_SLOPE, rel=1e-12)
    assert SECTION.slopes(found) == pytest.approx((FREQUENCY_SLOPE, FORCE_SLOPE), rel=1e-9)


@pytest.mark.parametrize(("at", "share"), [(-2.0, 1.0), (-1.5, 0.5), (-1.25, 0.25), (-3.0, 1.0)])
def test_variances_at_constant_force_are_those_of_lines_that_are_moved(at, share):
    """If errors e and f move the lines, the force is met at ``ln X - f / q``, and W is there ``e - p f / q`` off."""
    lower = int(np.floor(at - LOG_AMPLITUDE[0]))
    weights = np.zeros(4)
    weights[lower], weights[lower + 1] = share, 1.0 - share
    draws = np.random.default_rng(0)
    errors = np.array([draws.multivariate_normal(np.zeros(2), one, 200_000) for one in COVARIANCE])
    omega, force = np.einsum("l,lni->in", weights, errors)
    moved = at - force / FORCE_SLOPE
    found = 150.0 + FREQUENCY_SLOPE * moved + omega
    assert SECTION.variances(at) == pytest.approx((np.var(found), np.var(moved)), rel=0.02)

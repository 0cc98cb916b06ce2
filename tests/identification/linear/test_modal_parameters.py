"""Modes as converted from the parameters of a fit, against the sum that these parameters stand for."""

import numpy as np
import pytest

from identification.linear.accelerance import weighted_accelerance
from identification.linear.modal_parameters import as_linear_modes
from identification.linear.rational_fractions import RESIDUAL_TERMS, ModalFit
from tests.identification.linear.structures import DAMPING, FREQUENCY_HZ, SHAPES, measured


@pytest.mark.parametrize("far_hz", [140.0, 1e4, np.inf])
@pytest.mark.parametrize("normal", [True, False])
def test_the_modes_have_the_accelerance_of_the_fit_with_a_higher_mode_anywhere_above_or_none(normal, far_hz):
    omega, c = 2.0 * np.pi * FREQUENCY_HZ, 1.0 / (2.0 * np.pi * far_hz) ** 2
    rest = np.array([[0.3, 2.0, -30.0, 1e-5, 3e-9], [0.2, -1.0, 50.0, -2e-5, 1e-9]])
    slope = np.array([[1e-4, -2e-4, 5e-5], [3e-4, 1e-4, -1e-4]])
    terms = np.hstack([SHAPES * SHAPES[0], *([] if normal else [slope]), rest])
    assert rest.shape[1] == RESIDUAL_TERMS
    poles = np.concatenate([omega, DAMPING, [c]])
    size = poles.size + terms.size
    fit = ModalFit(poles=poles, terms=terms, covariance=1e-20 * np.eye(size), residual=1.0, converged=True)
    responses = measured(1, 0.1)
    found = as_linear_modes(fit, responses, weighted_accelerance(responses), normal=normal)
    assert found.upper_hz == pytest.approx(far_hz, rel=1e-12)
    lines = np.array([12.0, 20.0, 34.0, 61.0, 79.0])
    s = 2j * np.pi * lines[:, None]
    numerator = terms[None, :, :3] + (0.0 if normal else slope * s[:, :, None])
    modal = np.sum(numerator * (s**2 / (s**2 + 2.0 * DAMPING * omega * s + omega**2))[:, None, :], axis=2)
    near = 1.0 + s**2 / (2.0 * np.pi * far_hz) ** 2
    lower, lower_1, lower_2, upper, upper_1 = rest.T
    exact = modal + lower + lower_1 / s + lower_2 / s**2 + upper * s**2 / near + upper_1 * s**3 / near**2
    np.testing.assert_allclose(found.accelerance(lines), exact, rtol=1e-9)

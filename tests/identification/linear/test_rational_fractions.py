import numpy as np
import pytest

from identification.linear.accelerance import weighted_accelerance
from identification.linear.rational_fractions import fit_modes, modal_basis, pole_derivatives
from tests.identification.linear.structures import DAMPING, FAR_HZ, FREQUENCY_HZ, SHAPES, measured


@pytest.mark.parametrize("normal", [True, False])
def test_derivatives_by_the_poles_are_those_of_finite_differences(normal: bool) -> None:
    s = 2j * np.pi * np.array([15.0, 19.97, 34.0, 60.0])
    poles = np.concatenate([2 * np.pi * FREQUENCY_HZ, DAMPING, [1e-6]])
    terms = np.random.default_rng(0).normal(size=(2, 8 if normal else 11))
    terms[:, -5:] *= [1.0, 1e2, 1e4, 1e-5, 1e-8]  # residual terms of like size in this band
    analytic = pole_derivatives(s, poles, terms, normal)
    for index in range(poles.size):
        step = np.zeros(poles.size)
        step[index] = 1e-6 * poles[index]
        ends = [modal_basis(s, poles + sign * step, normal) @ terms.T for sign in (1.0, -1.0)]
        numeric = (ends[0] - ends[1]) / (2 * step[index])
        np.testing.assert_allclose(analytic[:, :, index], numeric, rtol=1e-5, atol=1e-6 * np.max(np.abs(numeric)))


@pytest.mark.parametrize("normal", [True, False])
def test_a_modal_model_without_noise_is_found_exactly_from_a_poor_start(normal: bool) -> None:
    start = np.concatenate([2 * np.pi * FREQUENCY_HZ * 1.002, DAMPING * 2.0])
    fit = fit_modes(weighted_accelerance(measured()), start, normal=normal)
    assert fit.converged
    # Errors of 100 % a line leave the prior on the pole above the band a say; the modes must not feel it.
    np.testing.assert_allclose(fit.omega, 2 * np.pi * FREQUENCY_HZ, rtol=3e-6)
    np.testing.assert_allclose(fit.zeta, DAMPING, rtol=1e-3)
    np.testing.assert_allclose(fit.terms[:, :3], SHAPES * SHAPES[0], rtol=1e-3, atol=1e-3)
    assert 1 / (2 * np.pi * np.sqrt(fit.poles[-1])) == pytest.approx(FAR_HZ, rel=0.1)


def test_covariance_is_the_scatter_over_many_measurements() -> None:
    start = np.concatenate([2 * np.pi * FREQUENCY_HZ, DAMPING])
    fits = [fit_modes(weighted_accelerance(measured(seed, 0.5)), start) for seed in range(40)]
    scatter = np.std([fit.poles[:6] for fit in fits], axis=0, ddof=1)
    claimed = np.sqrt(np.mean([np.diag(fit.covariance)[:6] for fit in fits], axis=0))
    np.testing.assert_allclose(scatter / claimed, 1.0, atol=0.35)  # 40 values: three times 11 %
    assert np.mean([fit.residual for fit in fits]) == pytest.approx(1.0, abs=0.03)

"""Local fits of the slow flow: least squares as numpy solves it, and many at once like one after the other."""

from dataclasses import fields

import numpy as np
import pytest

from identification.slow_flows.fits import local_fits


def rows(fits: int, n: int):
    """Stiffness, rate, size, periods, place and weight of some fits, one a row, drawn at random."""
    rng = np.random.default_rng(5)
    stiffness = 2e4 + 100.0 * (rng.normal(size=(fits, n)) + 1j * rng.normal(size=(fits, n)))
    rate = 150j + rng.normal(size=(fits, n)) + 1j * rng.normal(size=(fits, n))
    periods = np.cumsum(rng.uniform(0.4, 0.6, (fits, n)), axis=1)
    place = np.linspace(-1.0, 1.0, n) + rng.normal(size=(fits, 1))
    return stiffness, rate, rng.uniform(0.5, 2.0, (fits, n)), periods, place, rng.uniform(0.5, 1.0, (fits, n))


@pytest.mark.parametrize("degree", [1, 2])
def test_stiffness_and_damping_are_those_of_weighted_least_squares(degree):
    stiffness, rate, size, periods, place, weight = (row[0] for row in rows(1, 13))
    powers = place[:, None] ** np.arange(degree + 1)
    scale = (size * np.sqrt(weight))[:, None]
    design = np.hstack([powers, powers * rate[:, None]]) * scale
    found = np.linalg.lstsq(
        np.vstack([design.real, design.imag]), np.r_[(stiffness * scale[:, 0]).real, (stiffness * scale[:, 0]).imag]
    )[0]
    (fit,) = local_fits(*(row[None] for row in (stiffness, rate, size, periods, place, weight)), degree)
    assert fit.stiffness == pytest.approx(found[0], rel=1e-9)
    assert fit.damping == pytest.approx(found[degree + 1], rel=1e-7)
    np.testing.assert_allclose(fit.slopes, found[1 : degree + 1], rtol=1e-7)


def test_the_stated_spread_is_that_of_fits_to_noise_of_the_stated_correlation():
    """The first part of the noise is filtered by the window; its spread is the variance over many draws."""
    from identification.slow_flows.signals import window_correlations

    _, rate, size, periods, place, weight = (row[0] for row in rows(1, 13))
    plain, _ = window_correlations(periods[:, None] - periods[None, :])
    draws = np.random.default_rng(1)
    root = np.linalg.cholesky(plain + 1e-9 * np.eye(13))
    noise = (draws.normal(size=(4000, 13)) + 1j * draws.normal(size=(4000, 13))) @ root.T
    fits = local_fits(noise / size, *(np.tile(row, (4000, 1)) for row in (rate, size, periods, place, weight)))
    seen = [np.var([getattr(fit, name) for fit in fits]) for name in ("stiffness", "damping")]
    np.testing.assert_allclose(seen, fits[0].spread[:, 0], rtol=0.1)


@pytest.mark.parametrize("degree", [1, 2])
def test_many_fits_at_once_are_each_of_them_alone(degree):
    given = rows(4, 11)
    for number, together in enumerate(local_fits(*given, degree)):
        (alone,) = local_fits(*(row[number : number + 1] for row in given), degree)
        for one in fields(alone):
            np.testing.assert_allclose(getattr(together, one.name), getattr(alone, one.name), rtol=1e-9)

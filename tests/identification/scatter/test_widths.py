"""Widths of random effects: closed forms, and intervals that cover."""

import numpy as np
import pytest
from scipy.stats import chi2

from identification.scatter.widths import width_of


def test_with_equal_variances_the_width_is_what_the_sample_variance_leaves():
    estimates, variance = np.random.default_rng(1).normal(0.3, 2.0, 20), 0.5
    found = width_of(estimates, np.full(20, variance))
    sample = np.var(estimates, ddof=1)
    assert found.width == pytest.approx(np.sqrt(sample - variance))
    assert found.mean == pytest.approx(estimates.mean())
    assert found.mean_std == pytest.approx(np.sqrt(sample / 20))
    for end, share in ((found.low, 0.975), (found.high, 0.025)):
        assert end**2 + variance == pytest.approx(19 * sample / chi2.ppf(share, 19))


def test_estimates_that_scatter_no_more_than_their_variances_say_have_no_width():
    found = width_of(np.array([0.1, -0.1, 0.05]), np.ones(3))
    assert (found.width, found.low) == (0.0, 0.0)
    assert found.high < 5.0


def test_one_run_says_nothing_of_the_width():
    found = width_of(np.array([0.2]), np.array([0.01]))
    assert np.isnan(found.width)
    assert (found.low, found.high, found.mean) == (0.0, np.inf, 0.2)


def test_equal_estimates_have_no_width():
    assert width_of(np.full(4, 0.1), np.full(4, 1e-6)).width == 0.0


def test_intervals_cover_with_unequal_variances():
    generator, covered, trials = np.random.default_rng(2), 0, 400
    for _ in range(trials):
        variances = generator.uniform(0.0, 2.0, 10)
        found = width_of(1.0 + np.sqrt(1.0 + variances) * generator.standard_normal(10), variances)
        covered += found.low <= 1.0 <= found.high
    assert abs(covered / trials - 0.95) < 3.0 * np.sqrt(0.95 * 0.05 / trials)

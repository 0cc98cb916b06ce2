"""Widths of random effects from estimates of different accuracy, with intervals."""

from typing import NamedTuple

import numpy as np

from vibrolock.arrays import Float

_LARGEST = 1e4
"""Largest width that is looked for, relative to the spread of the estimates."""


class Width(NamedTuple):
    """A distribution of shifts."""

    mean: float
    mean_std: float
    """Standard error of the mean."""
    width: float
    """Standard deviation from run to run."""
    low: float
    """Lower end of the 95 % interval of the width."""
    high: float
    """Upper end of the 95 % interval of the width."""


def width_of(estimates: Float, variances: Float) -> Width:
    """Return mean and width of shifts that are known by estimates (float[n]) with variances (float[n]) of their own.

    With weights ``1/(variance + width^2)``, the sum Q of weighted squared deviations from the weighted mean has n - 1 degrees
    of freedom. The width is where Q is n - 1 (Mandel and Paule, Anal. Chem. 42, 1970, 1194). Its interval ends where Q is the
    2.5 % and 97.5 % quantile of chi-squared (Viechtbauer, Stat. Med. 26, 2007, 37): exact for normal shifts. It is zero if the
    estimates scatter no more than their own variances say.
    """
    from scipy.stats import chi2  # only on use: it takes long to load

    freedom = estimates.size - 1
    if freedom < 1:
        mean_std = float(np.sqrt(variances[0])) if estimates.size else np.nan
        return Width(float(estimates.mean()) if estimates.size else np.nan, mean_std, np.nan, 0.0, np.inf)
    quantiles = (float(freedom), float(chi2.ppf(0.975, freedom)), float(chi2.ppf(0.025, freedom)))
    width, low, high = (_where(estimates, variances, q) for q in quantiles)
    weights = 1.0 / np.maximum(variances + width**2, 1e-300)
    return Width(float(np.average(estimates, weights=weights)), float(weights.sum() ** -0.5), width, low, high)


def _where(estimates: Float, variances: Float, q: float) -> float:
    """Return the width at which the weighted sum of squared deviations is ``q``; 0 if it is less even there."""
    from scipy.optimize import brentq  # only on use: it takes long to load

    def excess(width: float) -> float:
        weights = 1.0 / (variances + width**2)
        return float(weights @ (estimates - np.average(estimates, weights=weights)) ** 2) - q

    spread = float(np.std(estimates))
    if not spread > 0.0:
        return 0.0
    least = 1e-6 * spread
    if excess(least) <= 0.0:
        return 0.0
    return float(brentq(excess, least, _LARGEST * spread, rtol=1e-8))

"""Rates of a decaying vibration by local polynomials in its complex logarithm.

With ``X = exp(L)`` and ``s = L'`` (growth rate and angular frequency, ``s = sigma + i Omega``) a mode without force obeys

    s^2 + s' + c s + k = 0,    c = -2 sigma - Omega' / Omega,    k = Omega^2 - sigma^2 - sigma' - c sigma,

c (1/s) and k (1/s^2) at the instantaneous amplitude: the equation of motion after one harmonic is balanced (Krylov and
Bogoliubov), no further approximation.

The window of the demodulation, of variance m (s^2), shifts L by ``m (l^2 + l' - l theta'' / theta') / 2``, l the rate against
the phase theta of the demodulation; this is subtracted.
"""

from dataclasses import dataclass

import numpy as np

from identification.decays.demodulation import Demodulated, window_correlation
from vibrolock.arrays import Complex, Float

DEGREE, HIGHER_DEGREE = 3, 5
"""Degree of a local polynomial, and of the one whose difference bounds the curvature within the fit. Chosen."""
_LEAST_SPAN = 3.0  # in units of P periods


class Series:
    """A vibration at n instants: ``seen``, ``values`` complex[n], and the ``variance`` float[n] of their logarithm."""

    def __init__(self, seen: Demodulated, values: Complex, variance: Float) -> None:
        self.seen, self.variance = seen, variance
        self.log: Complex = np.log(np.abs(values)) + 1j * np.unwrap(np.angle(values))


@dataclass(frozen=True, eq=False)
class Rates:
    """Rates at one instant: L, s, s' of the fit, covariance of their real parts (equal to that of the imaginary parts)."""

    log: complex
    rate: complex
    change: complex
    covariance: Float
    misfit: float
    correction: complex
    instants: int
    further: tuple[complex, complex, complex]
    """Differences of L, s and s' to a fit of higher degree."""
    further_covariance: Float
    """Covariance of the real parts of these differences."""


def rates_at(series: Series, centre_s: float, reach: tuple[float, float], order: int) -> Rates | None:
    """Fit around an instant from ``reach[0]`` to ``reach[1]`` (s, times); None if there are too few instants.

    ``order``: how often the signal is differentiated against the displacement, to which the rates belong.
    """
    half = max(centre_s - reach[0], reach[1] - centre_s)
    place = (series.seen.at_s - centre_s) / half
    near = (series.seen.at_s >= reach[0]) & (series.seen.at_s <= reach[1]) & (np.abs(place) < 1.0)
    u = place[near]
    span = float(np.ptp(series.seen.theta_rad[near])) / (2.0 * np.pi) if u.size else 0.0
    if u.size < HIGHER_DEGREE + 3 or span < _LEAST_SPAN * series.seen.periods:
        return None
    variance = series.variance[near]
    size = variance.min() / np.maximum(variance, 1e-300) if variance.max() > 0.0 else np.ones(u.size)
    weight = (1.0 - u**2) * size
    distance = (series.seen.theta_rad[near][:, None] - series.seen.theta_rad[near][None, :]) / (2.0 * np.pi)
    root = np.sqrt(variance)
    noise = window_correlation(distance, series.seen.periods) * np.outer(root, root)
    # theta_rad is added around the centre only, to keep the digits
    phase = series.seen.theta_rad[near] - np.interp(centre_s, series.seen.at_s, series.seen.theta_rad)
    values = series.log[near] + 1j * phase
    solved = [_solved(u, weight, values, degree) for degree in (DEGREE, HIGHER_DEGREE)]
    scales = np.array([1.0, 1.0 / half, 2.0 / half**2])
    (low, low_map), (high, high_map) = solved
    estimates = low_map[:3] * scales[:, None]
    apart = (high_map[:3] - low_map[:3]) * scales[:, None]
    residual = values - np.vander(u, DEGREE + 1, increasing=True) @ low
    projector = np.eye(u.size) - np.vander(u, DEGREE + 1, increasing=True) @ low_map
    expected = float(np.sum(weight[:, None] * (projector @ noise) * projector))
    misfit = float(np.sum(weight * np.abs(residual) ** 2)) / expected if expected > 0.0 else np.inf
    raw = low[:4] * np.array([1.0, 1.0 / half, 2.0 / half**2, 6.0 / half**3])
    turning = float(np.interp(centre_s, series.seen.at_s, series.seen.turning))
    spread2 = float(np.interp(centre_s, series.seen.at_s, series.seen.spread_s)) ** 2
    against = (low_map[:4] @ series.log[near]) * np.array([1.0, 1.0 / half, 2.0 / half**2, 6.0 / half**3])
    gain = float(np.interp(centre_s, series.seen.at_s, np.gradient(series.seen.turning, series.seen.at_s))) / turning
    l_0, l_1, l_2 = against[1:4]
    correction = -spread2 * (l_0 * l_1 + 0.5 * (l_2 - gain * l_1) - gain * (l_0**2 + l_1))
    log = raw[0] - 0.5 * spread2 * (l_0**2 + l_1 - gain * l_0)
    rate, change = raw[1] + correction, raw[2]
    if order:
        log -= order * np.log(rate)
        rate, change = (rate - order * change / rate, change - order * (raw[3] / rate - (change / rate) ** 2))
    differences = high[:3] * scales - low[:3] * scales
    differences[1] -= order * differences[2] / raw[1]
    return Rates(
        log,
        rate,
        change,
        0.5 * (estimates @ noise @ estimates.T),
        misfit,
        correction,
        int(u.size),
        (complex(differences[0]), complex(differences[1]), complex(differences[2])),
        0.5 * (apart @ noise @ apart.T),
    )


def _solved(u: Float, weight: Float, values: Complex, degree: int) -> tuple[Complex, Float]:
    """Return coefficients complex[degree + 1] and the map float[degree + 1, n] from values to them."""
    design = np.vander(u, degree + 1, increasing=True)
    root = np.sqrt(weight)
    mapping = np.asarray(np.linalg.pinv(design * root[:, None]) * root, np.float64)
    return mapping @ values, mapping

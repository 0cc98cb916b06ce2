"""Fundamentals of a decaying vibration over time, against a phase that follows its own frequency.

The weight over the phase is a cubic B-spline: four means over P periods, one after the other. At all other multiples of the
frequency, zero among them, its transform has zeros of fourth order, so that offsets, harmonics and their decay leave nothing
behind. Its variance is P^2 / 3 periods^2.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np

from vibrolock.arrays import Complex, Float

POINTS_PER_WINDOW = 2
"""Instants per P periods."""
REACH_PERIODS = 2.0
"""Half the length of the window, in units of P periods."""
_MEDIAN_OF_EXPONENTIAL = np.log(2.0)
"""Median of an exponential distribution of mean one, that of squared complex noise."""


@dataclass(frozen=True, eq=False)
class Demodulated:
    """Fundamentals of n instants.

    ``at_s`` and ``theta_rad`` float[n]: time and phase of the instants; ``values`` complex[n_channels, n]: peak, against the
    phase; ``periods``: P; ``spread_s`` float[n]: standard deviation of the window in time; ``turning`` float[n]: theta', rad/s.
    """

    at_s: Float
    theta_rad: Float
    values: Complex
    periods: int
    spread_s: Float
    turning: Float


def demodulated(theta: Float, data: Float, rate_hz: float, periods: int) -> Demodulated:
    """Demodulate ``data`` (float[n_channels, n]) with the phase ``theta`` (float[n], rising), two instants per P periods."""
    half = 2.0 * np.pi * REACH_PERIODS * periods
    step = 2.0 * np.pi * periods / POINTS_PER_WINDOW
    at = np.arange(theta[0] + half, theta[-1] - half, step)
    values = windowed(theta, data, at, periods, 1.0)
    samples = np.arange(theta.size)
    centre = np.interp(at, theta, samples)
    turning = np.interp(at, theta, np.gradient(theta)) * rate_hz
    return Demodulated(centre / rate_hz, at, values, periods, 2.0 * np.pi * periods / np.sqrt(3.0) / turning, turning)


def noise_variance(theta: Float, data: Float, periods: int) -> Float:
    """float[n_channels]: mean squared size of the noise in the demodulated values.

    It is measured halfway to the neighbouring harmonics, at orders 0.5 and 1.5, through a window of twice the length, whose
    zeros lie at all harmonics. The smaller of the two counts, because another mode may lie at one of them.
    """
    half = 4.0 * np.pi * REACH_PERIODS * periods
    at = np.arange(theta[0] + half, theta[-1] - half, 2.0 * np.pi * periods)
    if not at.size:
        return np.zeros(data.shape[0])
    found = [windowed(theta, data, at, 2 * periods, order) for order in (0.5, 1.5)]
    medians = [np.median(np.abs(values) ** 2, axis=1) / _MEDIAN_OF_EXPONENTIAL for values in found]
    return np.asarray(2.0 * np.minimum(*medians))


def window_correlation(distance_periods: Float, periods: int) -> Float:
    """Correlation of white noise in two demodulated values, ``distance_periods`` apart: a B-spline of eight means."""
    places, values = _correlation()
    return np.asarray(np.interp(np.abs(distance_periods) / periods, places, values))


@cache
def _correlation() -> tuple[Float, Float]:
    from scipy.interpolate import BSpline

    basis = BSpline.basis_element(np.arange(-4.0, 5.0), extrapolate=False)
    places = np.linspace(0.0, 4.0, 2001)
    return places, np.nan_to_num(basis(places)) / basis(0.0)


def leak(distance: Float, periods: int) -> Float:
    """Share of a vibration that passes the window, ``distance`` away in units of the frequency of the demodulation."""
    return np.asarray(np.sinc(periods * np.asarray(distance)) ** 4)


def windowed(theta: Float, data: Float, at: Float, periods: int, order: float) -> Complex:
    """complex[n_channels, len(at)]: coefficient of ``exp(i order theta)`` around the phases ``at``."""
    length = 2.0 * np.pi * periods
    weight = np.gradient(theta)
    rotation = 2.0 * np.exp(-1j * order * theta)
    first = np.searchsorted(theta, at - REACH_PERIODS * length)
    end = np.searchsorted(theta, at + REACH_PERIODS * length)
    out = np.empty((data.shape[0], at.size), np.complex128)
    for number, centre in enumerate(at):
        part = slice(int(first[number]), int(end[number]))
        window = _cubic((theta[part] - centre) / length) * weight[part]
        out[:, number] = data[:, part] @ (rotation[part] * (window / window.sum()))
    return out


def _cubic(place: Float) -> Float:
    """Cubic B-spline over -2 ... 2."""
    size = np.abs(place)
    inner = 2.0 / 3.0 - size**2 + 0.5 * size**3
    outer = np.maximum(2.0 - size, 0.0) ** 3 / 6.0
    return np.where(size < 1.0, inner, outer)

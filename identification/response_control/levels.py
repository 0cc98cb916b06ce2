"""Dynamic stiffness of one response level, as a polynomial of the frequency.

If the amplitude of the response is held, the dynamic stiffness ``S = F / X`` of a nonlinear structure is that of a
quasi-linear one: ``phi_d^2 S = w^2 - W^2 + 2 i W w z``, with w and z at that amplitude, plus a small contribution of the
other modes. Within the half-power bandwidth S is well approximated by a polynomial of low degree in W, linear in its
coefficients. The degree is the one with the smallest leave-one-out error over all levels. Equations are weighted by
``1 / |S|``, which suits noise in proportion to the force.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from identification.errors import IdentificationError
from vibrolock.arrays import Complex, Float

HIGHEST_DEGREE = 4  # largest degree of the polynomial in frequency that is fitted to a level; chosen
_LEAST_POINTS = 4  # fewest points of a level; chosen
_SPARE_POINTS = 2
"""Number of points beyond the degree that a fit needs to estimate the scatter: one more than coefficients."""
_GRID = 201  # number of frequencies of a level at which its lag is tabulated; chosen
_NEWTON = 2
"""Number of Newton steps from the lag on the grid to the exact one."""
_MARGIN = 0.02
"""Margin for lags beyond the measured points, over half their frequency range: noise shifts the ends."""


@dataclass(frozen=True, eq=False)
class LevelPoints:
    """Measured points of one level: frequency (rad/s), dynamic stiffness (N/m), displacement (m), each [n]."""

    omega: Float
    stiffness: Complex
    amplitude_m: Float

    def moved(self, omega: Float, log_stiffness: Float) -> "LevelPoints":
        """Return the points with changes of frequency and of ``ln |S|`` subtracted, their lags unchanged."""
        return LevelPoints(self.omega - omega, self.stiffness * np.exp(-log_stiffness), self.amplitude_m)


@dataclass(frozen=True, eq=False)
class LevelFit:
    """Polynomial ``S(W) = sum_j c_j x^j, x = (W - centre) / half_range``, within ``|x| <= 1``."""

    amplitude_m: float
    centre: float
    half_range: float
    coefficients: Complex
    """Coefficients [degree + 1], lowest power first."""
    covariance: Float
    """Covariance of the real and of the imaginary parts of the coefficients [2, degree + 1, degree + 1].

    It is computed from the scatter of each part. They differ, because an amplitude error shifts the resonance, and with it
    the real part.
    """
    residual: float
    """Relative RMS residual of the fit."""

    @cached_property
    def _lags(self) -> tuple[Float, Float]:
        """Return a grid of x and the lags there, rising."""
        x = np.linspace(-1.0 - _MARGIN, 1.0 + _MARGIN, _GRID)
        lags = np.unwrap(np.angle(np.polynomial.polynomial.polyval(x, self.coefficients)))
        return x, np.maximum.accumulate(lags)

    def at_lag(self, lag_rad: float) -> tuple[float, float, Float]:
        """Return W, ``ln |S|`` and their covariance [2, 2] at the displacement lag ``lag_rad``; NaN beyond the points."""
        x, lags = self._lags
        if not lags[0] <= lag_rad <= lags[-1]:
            return np.nan, np.nan, np.full((2, 2), np.nan)
        at, powers = float(np.interp(lag_rad, lags, x)), np.arange(self.coefficients.size)
        turned = self.coefficients * np.exp(-1j * lag_rad)
        for _ in range(_NEWTON):
            slope = complex(turned[1:] @ (powers[1:] * at ** powers[:-1]))
            at -= float(np.imag(turned @ at**powers)) / slope.imag
        value, at_powers = float(np.real(turned @ at**powers)), at**powers
        turn = np.array([[np.cos(lag_rad), np.sin(lag_rad)], [-np.sin(lag_rad), np.cos(lag_rad)]])
        scatter = turn @ np.diag(at_powers @ self.covariance @ at_powers) @ turn.T
        # Im(dS + S' dx) = 0 in the rotated plane; ln|S| changes by the real part over |S|.
        change = np.array([[0.0, -self.half_range / slope.imag], [1.0 / value, -slope.real / slope.imag / value]])
        return self.centre + at * self.half_range, float(np.log(value)), change @ scatter @ change.T


def check_level(points: LevelPoints, name: str) -> None:
    """Raise `IdentificationError` if points are too few, at a single frequency, or on one side of resonance only."""
    omega = points.omega
    if omega.size < _LEAST_POINTS:
        raise IdentificationError(f"{omega.size} points", where=name, allowed=f"at least {_LEAST_POINTS}")
    if not np.ptp(omega) > 1e-9 * omega.max():
        reason = f"all points at {omega[0] / (2.0 * np.pi):g} Hz"
        raise IdentificationError(reason, where=name, allowed="several frequencies")
    lags = np.degrees(np.angle(points.stiffness))
    if not np.any(lags >= 90.0) or not np.any((lags > 0.0) & (lags <= 90.0)):
        raise IdentificationError(
            f"lags {lags.min():.0f} to {lags.max():.0f} deg of the displacement behind the force do not "
            "enclose 90; measure on both sides of resonance, or check the polarity",
            where=name,
        )


def best_degree(levels: Sequence[LevelPoints]) -> int:
    """Return the degree with the smallest leave-one-out error over all levels, which must have enough points for one."""
    highest = min(HIGHEST_DEGREE, min(one.omega.size for one in levels) - _SPARE_POINTS)
    errors = [sum(_scaled(one, degree).left_out ** 2 for one in levels) for degree in range(1, highest + 1)]
    return 1 + int(np.argmin(errors))


def fit_level(points: LevelPoints, degree: int) -> LevelFit:
    """Fit the polynomial of one level."""
    fit = _scaled(points, degree)
    amplitude = float(np.median(points.amplitude_m))
    return LevelFit(amplitude, *_centre(points.omega), fit.coefficients, fit.covariance, fit.residual)


class _Fit(NamedTuple):
    """Leave-one-out error, coefficients, covariance and relative residual of a fit."""

    left_out: float
    coefficients: Complex
    covariance: Float
    residual: float


def _centre(omega: Float) -> tuple[float, float]:
    return 0.5 * float(omega.max() + omega.min()), 0.5 * float(np.ptp(omega))


def _scaled(points: LevelPoints, degree: int) -> _Fit:
    centre, half_range = _centre(points.omega)
    weight = 1.0 / np.abs(points.stiffness)
    powers = np.vander((points.omega - centre) / half_range, degree + 1, increasing=True)
    return _fitted(powers * weight[:, None], points.stiffness * weight)


def _fitted(design: Float, unit: Complex) -> _Fit:
    n, m = design.shape
    orthogonal, triangle = np.linalg.qr(design)
    inverse = np.linalg.inv(triangle)
    coefficients = np.asarray(inverse @ (orthogonal.T @ unit), dtype=np.complex128)
    left = unit - design @ coefficients
    leverage = np.sum(orthogonal**2, axis=1)
    left_out = float(np.linalg.norm(left / np.maximum(1.0 - leverage, 1e-12)))
    scatter = np.array([np.sum(left.real**2), np.sum(left.imag**2)]) / (n - m)
    covariance = np.asarray(np.multiply.outer(scatter, inverse @ inverse.T), dtype=np.float64)
    return _Fit(left_out, coefficients, covariance, float(np.linalg.norm(left) / np.sqrt(n)))

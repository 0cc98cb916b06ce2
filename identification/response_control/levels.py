"""Dynamic stiffness of one response level, as a polynomial of the frequency.

Where the amplitude of the response is held, the dynamic stiffness ``S = F / X`` of a nonlinear structure is that of a
quasi-linear one: ``phi_d^2 S = w^2 - W^2 + 2 i W w z`` with w and z of that amplitude, and a small share of the other
modes. Over the half-power range all of it is a polynomial of low degree in W, linear in its coefficients; the degree is
that with the smallest leave-one-out error. Equations are weighted by ``1 / |S|``: noise in proportion to the force.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError

__all__ = ["HIGHEST_DEGREE", "LevelFit", "LevelPoints", "fit_level"]

Float = NDArray[np.float64]
Complex = NDArray[np.complex128]

HIGHEST_DEGREE = 4
_LEAST_POINTS = 4
_MARGIN = 0.02
"""How far a lag may lie beyond the measured points, over half their range of frequency: noise moves the ends."""


@dataclass(frozen=True, eq=False)
class LevelPoints:
    """Measured points of one level: frequency (rad/s), dynamic stiffness (N/m), displacement (m), each [n]."""

    omega: Float
    stiffness: Complex
    amplitude_m: Float

    def moved(self, omega: Float, log_stiffness: Float) -> "LevelPoints":
        """The points with changes of frequency and of ``ln |S|`` taken off, their lags as they are."""
        return LevelPoints(self.omega - omega, self.stiffness * np.exp(-log_stiffness), self.amplitude_m)


@dataclass(frozen=True, eq=False)
class LevelFit:
    """``S(W) = sum_j c_j x^j, x = (W - centre) / half_range``, within ``|x| <= 1``."""

    amplitude_m: float
    centre: float
    half_range: float
    coefficients: Complex
    """[degree + 1], lowest power first."""
    covariance: Float
    """Covariance of their real parts, and alike of their imaginary parts [degree + 1, degree + 1]."""
    residual: float
    """RMS of what the fit leaves, relative."""

    def at_lag(self, lag_rad: float) -> tuple[float, float, Float]:
        """W, ``ln |S|`` and their covariance [2, 2] where the displacement lags by ``lag_rad``; NaN out of the points."""
        turned = self.coefficients * np.exp(-1j * lag_rad)
        roots = np.polynomial.polynomial.polyroots(np.trim_zeros(turned.imag, "b"))
        x = np.real(roots[np.abs(roots.imag) < 1e-9 * (1.0 + np.abs(roots.real))])
        x = x[np.abs(x) <= 1.0 + _MARGIN]
        x = x[np.polynomial.polynomial.polyval(x, turned.real) > 0.0]
        if not x.size:
            return np.nan, np.nan, np.full((2, 2), np.nan)
        at = float(x[np.argmin(np.abs(x))])
        value = float(np.polynomial.polynomial.polyval(at, turned.real))
        slope = complex(np.polynomial.polynomial.polyval(at, np.polynomial.polynomial.polyder(turned)))
        powers = at ** np.arange(turned.size)
        variance = float(powers @ self.covariance @ powers)
        # Im(dS + S' dx) = 0 in the turned plane; ln|S| changes by the real part over |S|.
        by_imaginary = np.array([-self.half_range / slope.imag, -slope.real / slope.imag / value])
        by_real = np.array([0.0, 1.0 / value])
        covariance = variance * (np.outer(by_imaginary, by_imaginary) + np.outer(by_real, by_real))
        return self.centre + at * self.half_range, float(np.log(value)), covariance


def fit_level(points: LevelPoints, name: str) -> LevelFit:
    """Polynomial of one level; raises `IdentificationError` with too few points, at one frequency, without resonance."""
    omega, stiffness = points.omega, points.stiffness
    if omega.size < _LEAST_POINTS:
        raise IdentificationError(f"{name}: {omega.size} points, needs at least {_LEAST_POINTS}")
    centre, half_range = 0.5 * (omega.max() + omega.min()), 0.5 * float(np.ptp(omega))
    if not half_range > 1e-9 * centre:
        raise IdentificationError(f"{name}: all points at {centre / (2.0 * np.pi):g} Hz, needs several frequencies")
    weight = 1.0 / np.abs(stiffness)
    powers = np.vander((omega - centre) / half_range, HIGHEST_DEGREE + 1, increasing=True) * weight[:, None]
    fits = [_fitted(powers[:, : degree + 1], stiffness * weight) for degree in _degrees(omega.size)]
    _, coefficients, covariance, residual = min(fits, key=lambda fit: fit[0])
    lags = np.angle(stiffness)
    if not np.any(lags >= 0.5 * np.pi) or not np.any((lags > 0.0) & (lags <= 0.5 * np.pi)):
        raise IdentificationError(
            f"{name}: lags {np.degrees(lags.min()):.0f} to {np.degrees(lags.max()):.0f} deg of the displacement behind the "
            f"force do not enclose 90; measure on both sides of resonance, or check the polarity"
        )
    amplitude = float(np.median(points.amplitude_m))
    return LevelFit(amplitude, float(centre), half_range, coefficients, covariance, residual)


def _degrees(n: int) -> Sequence[int]:
    return range(1, min(HIGHEST_DEGREE, n - 3) + 1)


def _fitted(design: Float, unit: Complex) -> tuple[float, Complex, Float, float]:
    """Leave-one-out error, coefficients, covariance and residual of one degree."""
    orthogonal, triangle = np.linalg.qr(design)
    coefficients = np.linalg.solve(triangle.astype(np.complex128), orthogonal.T @ unit)
    left = unit - design @ coefficients
    leverage = np.sum(orthogonal**2, axis=1)
    left_out = float(np.linalg.norm(left / np.maximum(1.0 - leverage, 1e-12)))
    n, m = design.shape
    variance = float(np.sum(np.abs(left) ** 2)) / (2.0 * (n - m))
    inverse = np.linalg.inv(triangle)
    return left_out, coefficients, variance * (inverse @ inverse.T), float(np.linalg.norm(left) / np.sqrt(n))

"""Real least squares for stiffness and damping, and the effect of noise on them.

At every instant ``g = k + c b`` with ``g = (phi_d^2 F - A) / X`` and ``b = V / X``: complex data and real unknowns. Each
unknown is a polynomial of a place (time or level), which is zero where the unknowns are wanted.

The noise is that of ``e = g X``, equal in its real and imaginary part and at all instants. It has two parts, from white noise
of two sensors. The noise of the force is filtered by the window of the demodulation. The noise of the motion is common to A,
V and X and cancels except for its rate of change (`identification.slow_flows.signals`). The second part averages out much
faster, so that both variances must be known. They follow from the residuals' sum of squares, plain and smoothed, by equating
these moments to their expectations.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.slow_flows.signals import window_correlations
from vibrolock.arrays import Complex, Float

_MEDIAN = 0.839  # median over mean of a chi-square variable with four degrees of freedom


@dataclass(frozen=True, eq=False)
class LocalFit:
    """Stiffness k (1/s^2) and damping c (1/s) where the place is zero.

    ``spread`` float[2, 2] is the variance of k and c per unit variance of each part of the noise. ``moments`` float[2] are
    moments of the residuals, and ``expected`` float[2, 2] are the contributions of each part of the noise to them.
    ``slopes`` float[degree] are the coefficients of the first and higher powers of the place in k.
    """

    stiffness: float
    damping: float
    spread: Float
    moments: Float
    expected: Float
    slopes: Float

    def standard_errors(self, variances: Float) -> tuple[float, float]:
        """Return the standard errors of k and c for these variances of both parts of the noise."""
        k, c = np.sqrt(self.spread @ variances)
        return float(k), float(c)


def local_fits(
    stiffness: Complex, rate: Complex, size: Float, periods: Float, place: Float, weight: Float, degree: int = 1
) -> list[LocalFit]:
    """Make m fits of stiffness and damping by least squares over n instants; every array has a row for each fit.

    ``stiffness`` and ``rate`` are complex, all else float: g (1/s^2), b (1/s), ``|X|``, time in periods (for the overlap of the
    windows), variable of the polynomials k and c of this ``degree``, and weights of the instants.
    """
    scale = size * np.sqrt(weight)
    powers = place[..., None] ** np.arange(degree + 1)
    columns = np.concatenate([powers, powers * rate[..., None]], axis=2) * scale[..., None]
    design = _real(columns)
    values = _real((stiffness * scale)[..., None])
    inverse = np.linalg.pinv(design)
    solution = inverse @ values
    residual = values - design @ solution
    wanted = inverse[:, [0, degree + 1]]
    root = np.sqrt(weight)
    correlations = [
        _real(np.concatenate([part, 1j * part], axis=2)) * np.tile(root[:, :, None] * root[:, None, :], (1, 2, 2))
        for part in window_correlations(periods[:, :, None] - periods[:, None, :])
    ]
    left = [noise - design @ (inverse @ noise) for noise in correlations]
    left = [part - (part @ _transposed(inverse)) @ _transposed(design) for part in left]
    # Where the spread is nearly zero, rounding may make it negative.
    spread = np.maximum(np.stack([np.sum(wanted @ noise * wanted, axis=2) for noise in correlations], axis=2), 0.0)
    smooth = _transposed(residual) @ correlations[0] @ residual
    moments = np.stack([np.sum(residual**2, axis=(1, 2)), smooth[:, 0, 0]], axis=1)
    traces = [np.trace(part, axis1=1, axis2=2) for part in left]
    expected = np.stack([*traces, *(np.sum(correlations[0] * part, axis=(1, 2)) for part in left)], axis=1)
    found = solution[..., 0]
    return [
        LocalFit(
            stiffness=float(found[fit, 0]),
            damping=float(found[fit, degree + 1]),
            spread=spread[fit],
            moments=moments[fit],
            expected=expected[fit].reshape(2, 2),
            slopes=found[fit, 1 : degree + 1],
        )
        for fit in range(found.shape[0])
    ]


def _real(values: NDArray[Any]) -> Float:
    return np.concatenate([values.real, values.imag], axis=1)


def _transposed(values: NDArray[Any]) -> Float:
    return np.asarray(values.swapaxes(1, 2))


def neighbours(count: int) -> list[slice]:
    """Return the levels within two (chosen) of each of ``count`` levels, over which an error is smoothed."""
    return [slice(max(0, n - 2), n + 3) for n in range(count)]


def noise_variances(fits: Sequence[LocalFit]) -> Float:
    """float[2]: variances of the two parts of the noise, common to ``fits``; neither below zero."""
    moments = np.sum([fit.moments for fit in fits], axis=0)
    expected = np.sum([fit.expected for fit in fits], axis=0)
    if abs(np.linalg.det(expected)) > 1e-9 * expected[0, 0] * expected[1, 1]:
        both = np.linalg.solve(expected, moments)
        if both.min() >= 0.0:
            return np.asarray(both)
        if both[0] < 0.0:
            return np.array([0.0, moments[0] / expected[0, 1]])
    return np.array([moments[0] / expected[0, 0], 0.0])


def sensor_noise(force_noise: Float, fits: Sequence[LocalFit]) -> Float:
    """float[2]: variances of the two parts of the noise, the first as ``force_noise`` measures it between the harmonics.

    The median of it is taken, because some instants are affected by the ends of the record (with four degrees of freedom it is
    0.839 of the mean). The rest of the residual of ``fits`` is the noise of the motion.
    """
    force = float(np.median(force_noise)) / _MEDIAN
    left, by_force, by_motion = np.sum([[fit.moments[0], *fit.expected[0]] for fit in fits], axis=0)
    return np.array([force, max(0.0, float(left - force * by_force) / float(by_motion))])


def as_settled(fit: LocalFit, residual_s2: float) -> LocalFit:
    """Return the fit with the stiffness that a settled point at phase resonance gives for the total drive-point motion.

    There ``phi_d^2 F / X = D / (1 + D r / phi_d^2)`` with ``D = i w c`` and the receptance r of the other modes, which the
    fit excludes. ``residual_s2`` is ``r / phi_d^2``.
    """
    return replace(fit, stiffness=fit.stiffness * (1.0 + residual_s2 * fit.damping**2))

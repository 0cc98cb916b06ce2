"""Real least squares for stiffness and damping, with what overlapping windows leave of independence.

At every instant ``g = k + c b`` with ``g = (phi_d^2 F - A) / X`` and ``b = V / X``: complex data, real unknowns. Over some
periods k and c are taken as linear in time; their values at the middle are the result. Noise stands in ``g X``, alike
at all instants and in both parts; windows that overlap share it.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.slow_flow.signals import blackman_overlap

__all__ = ["LocalFit", "local_fit"]

Complex = NDArray[np.complex128]
Float = NDArray[np.float64]


@dataclass(frozen=True)
class LocalFit:
    """Stiffness k (1/s^2) and damping c (1/s) around an instant.

    ``spread`` and ``damping_spread`` are their standard errors per unit of noise in ``g X``; ``residual`` is the sum of
    squares that the fit leaves, ``expected`` the same for unit noise.
    """

    stiffness: float
    damping: float
    stiffness_spread: float
    damping_spread: float
    residual: float
    expected: float


def local_fit(
    stiffness: Complex, rate: Complex, size: Float, periods: Float, place: Float, weight: Float, degree: int = 1
) -> LocalFit:
    """Least squares over the instants given.

    Parameters
    ----------
    stiffness, rate
        complex[n], g (1/s^2) and b (1/s).
    size
        float[n], ``|X|``.
    periods
        float[n], time in periods, for the overlap of the windows.
    place, weight
        float[n], what k and c are polynomials of, zero where they are wanted, and weights of the instants.
    degree
        Of these polynomials.
    """
    scale = size * np.sqrt(weight)
    powers = place[:, None] ** np.arange(degree + 1)
    columns = np.hstack([powers, powers * rate[:, None]]) * scale[:, None]
    values = stiffness * scale
    design = np.vstack([columns.real, columns.imag])
    inverse = np.linalg.pinv(design)
    solution = inverse @ np.r_[values.real, values.imag]
    residual = np.r_[values.real, values.imag] - design @ solution
    overlap = blackman_overlap(periods[:, None] - periods[None, :]) * np.sqrt(np.outer(weight, weight))
    noise = np.kron(np.eye(2), overlap)
    covariance = inverse @ noise @ inverse.T
    left = noise - design @ (inverse @ noise)
    expected = np.trace(left) - np.trace((left @ inverse.T) @ design.T)
    at = degree + 1
    return LocalFit(
        stiffness=float(solution[0]),
        damping=float(solution[at]),
        stiffness_spread=float(np.sqrt(covariance[0, 0])),
        damping_spread=float(np.sqrt(covariance[at, at])),
        residual=float(residual @ residual),
        expected=float(expected),
    )

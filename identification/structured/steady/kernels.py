"""Compiled forces of nonlinear elements along a period, with derivatives by the coefficients of their displacements."""

import numpy as np

from identification.structured.laws import damping_of, spring_of
from identification.structured.steps import System
from vibrolock.compiled import unlocked_kernel

__all__ = ["along_period"]


@unlocked_kernel
def along_period(
    system: System,
    x: np.ndarray,
    rate: np.ndarray,
    to_time: np.ndarray,
    to_rate: np.ndarray,
    force: np.ndarray,
    damping: np.ndarray,
    by: np.ndarray,
) -> None:
    """Write force and damping of every element at all samples of a period, float[n_elements, samples], J and J s.

    ``x`` and ``rate``, float[n_elements, samples], are displacements and their derivatives by time, which ``to_time`` and
    ``to_rate``, float[samples, size], give from Fourier coefficients. ``by``, float[n_elements, samples, size]: derivatives
    of the force by the coefficients of x.
    """
    for e in range(x.shape[0]):
        law, springs = system.laws[e, : system.sizes[e, 1]], system.sizes[e, 0]
        reach, softest = system.limits[e, 0], system.limits[e, 1]
        for k in range(x.shape[1]):
            spring, slope, _ = spring_of(x[e, k], law, springs, reach, softest)
            damping[e, k], steep = damping_of(x[e, k], law, springs, reach)
            force[e, k] = spring + damping[e, k] * rate[e, k]
            slope += steep * rate[e, k]
            for c in range(to_time.shape[1]):
                by[e, k, c] = slope * to_time[k, c] + damping[e, k] * to_rate[k, c]

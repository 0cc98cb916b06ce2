"""Compiled forces of nonlinear elements along a period, with derivatives by the coefficients of their displacements."""

import numpy as np

from identification.models.structured.kernels import damping_at, slide, spring_at
from identification.models.structured.steps import System
from vibrolock.compiled import inner_kernel, unlocked_kernel


@inner_kernel
def add_slider(
    stiffness: float, strength: float, x: np.ndarray, to_time: np.ndarray, force: np.ndarray, by: np.ndarray
) -> None:
    """Add the force of a slider in the second of two periods that begin at rest, and its derivatives.

    After one period both extremes of x have passed, and the loop is closed. A slider that sticks has moved from where it last
    slipped, sample ``slipped``, or from rest (-1), so that its force changes with ``x(k) - x(slipped)``.
    """
    r, last, slipped = 0.0, 0.0, -1
    for repeat in range(2):
        for k in range(x.size):
            _, r, _, sticking = slide(r, stiffness, strength, x[k] - last)
            last = x[k]
            if sticking < 1.0:
                slipped = k
            if repeat == 1:
                force[k] += r
                if slipped != k:
                    for c in range(to_time.shape[1]):
                        begin = to_time[slipped, c] if slipped >= 0 else 0.0
                        by[k, c] += stiffness * (to_time[k, c] - begin)


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
    tables = system.tables
    for e in range(x.shape[0]):
        for k in range(x.shape[1]):
            spring, slope, _ = spring_at(x[e, k], tables.springs[e], tables.limits[e])
            damping[e, k], steep = damping_at(x[e, k], tables.dampers[e], tables.limits[e, 0])
            force[e, k] = spring + damping[e, k] * rate[e, k]
            slope += steep * rate[e, k]
            for c in range(to_time.shape[1]):
                by[e, k, c] = slope * to_time[k, c] + damping[e, k] * to_rate[k, c]
        for s in range(tables.first[e], tables.first[e + 1]):
            add_slider(tables.sliders[s, 0], tables.sliders[s, 1], x[e], to_time, force[e], by[e])

"""Compiled parts of a run whose force reacts to its own motion: the reaction's filter, and the secant method for the force."""

from typing import NamedTuple

import numpy as np

from vibrolock.compiled import inner_kernel

ITERATIONS = 20
"""Secant steps for the force of a sample, at most. Chosen: where the method converges it takes less than ten."""
EXACT = 1e-12
"""Error of the force that counts as none, relative to the largest force. Chosen: some thousand times the rounding."""


class Loop(NamedTuple):
    """Filter of a force that reacts on an output: ``xi(k+1) = A xi + b y_d``, ``F = F_0 + c xi + d y_d``."""

    a: np.ndarray
    """float[n_xi, n_xi]."""
    b: np.ndarray
    """float[n_xi]."""
    c: np.ndarray
    """float[n_xi]."""
    d: float


@inner_kernel
def largest_of(values: np.ndarray) -> float:
    """Return the largest magnitude."""
    largest = 0.0
    for k in range(values.size):
        largest = max(largest, abs(values[k]))
    return largest


@inner_kernel
def free_force(loop: Loop, xi: np.ndarray, given: float) -> float:
    """Return the force of a sample without the part that reacts to the motion of the same sample."""
    free = given
    for i in range(xi.size):
        free += loop.c[i] * xi[i]
    return free


@inner_kernel
def advance_filter(loop: Loop, xi: np.ndarray, after: np.ndarray, motion: float) -> None:
    """Advance the states ``xi`` of the filter by a sample; ``after`` is a work array."""
    for i in range(xi.size):
        total = loop.b[i] * motion
        for j in range(xi.size):
            total += loop.a[i, j] * xi[j]
        after[i] = total
    for i in range(xi.size):
        xi[i] = after[i]


@inner_kernel
def secant_step(
    trial: int, force: float, left: float, before: float, left_before: float, slope: float
) -> tuple[float, float]:
    """Return the next force to try, and the slope that it was found with; with slope 0 there is none.

    ``left`` is what the equation of the force leaves at ``force``, ``before`` and ``left_before`` are those of the last trial;
    ``slope`` is that of the first trial.
    """
    if trial > 0 and force != before:
        slope = (left - left_before) / (force - before)
    return (force if slope == 0.0 else force - left / slope), slope

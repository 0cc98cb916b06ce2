"""Compiled forces of nonlinear sites over one period of a given motion, with their derivatives."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from simulators.plant.kernels import local_forces
from vibrolock.compiled import kernel


@kernel
def clip(value: float, limit: float) -> float:
    """Return ``value`` limited to plus and minus ``limit``."""
    return min(max(value, -limit), limit)


@kernel
def memoryless_over_a_period(
    sites: NDArray[Any],
    motion: NDArray[np.float64],
    steps: NDArray[np.float64],
    moved: NDArray[np.float64],
    pair: NDArray[np.float64],
    forces: NDArray[np.float64],
    slopes: NDArray[np.float64],
) -> bool:
    """Evaluate the sites without memory under ``motion`` [N, m]: fill ``forces`` [N, m] and ``slopes`` [N, m, m].

    ``slopes[n, i, j]`` is the derivative of force i by coordinate j, by central differences; sites may act on each other.
    ``steps`` [m] are the half steps of the differences; ``moved`` [m] and ``pair`` [2, m] are scratch. Return whether a site
    left its range.
    """
    beyond = False
    for n in range(motion.shape[0]):
        for j in range(steps.size):
            moved[j] = motion[n, j]
        beyond |= local_forces(sites, moved, 0, forces[n])
        for j in range(steps.size):
            moved[j] = motion[n, j] + steps[j]
            local_forces(sites, moved, 0, pair[0])
            moved[j] = motion[n, j] - steps[j]
            local_forces(sites, moved, 0, pair[1])
            moved[j] = motion[n, j]
            for i in range(steps.size):
                slopes[n, i, j] = (pair[0, i] - pair[1, i]) / (2.0 * steps[j])
    return beyond


@kernel
def friction_over_a_period(
    elements: NDArray[np.float64],
    deflection: NDArray[np.float64],
    basis: NDArray[np.float64],
    held: NDArray[np.float64],
    turned_at: NDArray[np.int64],
    force: NDArray[np.float64],
    tangent: NDArray[np.float64],
) -> None:
    """Fill ``force`` [N] of one Jenkins site over the second of two periods from the virgin state, and ``tangent`` [N, P].

    ``elements`` [2, n_element]: stiffness and slip force. ``deflection`` [N]: one period of the coordinate. ``basis`` [N, P]:
    derivative of the deflection by its coefficients. ``held`` and ``turned_at`` [n_element] are scratch. As in the plant, the
    site's force excludes its stuck linear part: ``sum_j k_j delta - f_j`` with ``f_j <- clip(f_j + k_j d(delta), +-limit_j)``.
    The force of an element that last slipped at sample s has changed by ``k (delta_n - delta_s)`` since. The derivative of the
    site's force is therefore ``sum_j k_j basis_s(j)``; an element that never slipped contributes nothing.
    """
    n_sample, n_coefficient = basis.shape
    n_element = held.size
    stuck = 0.0
    for e in range(n_element):
        held[e] = 0.0
        turned_at[e] = -1
        stuck += elements[0, e]
    before = 0.0
    for n in range(n_sample):
        for e in range(n_element):
            trial = held[e] + elements[0, e] * (deflection[n] - before)
            held[e] = clip(trial, elements[1, e])
            if held[e] != trial:
                turned_at[e] = n
        before = deflection[n]
    for p in range(n_coefficient):
        tangent[n_sample - 1, p] = 0.0
    for e in range(n_element):
        if turned_at[e] >= 0:
            for p in range(n_coefficient):
                tangent[n_sample - 1, p] += elements[0, e] * basis[turned_at[e], p]
    for n in range(n_sample):
        for p in range(n_coefficient):
            tangent[n, p] = tangent[n - 1, p]
        total = 0.0
        for e in range(n_element):
            trial = held[e] + elements[0, e] * (deflection[n] - before)
            held[e] = clip(trial, elements[1, e])
            total += held[e]
            if held[e] != trial:
                for p in range(n_coefficient):
                    last = basis[turned_at[e], p] if turned_at[e] >= 0 else 0.0
                    tangent[n, p] += elements[0, e] * (basis[n, p] - last)
                turned_at[e] = n
        before = deflection[n]
        force[n] = stuck * deflection[n] - total

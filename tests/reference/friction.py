"""Jenkins elements in parallel, marched over a periodic displacement until their memory has closed."""

import numpy as np
from numba import njit

from vibrolock.arrays import Float


def jenkins_over_a_period(delta: Float, basis: Float, k: Float, slip: Float) -> tuple[Float, Float]:
    """Site force `sum k delta - sum f_j` over the second of two periods from the virgin state, and its derivative.

    `delta` has shape (N,), samples of one period; `basis` (N, P) is d delta / d coefficients. Returns (N,) and (N, P).
    An element that stuck since sample s has moved by k (delta_n - delta_s) since, which gives the derivative for free.
    """
    tangent = np.zeros(basis.shape)
    return k.sum() * delta - _march(delta, basis, k, k * slip, tangent), tangent


@njit(cache=True)
def _march(delta, basis, k, limit, tangent):
    """Forces of all elements together over the second period, shape (N,); fills the derivative of the site force."""
    n = delta.size
    total, force, last, before = np.zeros(n), np.zeros(k.size), np.full(k.size, -1), 0.0
    for sample in range(2 * n):
        here = sample % n
        for j in range(k.size):
            trial = force[j] + k[j] * (delta[here] - before)
            force[j] = min(max(trial, -limit[j]), limit[j])
            if force[j] != trial:
                last[j] = here
            # stuck stiffness minus tangent: the basis row of the sample itself cancels, only the anchors remain
            if sample >= n and last[j] >= 0:
                for p in range(basis.shape[1]):
                    tangent[here, p] += k[j] * basis[last[j], p]
        before = delta[here]
        if sample >= n:
            total[here] = force.sum()
    return total

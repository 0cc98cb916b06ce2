"""Jenkins elements in parallel, marched over a periodic displacement until their memory has closed."""

import numpy as np

from vibrolock.arrays import Float


def jenkins_over_a_period(delta: Float, basis: Float, k: Float, slip: Float) -> tuple[Float, Float]:
    """Site force `sum k delta - sum f_j` over the second of two periods from the virgin state, and its derivative.

    `delta` has shape (N,), samples of one period; `basis` (N, P) is d delta / d coefficients. Returns (N,) and (N, P).
    An element that stuck since sample s has moved by k (delta_n - delta_s) since, which gives the derivative for free.
    """
    n = delta.size
    slid_at = np.full((n, k.size), -1)
    forces = np.zeros((n, k.size))
    limit = k * slip
    force, last, before = np.zeros(k.size), np.full(k.size, -1), 0.0
    for sample in range(2 * n):
        here = sample % n
        trial = force + k * (delta[here] - before)
        force = np.minimum(np.maximum(trial, -limit), limit)
        last = np.where(force != trial, here, last)
        before = delta[here]
        if sample >= n:
            forces[here], slid_at[here] = force, last
    anchors = np.where((slid_at >= 0)[:, :, None], basis[slid_at], 0.0)
    # stuck stiffness minus tangent: the basis row of the sample itself cancels, only the anchors remain
    return k.sum() * delta - forces.sum(axis=1), np.einsum("j,njp->np", k, anchors)

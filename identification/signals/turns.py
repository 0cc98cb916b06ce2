"""Harmonics of a phase, for sums over samples: coefficients of signals, and signals of coefficients."""

import numpy as np

from vibrolock.arrays import Float


def turns_of(theta_rad: Float, highest: int, out: Float | None = None, lower: Float | None = None) -> Float:
    """float[2, highest + 1, n]: cosines and minus sines of the harmonics from 0 up of a phase in float[n].

    ``lower``: those up to a lower one, 1 or more, where they are known.

    They are the factors of Re and Im of a coefficient Y_h in ``Re(Y_h exp(i h theta))``. Each comes from two lower ones:
    ``cos(m + j) = 2 cos(m) cos(j) - cos(m - j)`` and ``sin(m + j) = 2 cos(m) sin(j) + sin(m - j)``.
    """
    turns = np.empty((2, highest + 1, theta_rad.size)) if out is None else out
    if lower is None:
        turns[0, 0], turns[1, 0] = 1.0, 0.0
        if highest:
            np.cos(theta_rad, out=turns[0, 1])
            np.negative(np.sin(theta_rad), out=turns[1, 1])
    else:
        turns[:, : lower.shape[1]] = lower[:, : highest + 1]
    middle = 1 if lower is None else lower.shape[1] - 1
    while middle < highest:
        more = turns[:, middle + 1 : 2 * middle + 1]
        count = more.shape[1]
        np.multiply(2.0 * turns[0, middle], turns[:, 1 : count + 1], out=more)
        below = turns[:, middle - count : middle][:, ::-1]
        more[0] -= below[0]
        more[1] += below[1]
        middle += count
    return turns

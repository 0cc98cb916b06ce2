"""Stability of a periodic vibration of a discrete map, by Hill's matrix.

A disturbance ``p(theta_k) mu^k`` of a vibration obeys ``mu R p = T^+ f' T p``. Its multipliers over one sample are
eigenvalues of ``R^-1 T^+ f' T``. Each multiplier occurs many times, in copies rotated by whole multiples of ``W T_s``. The
eigenvectors centred on the static harmonic suffer least from truncation. As many eigenvalues as there are states are
therefore kept, those with the lowest centroid, without copies. (A real negative multiplier over one period has two copies
with equally low centroids; Lazarus and Thomas, C. R. Mecanique 338, 2010; Bayer and Leine, Nonlinear Dyn. 111, 2023, on
sorting.)

The product of Jacobians over a period, a smaller matrix, cannot replace this: a period is in general not a whole number of
samples, and the map is not defined between samples. If it is a whole number, both methods agree to rounding.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from identification.harmonic_balance.basis import Basis
from vibrolock.arrays import Complex, Float

Loss = Literal["", "fold", "period doubling", "Neimark-Sacker"]

_SAME = 1e-6
"""Relative difference, over one period, up to which two eigenvalues are copies of one multiplier."""
_REAL_RAD = 1e-3
"""Angle of a multiplier over one period within which it counts as real."""
_MARGIN = 1e-9  # growth over one sample that still counts as stable; chosen: rounding only


def multipliers(states_by: Float, turn: Float, basis: Basis, angle_rad: float) -> Complex:
    """complex[n_states]: multipliers over one sample, in the order of their centroids.

    ``states_by``: ``T^+ f' T``, float[size, n_states, size, n_states]. ``turn``: rotation matrix R of one sample, float[size,
    size]. ``angle_rad``: phase advance per sample.
    """
    size, n = states_by.shape[:2]
    matrix = np.tensordot(turn.T, states_by, axes=1).reshape(size * n, size * n)  # R is orthogonal
    values, vectors = np.linalg.eig(matrix)
    order = by_centroid(vectors.reshape(size, n, -1), basis)
    return distinct(values[order], n, 2.0 * np.pi / angle_rad)


def by_centroid(vectors: Complex, basis: Basis) -> NDArray[np.int64]:
    """int[k]: order of eigenvectors, complex[size, n_states, k], by the harmonic on which they are centred."""
    cosine, sine = vectors[1::2], vectors[2::2]
    forward = np.sum(np.abs(cosine - 1j * sine) ** 2, axis=1) / 4.0
    backward = np.sum(np.abs(cosine + 1j * sine) ** 2, axis=1) / 4.0
    weight = np.sum(np.abs(vectors[0]) ** 2, axis=0) + np.sum(forward + backward, axis=0)
    h = np.arange(1, basis.harmonics + 1)
    centroid = np.abs(h @ (forward - backward)) / weight
    return np.argsort(centroid, kind="stable")


def distinct(values: Complex, count: int, samples: float) -> Complex:
    """Return the first ``count`` values that are no copies of earlier ones; if there are too few, the first copies too."""
    with np.errstate(under="ignore"):
        over_period = values**samples
    kept: list[int] = []
    for k, value in enumerate(over_period[: 4 * count]):
        if len(kept) < count and np.all(np.abs(over_period[kept] - value) > _SAME * np.abs(value)):
            kept.append(k)
    kept += [k for k in range(values.size) if k not in kept][: count - len(kept)]
    return np.asarray(values[kept])


def loss_of_stability(values: Complex, angle_rad: float, *, real: bool = True) -> Loss:
    """Classify the loss of stability by the largest multiplier; return an empty text if it is stable.

    With a real positive multiplier over one period the vibration jumps (fold), with a real negative one the period doubles,
    with a complex pair the amplitude is modulated (Neimark-Sacker). ``values``: complex[k], multipliers over one sample, in
    which the phase advances by ``angle_rad``. ``real``: whether real positive multipliers count.
    """
    samples = 2.0 * np.pi / angle_rad
    over_period = np.angle(np.exp(1j * np.angle(values) * samples))
    positive = np.abs(over_period) < _REAL_RAD
    growth = np.where(positive & ~np.full(values.shape, real), 0.0, np.abs(values))
    worst = int(np.argmax(growth))
    if growth[worst] <= 1.0 + _MARGIN:
        return ""
    if positive[worst]:
        return "fold"
    return "period doubling" if np.pi - abs(over_period[worst]) < _REAL_RAD else "Neimark-Sacker"

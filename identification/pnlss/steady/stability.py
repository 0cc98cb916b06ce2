"""Stability of a periodic vibration of a discrete map, by Hill's matrix.

A disturbance ``p(theta_k) mu^k`` of a vibration obeys ``mu R p = T^+ f' T p``: its multipliers over one sample are eigenvalues
of ``R^-1 T^+ f' T``, each of them many times over, turned by whole multiples of ``W T_s``. Those whose eigenvectors lie
about the static harmonic suffer least from truncation; as many as there are states are kept, those of the lowest centroid,
no two of them copies (a real negative multiplier over one period has two copies that lie equally low;
Lazarus and Thomas, C. R. Mecanique 338, 2010; Bayer and Leine, Nonlinear Dyn. 111, 2023, on sorting).

The product of Jacobians over a period, a smaller matrix, is no substitute: a period holds no whole number of samples, and the
map says nothing between them. Where it does hold one, both are the same to rounding.
"""

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from identification.pnlss.steady.basis import Basis

__all__ = ["Loss", "loss_of_stability", "multipliers"]

Complex = NDArray[np.complex128]
Float = NDArray[np.float64]
Loss = Literal["", "fold", "period doubling", "Neimark-Sacker"]

_SAME = 1e-6
"""Relative difference, over one period, up to which two eigenvalues are copies of one multiplier."""
_REAL_RAD = 1e-3
"""Angle of a multiplier over one period within which it counts as real."""
_MARGIN = 1e-9


def multipliers(states_by: Float, turn: Float, basis: Basis, angle_rad: float) -> Complex:
    """complex[n_states]: multipliers over one sample, in the order of their centroids.

    Parameters
    ----------
    states_by
        float[size, n_states, size, n_states], ``T^+ f' T``.
    turn
        float[size, size], R.
    basis
        The series.
    angle_rad
        Turn of the phase in one sample.
    """
    size, n = states_by.shape[:2]
    matrix = np.tensordot(turn.T, states_by, axes=1).reshape(size * n, size * n)  # R is orthogonal
    values, vectors = np.linalg.eig(matrix)
    parts = vectors.reshape(size, n, -1)
    cosine, sine = parts[1::2], parts[2::2]
    forward = np.sum(np.abs(cosine - 1j * sine) ** 2, axis=1) / 4.0
    backward = np.sum(np.abs(cosine + 1j * sine) ** 2, axis=1) / 4.0
    weight = np.sum(np.abs(parts[0]) ** 2, axis=0) + np.sum(forward + backward, axis=0)
    h = np.arange(1, basis.harmonics + 1)
    centroid = np.abs(h @ (forward - backward)) / weight
    order = np.argsort(centroid, kind="stable")
    return _distinct(values[order], n, 2.0 * np.pi / angle_rad)


def _distinct(values: Complex, count: int, samples: float) -> Complex:
    """The first ``count`` values of which none is a copy of one before; where there are too few, the first copies too."""
    with np.errstate(under="ignore"):
        over_period = values**samples
    kept: list[int] = []
    for k, value in enumerate(over_period[: 4 * count]):
        if len(kept) < count and np.all(np.abs(over_period[kept] - value) > _SAME * np.abs(value)):
            kept.append(k)
    kept += [k for k in range(values.size) if k not in kept][: count - len(kept)]
    return np.asarray(values[kept])


def loss_of_stability(values: Complex, angle_rad: float, *, real: bool = True) -> Loss:
    """What the largest multiplier stands for if it is unstable.

    Through a real positive multiplier over one period the vibration jumps (fold), through a real negative one the period
    doubles, through a complex pair the amplitude is modulated (Neimark-Sacker).

    Parameters
    ----------
    values
        complex[k], multipliers over one sample.
    angle_rad
        Turn of the phase in one sample.
    real
        Whether real positive multipliers count.
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

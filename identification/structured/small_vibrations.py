"""Small vibrations of a structure with nonlinear elements about rest, where all sliders stick and springs have their slope."""

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.structured.elements import Tables

__all__ = ["small_vibrations"]

Complex = NDArray[np.complex128]
Float = NDArray[np.float64]


def small_vibrations(omega: Float, zeta: Float, phi: Float, tables: Tables) -> tuple[Complex, Float]:
    """Return poles (rad/s, upper half, lowest first) and shapes without damping in modal coordinates, float[n, n] by columns.

    ``omega`` (rad/s) and ``zeta``, float[n], are those of the linear part, ``phi`` float[n_elements, n]. The support is left
    out. Raises `IdentificationError` if a mode does not oscillate and fade.
    """
    n, middle, cells = len(omega), tables.dampers.shape[1] // 2, tables.dampers.shape[1] - 1
    slope = tables.springs[:, 1, middle] * cells / (2.0 * tables.limits[:, 0])
    stuck = np.array([np.sum(tables.sliders[a:b, 0]) for a, b in zip(tables.first, tables.first[1:], strict=False)])
    stiffness = np.diag(omega**2) + (phi.T * (slope + stuck)) @ phi
    damping = np.diag(2.0 * zeta * omega) + (phi.T * tables.dampers[:, middle]) @ phi
    poles = np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]]))
    poles = poles[poles.imag > 0.0]
    if len(poles) < n or np.any(poles.real >= 0.0):
        raise IdentificationError("elements: at rest a mode does not oscillate and fade; there are no small vibrations")
    return poles[np.argsort(np.abs(poles))], np.asarray(np.linalg.eigh(stiffness)[1])

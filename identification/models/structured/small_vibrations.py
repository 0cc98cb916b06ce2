"""Small vibrations of a structure with nonlinear elements about rest, where all sliders stick and springs have their slope."""

from collections.abc import Sequence

import numpy as np

from identification.errors import IdentificationError
from identification.models.structured.elements import NonlinearElement
from vibrolock.arrays import Complex, Float


def at_rest(omega: Float, zeta: Float, elements: Sequence[NonlinearElement]) -> tuple[Float, Float]:
    """Return the matrices of stiffness and damping of small vibrations in modal coordinates, float[n, n] each.

    ``omega`` (rad/s) and ``zeta``, float[n], are those of the linear part. The support is left out.
    """
    phi = np.array([element.phi for element in elements]).reshape(len(elements), len(omega))
    slope, loss = np.array([element.at_rest for element in elements]).reshape(len(elements), 2).T
    return np.diag(omega**2) + (phi.T * slope) @ phi, np.diag(2.0 * zeta * omega) + (phi.T * loss) @ phi


def small_vibrations(omega: Float, zeta: Float, elements: Sequence[NonlinearElement]) -> tuple[Complex, Float]:
    """Return poles (rad/s, upper half, lowest first) and shapes without damping in modal coordinates, float[n, n] by columns.

    Arguments are those of `at_rest`. Raises `IdentificationError` if a mode does not oscillate and fade.
    """
    n = len(omega)
    stiffness, damping = at_rest(omega, zeta, elements)
    poles = np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -damping]]))
    poles = poles[poles.imag > 0.0]
    if len(poles) < n or np.any(poles.real >= 0.0):
        raise IdentificationError(
            "at rest a mode does not oscillate and fade; there are no small vibrations", field="elements"
        )
    return poles[np.argsort(np.abs(poles))], np.asarray(np.linalg.eigh(stiffness)[1])

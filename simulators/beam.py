"""Euler-Bernoulli beam by finite elements, from geometry to mass-normalised modes.

Two-node elements with cubic Hermite shapes for deflection and slope and the consistent mass matrix; lumped masses may sit
anywhere. Frequencies converge with the fourth power of the element length, deflections with the same, curvatures with
the second (with the fourth at a clamp). Shear, rotary inertia and rotation of the lumped masses are not modelled.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

__all__ = ["BeamModes", "Boundary", "Quantity", "beam_modes"]

Boundary = Literal["clamped-free", "free-free"]
Quantity = Literal["deflection", "slope", "curvature"]

_DERIVATIVE: dict[Quantity, int] = {"deflection": 0, "slope": 1, "curvature": 2}


@dataclass(frozen=True, eq=False)
class BeamModes:
    """Modes of a beam, lowest first, normalised to unit modal mass."""

    omega_rad_s: NDArray[np.float64]
    """Angular natural frequencies [n_mode]; exactly zero for rigid-body modes."""
    length_m: float
    """Length; the nodes are spaced evenly along it."""
    dofs: NDArray[np.float64]
    """Deflection and slope of every node [2 (n_element + 1), n_mode]: kg^-1/2 and kg^-1/2 / m."""

    def shape(self, position_m: float, quantity: Quantity = "deflection") -> NDArray[np.float64]:
        """Mode shapes [n_mode] at a position: deflection (kg^-1/2), slope (per m) or curvature (per m^2)."""
        n_element = self.dofs.shape[0] // 2 - 1
        size = self.length_m / n_element
        element = min(int(position_m / size), n_element - 1)
        local = position_m / size - element
        shape: NDArray[np.float64] = hermite(local, size, quantity) @ self.dofs[2 * element : 2 * element + 4]
        return shape


def hermite(s: float, size_m: float, quantity: Quantity = "deflection") -> NDArray[np.float64]:
    """Cubic Hermite shapes [4] of an element at ``s`` in [0, 1]: deflection and slope of its left, then its right node."""
    shapes = {
        "deflection": [1 - 3 * s**2 + 2 * s**3, size_m * s * (1 - s) ** 2, s**2 * (3 - 2 * s), size_m * s**2 * (s - 1)],
        "slope": [6 * s * (s - 1), size_m * (1 - 4 * s + 3 * s**2), 6 * s * (1 - s), size_m * s * (3 * s - 2)],
        "curvature": [12 * s - 6, size_m * (6 * s - 4), 6 - 12 * s, size_m * (6 * s - 2)],
    }
    return np.array(shapes[quantity]) / size_m ** _DERIVATIVE[quantity]


def beam_modes(
    *,
    length_m: float,
    bending_stiffness_n_m2: float,
    mass_per_length_kg_m: float,
    n_element: int,
    n_mode: int,
    boundary: Boundary = "clamped-free",
    lumped: Sequence[tuple[float, float]] = (),
) -> BeamModes:
    """Lowest modes of a uniform beam, clamped (if at all) at position 0, with ``lumped`` (position m, mass kg) on it."""
    size = length_m / n_element
    stiffness, mass = _assemble(n_element, size, bending_stiffness_n_m2, mass_per_length_kg_m)
    for position_m, mass_kg in lumped:
        element = min(int(position_m / size), n_element - 1)
        dofs = slice(2 * element, 2 * element + 4)
        shape = hermite(position_m / size - element, size)
        mass[dofs, dofs] += mass_kg * np.outer(shape, shape)
    clamped = 2 if boundary == "clamped-free" else 0
    # Solved as M v = mu (K + shift M) v: the wanted modes are then the largest eigenvalues and lose no digits to the highest.
    typical = bending_stiffness_n_m2 / (mass_per_length_kg_m * length_m**4)
    shift = 0.0 if clamped else typical
    n_dof = mass.shape[0]
    mu, vectors = eigh(
        mass[clamped:, clamped:],
        (stiffness + shift * mass)[clamped:, clamped:],
        subset_by_index=[n_dof - clamped - n_mode, n_dof - clamped - 1],
    )
    omega_squared = 1.0 / mu[::-1] - shift
    omega_squared[omega_squared < 1e-6 * typical] = 0.0
    dofs_of_modes = np.zeros((n_dof, n_mode))
    dofs_of_modes[clamped:] = vectors[:, ::-1] / np.sqrt(mu[::-1])
    return BeamModes(np.sqrt(omega_squared), length_m, dofs_of_modes)


def _assemble(n: int, size: float, ei: float, rho_a: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Stiffness and consistent mass matrix of ``n`` equal elements, both [2 (n + 1), 2 (n + 1)]."""
    h = size
    element_stiffness = (ei / h**3) * np.array(
        [
            [12, 6 * h, -12, 6 * h],
            [6 * h, 4 * h**2, -6 * h, 2 * h**2],
            [-12, -6 * h, 12, -6 * h],
            [6 * h, 2 * h**2, -6 * h, 4 * h**2],
        ]
    )
    element_mass = (rho_a * h / 420) * np.array(
        [
            [156, 22 * h, 54, -13 * h],
            [22 * h, 4 * h**2, 13 * h, -3 * h**2],
            [54, 13 * h, 156, -22 * h],
            [-13 * h, -3 * h**2, -22 * h, 4 * h**2],
        ]
    )
    stiffness, mass = np.zeros((2, 2 * n + 2, 2 * n + 2))
    for element in range(n):
        dofs = slice(2 * element, 2 * element + 4)
        stiffness[dofs, dofs] += element_stiffness
        mass[dofs, dofs] += element_mass
    return stiffness, mass

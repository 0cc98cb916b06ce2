"""Euler-Bernoulli beam by finite elements, from geometry to mass-normalised modes.

Two-node elements with cubic Hermite shapes for deflection and slope and the consistent mass matrix; lumped masses and
springs may sit anywhere. Frequencies converge with the fourth power of the element length, deflections with the same,
curvatures with the second (with the fourth at a clamp). Shear and rotary inertia of the section are not modelled.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from vibrolock.arrays import Float

Boundary = Literal[
    "clamped-free", "clamped-pinned", "clamped-guided", "clamped-clamped",
    "pinned-free", "pinned-pinned", "pinned-guided", "pinned-clamped",
    "guided-free", "guided-pinned", "guided-guided", "guided-clamped",
    "free-free", "free-pinned", "free-guided", "free-clamped",
]  # fmt: skip
"""Condition at position 0, then at the other end; a guided end moves without turning."""
Quantity = Literal["deflection", "slope", "curvature"]

_DERIVATIVE: dict[Quantity, int] = {"deflection": 0, "slope": 1, "curvature": 2}
_HELD = {"clamped": (True, True), "pinned": (True, False), "guided": (False, True), "free": (False, False)}


class Lump(NamedTuple):
    """A rigid body at a position (m) of the beam: mass (kg), rotary inertia (kg m^2)."""

    position_m: float
    mass_kg: float
    inertia_kg_m2: float = 0.0


class Spring(NamedTuple):
    """A spring to ground at a position (m): on the deflection (N/m), on the slope (N m/rad)."""

    position_m: float
    stiffness_n_m: float
    rotational_stiffness_n_m_rad: float = 0.0


@dataclass(frozen=True, eq=False)
class BeamModes:
    """Modes of a beam, lowest first, normalised to unit modal mass."""

    omega_rad_s: Float
    """Angular natural frequencies [n_mode]; exactly zero for rigid-body modes."""
    length_m: float
    """Length; the nodes are spaced evenly along it."""
    dofs: Float
    """Deflection and slope of every node [2 (n_element + 1), n_mode]: kg^-1/2 and kg^-1/2 / m."""

    def shape(self, position_m: float, quantity: Quantity = "deflection") -> Float:
        """Return mode shapes [n_mode] at a position: deflection (kg^-1/2), slope (per m) or curvature (per m^2)."""
        return _row(position_m, self.length_m, self.dofs.shape[0], quantity) @ self.dofs


def hermite(s: float, size_m: float, quantity: Quantity = "deflection") -> Float:
    """Return the cubic Hermite shapes [4] of an element at ``s`` in [0, 1]: left deflection and slope, then right."""
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
    lumps: Sequence[Lump] = (),
    springs: Sequence[Spring] = (),
) -> BeamModes:
    """Return the lowest modes of a uniform beam with lumped masses and springs."""
    n_dof = 2 * n_element + 2
    stiffness, mass = _assemble(n_element, length_m / n_element, bending_stiffness_n_m2, mass_per_length_kg_m)
    for lump in lumps:
        mass += lump.mass_kg * _square(lump.position_m, length_m, n_dof, "deflection")
        mass += lump.inertia_kg_m2 * _square(lump.position_m, length_m, n_dof, "slope")
    for spring in springs:
        stiffness += spring.stiffness_n_m * _square(spring.position_m, length_m, n_dof, "deflection")
        stiffness += spring.rotational_stiffness_n_m_rad * _square(spring.position_m, length_m, n_dof, "slope")
    left, right = boundary.split("-")
    free = ~np.array([*_HELD[left], *[False] * (n_dof - 4), *_HELD[right]])
    typical = bending_stiffness_n_m2 / (mass_per_length_kg_m * length_m**4)
    squared, vectors = solve_modes(stiffness[np.ix_(free, free)], mass[np.ix_(free, free)], n_mode, typical)
    squared[: _n_rigid(length_m, left, right, springs)] = 0.0
    dofs = np.zeros((n_dof, n_mode))
    dofs[free] = vectors
    return BeamModes(np.sqrt(squared), length_m, dofs)


def solve_modes(stiffness: Float, mass: Float, n_mode: int, shift: float) -> tuple[Float, Float]:
    """Return the lowest ``omega^2`` [n_mode] (not negative) and mass-normalised vectors [n, n_mode] of ``K v = omega^2 M v``.

    The problem is solved as ``M v = mu (K + shift M) v``. The wanted modes are then the largest eigenvalues and lose no digits
    to the highest modes, and K may be singular (rigid-body modes). ``shift`` (rad/s)^2 is about ``omega^2`` of the lowest mode.
    """
    lower = np.linalg.cholesky(stiffness + shift * mass)
    mu, vectors = np.linalg.eigh(np.linalg.solve(lower, np.linalg.solve(lower, mass).T))
    mu, vectors = mu[: -n_mode - 1 : -1], np.linalg.solve(lower.T, vectors[:, : -n_mode - 1 : -1])
    return np.maximum(1.0 / mu - shift, 0.0), vectors / np.sqrt(mu)


def bending_element(size_m: float, ei_n_m2: float, rho_a_kg_m: float) -> tuple[Float, Float]:
    """Return stiffness and consistent mass matrix [4, 4] of one element over deflection and slope of its two nodes."""
    h = size_m
    stiffness = (ei_n_m2 / h**3) * np.array(
        [
            [12, 6 * h, -12, 6 * h],
            [6 * h, 4 * h**2, -6 * h, 2 * h**2],
            [-12, -6 * h, 12, -6 * h],
            [6 * h, 2 * h**2, -6 * h, 4 * h**2],
        ]
    )
    mass = (rho_a_kg_m * h / 420) * np.array(
        [
            [156, 22 * h, 54, -13 * h],
            [22 * h, 4 * h**2, 13 * h, -3 * h**2],
            [54, 13 * h, 156, -22 * h],
            [-13 * h, -3 * h**2, -22 * h, 4 * h**2],
        ]
    )
    return stiffness, mass


def _assemble(n: int, size: float, ei: float, rho_a: float) -> tuple[Float, Float]:
    """Return stiffness and mass of ``n`` equal elements, both [2 (n + 1), 2 (n + 1)]."""
    element_stiffness, element_mass = bending_element(size, ei, rho_a)
    stiffness, mass = np.zeros((2, 2 * n + 2, 2 * n + 2))
    for element in range(n):
        dofs = slice(2 * element, 2 * element + 4)
        stiffness[dofs, dofs] += element_stiffness
        mass[dofs, dofs] += element_mass
    return stiffness, mass


def _row(position_m: float, length_m: float, n_dof: int, quantity: Quantity) -> Float:
    """Return the row [n_dof] that gives a quantity at a position from the nodal coordinates."""
    n_element = n_dof // 2 - 1
    size = length_m / n_element
    element = min(int(position_m / size), n_element - 1)
    row = np.zeros(n_dof)
    row[2 * element : 2 * element + 4] = hermite(position_m / size - element, size, quantity)
    return row


def _square(position_m: float, length_m: float, n_dof: int, quantity: Quantity) -> Float:
    row = _row(position_m, length_m, n_dof, quantity)
    return np.outer(row, row)


def _n_rigid(length_m: float, left: str, right: str, springs: Sequence[Spring]) -> int:
    """Return the number of rigid motions ``a + b x/L`` that neither the ends nor the springs resist."""
    held = [(*_HELD[left], 0.0), (*_HELD[right], 1.0)]
    resisted = [np.array([1.0, at]) for deflection, _, at in held if deflection]
    resisted += [np.array([0.0, 1.0]) for _, slope, _ in held if slope]
    resisted += [np.array([1.0, spring.position_m / length_m]) for spring in springs if spring.stiffness_n_m]
    resisted += [np.array([0.0, 1.0]) for spring in springs if spring.rotational_stiffness_n_m_rad]
    return 2 - int(np.linalg.matrix_rank(np.array(resisted))) if resisted else 2

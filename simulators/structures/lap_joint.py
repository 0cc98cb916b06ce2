"""Modes of two beams joined by a bolted lap, by finite elements (`simulators.structures.lap_mesh`).

The legs are coupled by springs between their interfaces, tangential ``u_upper - u_lower`` and normal ``w_upper -
w_lower``, peaked at the bolts. Linear axial and cubic Hermite bending elements, consistent mass, rotary inertia (Rayleigh
beam): glued by an infinitely stiff interface the joint is the full-thickness beam. Shear of the sections and contact
(opening, pressure that changes with vibration) are not modelled.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from simulators.structures.beam import Lump, Quantity, Spring, bending_element, solve_modes
from simulators.structures.lap_mesh import LapMesh, bending_dofs

__all__ = ["Interface", "LapJointModes", "Section", "lap_joint_modes"]

Matrix = NDArray[np.float64]


class Section(NamedTuple):
    """The full-thickness beam: Young's modulus (Pa), density (kg/m^3), width and thickness (m)."""

    youngs_modulus_pa: float
    density_kg_m3: float
    width_m: float
    thickness_m: float


class Interface(NamedTuple):
    """Springs between the legs: totals over the lap (N/m), spread as ``floor + sum_b exp(-(x - x_b)^2 / (2 width^2))``."""

    tangential_n_m: float
    normal_n_m: float
    bolts_m: Sequence[float]
    bolt_width_m: float
    floor: float


@dataclass(frozen=True, eq=False)
class LapJointModes:
    """Modes of the jointed beam, lowest first, normalised to unit modal mass."""

    omega_rad_s: Matrix
    """Angular natural frequencies [n_mode]; exactly zero for rigid-body modes."""
    mesh: LapMesh
    """The mesh."""
    dofs: Matrix
    """Coordinates of every node [n_dof, n_mode]."""

    def shape(self, position_m: float, quantity: Quantity = "deflection") -> Matrix:
        """Mode shapes [n_mode] at a position: deflection (kg^-1/2), slope (per m) or curvature (per m^2)."""
        return self.mesh.row(position_m, quantity) @ self.dofs

    def slip(self, position_m: float) -> Matrix:
        """Tangential displacement [n_mode] (kg^-1/2) of the upper leg's interface relative to the lower leg's."""
        return self.mesh.slip_row(position_m) @ self.dofs


def lap_joint_modes(
    mesh: LapMesh,
    section: Section,
    interface: Interface,
    n_mode: int,
    lumps: Sequence[Lump] = (),
    springs: Sequence[Spring] = (),
) -> LapJointModes:
    """Lowest modes of the jointed beam, free but for its springs; the rigid axial motion, which nothing sees, is left out."""
    stiffness, mass = _members(mesh, section)
    _add_interface(stiffness, mesh, interface)
    for lump in lumps:
        deflection, slope = mesh.row(lump.position_m), mesh.row(lump.position_m, "slope")
        axial = mesh.axial_row(lump.position_m)
        mass += lump.mass_kg * (np.outer(deflection, deflection) + np.outer(axial, axial))
        mass += lump.inertia_kg_m2 * np.outer(slope, slope)
    for spring in springs:
        deflection, slope = mesh.row(spring.position_m), mesh.row(spring.position_m, "slope")
        stiffness += spring.stiffness_n_m * np.outer(deflection, deflection)
        stiffness += spring.rotational_stiffness_n_m_rad * np.outer(slope, slope)
    e, rho, _, h = section
    typical = e * h**2 / (12.0 * rho * mesh.length_m**4)
    # The rigid axial motion is an exact mode of frequency zero: it is lifted far above the others, which do not change.
    motion = np.zeros(mesh.n_dof)
    motion[0::3] = 1.0
    momentum = mass @ motion
    stiffness += 1e9 * typical / (motion @ momentum) * np.outer(momentum, momentum)
    squared, vectors = solve_modes(stiffness, mass, n_mode, typical)
    squared[squared < 1e-6 * typical] = 0.0
    return LapJointModes(np.sqrt(squared), mesh, vectors)


def _members(mesh: LapMesh, section: Section) -> tuple[Matrix, Matrix]:
    """Stiffness and mass [n_dof, n_dof] of arms and legs, not yet coupled."""
    stiffness, mass = np.zeros((2, mesh.n_dof, mesh.n_dof))
    for element, size in enumerate(np.diff(mesh.positions_m)):
        for left, right, e in mesh.members(element):
            thickness = section.thickness_m if e == 0.0 else section.thickness_m / 2.0
            element_stiffness, element_mass = _element(float(size), section._replace(thickness_m=thickness))
            dofs = [3 * left, 3 * right, *bending_dofs(left, right)]
            to_axis = np.eye(6)
            to_axis[0, 3], to_axis[1, 5] = -e, -e
            stiffness[np.ix_(dofs, dofs)] += to_axis.T @ element_stiffness @ to_axis
            mass[np.ix_(dofs, dofs)] += to_axis.T @ element_mass @ to_axis
    return stiffness, mass


def _element(size: float, section: Section) -> tuple[Matrix, Matrix]:
    """Stiffness and mass [6, 6] over the two axial displacements, then deflection and slope of both nodes."""
    area = section.width_m * section.thickness_m
    inertia = area * section.thickness_m**2 / 12.0
    stiffness, mass = np.zeros((2, 6, 6))
    stiffness[:2, :2] = section.youngs_modulus_pa * area / size * np.array([[1, -1], [-1, 1]])
    mass[:2, :2] = section.density_kg_m3 * area * size / 6.0 * np.array([[2, 1], [1, 2]])
    stiffness[2:, 2:], mass[2:, 2:] = bending_element(
        size, section.youngs_modulus_pa * inertia, section.density_kg_m3 * area
    )
    # Rotary inertia: the same integral of slope times slope as that of an axial preload.
    h = size
    mass[2:, 2:] += (section.density_kg_m3 * inertia / (30.0 * h)) * np.array(
        [
            [36, 3 * h, -36, 3 * h],
            [3 * h, 4 * h**2, -3 * h, -(h**2)],
            [-36, -3 * h, 36, -3 * h],
            [3 * h, -(h**2), -3 * h, 4 * h**2],
        ]
    )
    return stiffness, mass


def _add_interface(stiffness: Matrix, mesh: LapMesh, interface: Interface) -> None:
    """Springs between the legs' nodes; end nodes stand for half an element."""
    offsets = mesh.lap_positions_m[:, None] - np.array(interface.bolts_m)[None, :]
    weight = interface.floor + np.sum(np.exp(-(offsets**2) / (2.0 * interface.bolt_width_m**2)), axis=1)
    weight[[0, -1]] *= 0.5
    weight /= weight.sum()
    for upper, lower, share in zip(*mesh.legs, weight, strict=True):
        for dof, total in ((0, interface.tangential_n_m), (1, interface.normal_n_m)):
            pair = np.ix_([3 * upper + dof, 3 * lower + dof], [3 * upper + dof, 3 * lower + dof])
            stiffness[pair] += share * total * np.array([[1.0, -1.0], [-1.0, 1.0]])

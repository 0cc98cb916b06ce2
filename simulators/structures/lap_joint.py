"""Two beams joined by a bolted lap: mesh and modes, by finite elements.

The mesh has two full-thickness arms and, in the lap, two half-thickness legs. Every node has three coordinates
``(u, w, theta)`` on the mid-plane of the whole beam, which in the lap is the interface: axial displacement, deflection,
rotation ``w'``. A leg's own axis lies a quarter of the thickness above or below, so that ``u_axis = u - e theta``: bending
shears the legs' interfaces against each other. The upper leg continues the arm at position 0, the lower leg the other arm. Each
leg shares a node with its arm and is free at its other end.

The legs are coupled by springs between their interfaces, tangential ``u_upper - u_lower`` and normal ``w_upper -
w_lower``, peaked at the bolts. The elements are linear in the axial and cubic (Hermite) in the bending direction, with
consistent mass and rotary inertia (Rayleigh beam). With an infinitely stiff interface the joint becomes the full-thickness
beam. Shear of the sections and contact (opening, pressure that changes with vibration) are not modelled.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from simulators.structures.beam import Lump, Quantity, Spring, bending_element, hermite, solve_modes
from vibrolock.arrays import Float


@dataclass(frozen=True)
class LapMesh:
    """Nodes, numbered along the left arm, the rest of the upper leg, the lower leg, the rest of the right arm."""

    length_m: float
    lap_length_m: float
    thickness_m: float
    n_arm: int
    """Elements in each arm."""
    n_lap: int
    """Elements in each leg."""

    @cached_property
    def positions_m(self) -> Float:
        """Positions of all element ends [2 n_arm + n_lap + 1], along the beam."""
        first, last = (self.length_m - self.lap_length_m) / 2.0, (self.length_m + self.lap_length_m) / 2.0
        arms = np.linspace(0.0, first, self.n_arm + 1), np.linspace(last, self.length_m, self.n_arm + 1)
        return np.concatenate([arms[0], np.linspace(first, last, self.n_lap + 1)[1:-1], arms[1]])

    @property
    def n_dof(self) -> int:
        """Number of coordinates."""
        return 3 * (2 * self.n_arm + 2 * self.n_lap + 2)

    @property
    def legs(self) -> tuple[list[int], list[int]]:
        """Node numbers of the upper and the lower leg."""
        a, n = self.n_arm, self.n_lap
        return list(range(a, a + n + 1)), list(range(a + n + 1, a + 2 * n + 2))

    @property
    def lap_positions_m(self) -> Float:
        """Positions of the legs' nodes [n_lap + 1]."""
        return self.positions_m[self.n_arm : self.n_arm + self.n_lap + 1]

    def members(self, element: int) -> list[tuple[int, int, float]]:
        """Return left node, right node and eccentricity (m) of the arm, or of upper and lower leg, in one element."""
        if self.n_arm <= element < self.n_arm + self.n_lap:
            i = element - self.n_arm
            quarter = self.thickness_m / 4.0
            return [(leg[i], leg[i + 1], e) for leg, e in zip(self.legs, (quarter, -quarter), strict=True)]
        left = element if element < self.n_arm else element + 1 + self.n_lap
        return [(left, left + 1, 0.0)]

    def row(self, position_m: float, quantity: Quantity = "deflection") -> Float:
        """Return the row [n_dof] for deflection, slope or curvature: in the lap the legs' mean, at its edge the arm."""
        element, s, size = self._locate(position_m)
        members = self.members(element)
        row = np.zeros(self.n_dof)
        for left, right, _ in members:
            row[bending_dofs(left, right)] += hermite(s, size, quantity) / len(members)
        return row

    def axial_row(self, position_m: float) -> Float:
        """Return the row [n_dof] for the axial displacement of the mid-plane; in the lap the mean of both legs."""
        element, s, _ = self._locate(position_m)
        members = self.members(element)
        row = np.zeros(self.n_dof)
        for left, right, _ in members:
            row[[3 * left, 3 * right]] += np.array([1.0 - s, s]) / len(members)
        return row

    def slip_row(self, position_m: float) -> Float:
        """Return the row [n_dof] for the tangential displacement of the upper leg's interface relative to the lower leg's.

        Each interface moves by ``u_axis + e w'``. In an element, the axial displacement of the leg's axis is linear and the
        slope is quadratic. ``position_m`` lies in the lap.
        """
        element, s, size = self._locate(position_m, inwards=True)
        row = np.zeros(self.n_dof)
        for (left, right, e), sign in zip(self.members(element), (1.0, -1.0), strict=True):
            row[[3 * left, 3 * right]] += sign * np.array([1.0 - s, s])
            row[[3 * left + 2, 3 * right + 2]] -= sign * e * np.array([1.0 - s, s])
            row[bending_dofs(left, right)] += sign * e * hermite(s, size, "slope")
        return row

    def _locate(self, position_m: float, *, inwards: bool = False) -> tuple[int, float, float]:
        """Return the element at a position, the place in it from 0 to 1, and its size (m).

        At a node it is the element away from the middle of the beam or, with ``inwards``, towards the middle.
        """
        towards = 1.0 if (position_m < self.length_m / 2.0) == inwards else -1.0
        nodes = self.positions_m
        element = int(np.searchsorted(nodes, position_m + towards * 1e-9 * self.length_m)) - 1
        element = min(max(element, 0), nodes.size - 2)
        size = float(nodes[element + 1] - nodes[element])
        return element, (position_m - float(nodes[element])) / size, size


def bending_dofs(left: int, right: int) -> list[int]:
    """Return the indices of deflection and rotation of two nodes, in the order of the Hermite shapes."""
    return [3 * left + 1, 3 * left + 2, 3 * right + 1, 3 * right + 2]


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

    omega_rad_s: Float
    """Angular natural frequencies [n_mode]; exactly zero for rigid-body modes."""
    mesh: LapMesh
    """The mesh."""
    dofs: Float
    """Coordinates of every node [n_dof, n_mode]."""

    def shape(self, position_m: float, quantity: Quantity = "deflection") -> Float:
        """Mode shapes [n_mode] at a position: deflection (kg^-1/2), slope (per m) or curvature (per m^2)."""
        return self.mesh.row(position_m, quantity) @ self.dofs

    def slip(self, position_m: float) -> Float:
        """Return the tangential displacement [n_mode] (kg^-1/2) of the upper leg's interface relative to the lower leg's."""
        return self.mesh.slip_row(position_m) @ self.dofs


def lap_joint_modes(
    mesh: LapMesh,
    section: Section,
    interface: Interface,
    n_mode: int,
    lumps: Sequence[Lump] = (),
    springs: Sequence[Spring] = (),
) -> LapJointModes:
    """Return the lowest modes of the jointed beam on its springs; the rigid axial motion is not observable and is left out."""
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
    # The rigid axial motion is an exact mode of zero frequency. Added stiffness moves it far above the other modes, unchanged.
    motion = np.zeros(mesh.n_dof)
    motion[0::3] = 1.0
    momentum = mass @ motion
    stiffness += 1e9 * typical / (motion @ momentum) * np.outer(momentum, momentum)
    squared, vectors = solve_modes(stiffness, mass, n_mode, typical)
    squared[squared < 1e-6 * typical] = 0.0
    return LapJointModes(np.sqrt(squared), mesh, vectors)


def _members(mesh: LapMesh, section: Section) -> tuple[Float, Float]:
    """Return stiffness and mass [n_dof, n_dof] of arms and legs, not yet coupled."""
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


def _element(size: float, section: Section) -> tuple[Float, Float]:
    """Return stiffness and mass [6, 6] over the two axial displacements, then deflection and slope of both nodes."""
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


def _add_interface(stiffness: Float, mesh: LapMesh, interface: Interface) -> None:
    """Add the springs between the legs' nodes to ``stiffness``; end nodes represent half an element."""
    offsets = mesh.lap_positions_m[:, None] - np.array(interface.bolts_m)[None, :]
    weight = interface.floor + np.sum(np.exp(-(offsets**2) / (2.0 * interface.bolt_width_m**2)), axis=1)
    weight[[0, -1]] *= 0.5
    weight /= weight.sum()
    for upper, lower, share in zip(*mesh.legs, weight, strict=True):
        for dof, total in ((0, interface.tangential_n_m), (1, interface.normal_n_m)):
            pair = np.ix_([3 * upper + dof, 3 * lower + dof], [3 * upper + dof, 3 * lower + dof])
            stiffness[pair] += share * total * np.array([[1.0, -1.0], [-1.0, 1.0]])

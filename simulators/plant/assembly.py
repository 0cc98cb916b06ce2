"""Assembly of the coupled plant: linear part, site coordinates, outputs.

State ``x = [q, q', x_a, v_a, i]``: modal coordinates of the structure, armature, coil current; n = 2 n_mode + 3. Inputs:
the voltage u and the nonlinear site forces f. The linear stiffness of local elements is part of the linear plant: left in the
site force it would cost 8 % of the force and 0.18 percentage points of damping at a step of 0.2 ms.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from simulators.elements import Element
from simulators.exciter import Exciter, Stinger
from simulators.friction import FrictionSite
from simulators.structure import Structure

__all__ = ["LinearPlant", "assemble", "element_shape"]

Matrix = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class LinearPlant:
    """The coupled plant ``x' = A x + b_u u + B_f f`` with site coordinates ``C_s x``; sites are elements, then joints."""

    dynamics: Matrix
    """A [n, n]."""
    voltage_column: Matrix
    """b_u [n]."""
    site_columns: Matrix
    """B_f [n, n_site]."""
    site_rows: Matrix
    """C_s [n_site, n]; deflection (m) or velocity (m/s) of an element, coordinate of a joint."""
    modal_stiffness: Matrix
    """Stiffness of the structure in its modal coordinates [n_mode, n_mode], that of the elements included (s^-2)."""
    modal_damping: Matrix
    """Damping ``2 zeta_i w_i`` [n_mode] (1/s)."""
    stinger_row: Matrix
    """Stinger force ``k_s (x_a - x_d) + c_s (v_a - v_d)`` as a row over the state [n] (N)."""
    drive_shape: Matrix
    """Mode shapes at the drive point [n_mode] (kg^-1/2)."""
    signs: Matrix
    """Sign [n_mode] that each given shape was multiplied with, so that the drive point moves forward in every mode."""

    @property
    def n_mode(self) -> int:
        """Number of modes of the structure."""
        return self.drive_shape.size

    def force_row(self) -> Matrix:
        """Row [n + 1 + n_site] that reads the stinger force (N) off ``[x, u, f]``."""
        return np.concatenate([self.stinger_row, np.zeros(1 + self.site_rows.shape[0])])

    def acceleration_row(self, shape: Matrix) -> Matrix:
        """Row that reads the acceleration (m/s^2) of a point with the given mode shapes off ``[x, u, f]``."""
        accelerations = slice(self.n_mode, 2 * self.n_mode)
        forces = shape @ self.site_columns[accelerations]
        return np.concatenate([shape @ self.dynamics[accelerations], [0.0], forces])

    def displacement_row(self, shape: Matrix) -> Matrix:
        """Row that reads the displacement (m) of a point with the given mode shapes off ``[x, u, f]``."""
        row = np.zeros(self.dynamics.shape[0] + 1 + self.site_rows.shape[0])
        row[: self.n_mode] = shape
        return row


def assemble(
    structure: Structure,
    elements: Sequence[Element],
    joints: Sequence[FrictionSite],
    exciter: Exciter,
    stinger: Stinger,
) -> LinearPlant:
    """The linear part of the coupled plant, with every mode turned so that the drive point moves forward in it."""
    omega = structure.omega_rad_s
    signs = np.where(structure.shape(stinger.at) < 0.0, -1.0, 1.0)
    drive = signs * structure.shape(stinger.at)
    coordinates = [signs * element_shape(structure, element) for element in elements]
    stiffness = np.diag(omega**2)
    for element, row in zip(elements, coordinates, strict=True):
        stiffness += element.stiffness_n_m * np.outer(row, row)
    for joint in joints:
        row = signs * structure.shape(joint.at, joint.quantity)
        coordinates.append(row / row[0] if joint.relative_to_mode_1 else row)
    damping = 2.0 * np.array(structure.damping_ratio) * omega
    m = omega.size
    site_rows = np.zeros((len(coordinates), 2 * m + 3))
    site_columns = np.zeros((2 * m + 3, len(coordinates)))
    for site, row in enumerate(coordinates):
        moves_with = elements[site].moves_with if site < len(elements) else "deflection"
        first = m if moves_with == "velocity" else 0
        site_rows[site, first : first + m] = row
        site_columns[m : 2 * m, site] = row
    voltage = np.zeros(2 * m + 3)
    voltage[-1] = 1.0 / exciter.inductance_h
    stinger_row = np.concatenate(
        [
            -stinger.stiffness_n_m * drive,
            -stinger.damping_n_s_m * drive,
            [stinger.stiffness_n_m, stinger.damping_n_s_m, 0.0],
        ]
    )
    return LinearPlant(
        dynamics=_dynamics(stiffness, damping, drive, exciter, stinger_row),
        voltage_column=voltage,
        site_columns=site_columns,
        site_rows=site_rows,
        modal_stiffness=stiffness,
        modal_damping=damping,
        stinger_row=stinger_row,
        drive_shape=drive,
        signs=signs,
    )


def element_shape(structure: Structure, element: Element) -> Matrix:
    """Coordinate of an element over the modes [n_mode] (kg^-1/2), as the structure gives them."""
    shape = structure.shape(element.at)
    return shape if element.to is None else shape - structure.shape(element.to)


def _dynamics(stiffness: Matrix, damping: Matrix, drive: Matrix, exciter: Exciter, force: Matrix) -> Matrix:
    """A of the structure, the exciter and the stinger between them."""
    m = drive.size
    q, v = slice(0, m), slice(m, 2 * m)
    x_a, v_a, i = 2 * m, 2 * m + 1, 2 * m + 2
    dynamics = np.zeros((2 * m + 3, 2 * m + 3))
    dynamics[q, v] = np.eye(m)
    dynamics[v] = np.outer(drive, force)
    dynamics[v, q] -= stiffness
    dynamics[v, v] -= np.diag(damping)
    dynamics[x_a, v_a] = 1.0
    dynamics[v_a] = -force
    dynamics[v_a, x_a] -= exciter.suspension_stiffness_n_m
    dynamics[v_a, v_a] -= exciter.suspension_damping_n_s_m
    dynamics[v_a, i] += exciter.force_factor_n_a
    dynamics[v_a] /= exciter.armature_mass_kg
    dynamics[i, v_a] = -exciter.force_factor_n_a / exciter.inductance_h
    dynamics[i, i] = -exciter.resistance_ohm / exciter.inductance_h
    return dynamics

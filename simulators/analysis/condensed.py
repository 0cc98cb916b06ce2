"""The linear part of the coupled rig in the frequency domain, condensed to the inputs and outputs of the harmonic balance."""

import numpy as np
from numpy.typing import NDArray

from simulators.plant.assembly import LinearPlant
from simulators.virtual_rig import VirtualRig
from vibrolock.arrays import Complex

_NOT_HELD = "structure: has a motion that no stiffness holds, allowed is a rig that returns to rest"
_FREE = 1e-12
"""Static stiffness relative to the largest, below which a motion counts as free."""
_LOADED = 1e-6
"""Participation of a free motion in a site's coordinate, relative to the site's largest coefficient, that counts as load."""


class CondensedRig:
    """Transfer from site forces and voltage to site coordinates, stinger force and drive-point displacement.

    For each harmonic h of the angular frequency W, ``X_h = (i h W - A)^-1 (B_f F_h + b_u U_h)`` exactly. Time is continuous; a
    converter's hold is not included.
    """

    def __init__(self, rig: VirtualRig) -> None:
        plant = rig.plant
        n = plant.dynamics.shape[0]
        drive = plant.displacement_row(rig.shape(rig.stinger.at))[:n]
        self.n_site = plant.site_rows.shape[0]
        self.dynamics = plant.dynamics
        self.columns = np.column_stack([plant.site_columns, plant.voltage_column])
        self.rows = np.vstack([plant.site_rows, plant.force_row()[:n], drive])
        _check_held(plant)

    def resolvent(self, omega_rad_s: float, orders: NDArray[np.int64]) -> Complex:
        """Return ``(i h W - A)^-1`` [n_order, n, n]; raise `ValueError` if the rig has no static equilibrium."""
        s = 1j * omega_rad_s * orders[:, None, None]
        try:
            return np.asarray(np.linalg.inv(s * np.eye(self.dynamics.shape[0]) - self.dynamics))
        except np.linalg.LinAlgError:
            raise ValueError(_NOT_HELD) from None

    def transfer(self, omega_rad_s: float, orders: NDArray[np.int64]) -> tuple[Complex, Complex]:
        """Return T [n_order, n_site + 2, n_site + 1] and its derivative by W.

        `rows` lists the outputs, `columns` the inputs.
        """
        inverse = self.resolvent(omega_rad_s, orders)
        states, left = inverse @ self.columns, self.rows @ inverse
        return self.rows @ states, -1j * orders[:, None, None] * (left @ states)

    def states(self, omega_rad_s: float, inputs: Complex) -> Complex:
        """Return the harmonics of the state [n_order, n] from those of site forces and voltage [n_site + 1, n_order]."""
        orders = np.arange(inputs.shape[1])
        forced = self.columns @ inputs
        return np.asarray(np.einsum("hij,jh->hi", self.resolvent(omega_rad_s, orders), forced))


class CondensedStructure:
    """The structure without exciter under a purely sinusoidal force at the drive point.

    The interface is that of `CondensedRig`, with the force in place of the voltage. Outputs are read from the state of a rig
    whose armature moves so that the stinger transmits the given force: ``X_a,h = X_d,h + F_h / (k_s + i h W c_s)``.
    """

    def __init__(self, rig: VirtualRig) -> None:
        plant, m = rig.plant, rig.plant.n_mode
        self.n_site = plant.site_rows.shape[0]
        self.stinger = rig.stinger
        self.drive = plant.drive_shape
        self.stiffness, self.damping = plant.modal_stiffness, np.diag(plant.modal_damping)
        self.columns = np.column_stack([plant.site_columns[m : 2 * m], plant.drive_shape])
        self.rows, self.rate_rows = plant.site_rows[:, :m], plant.site_rows[:, m : 2 * m]
        _check_held(plant)

    def _receptance(self, omega_rad_s: float, orders: NDArray[np.int64]) -> tuple[Complex, Complex]:
        """Return ``(K + s C + s^2)^-1`` [n_order, n_mode, n_mode] at ``s = i h W``, and its derivative by W."""
        s = 1j * omega_rad_s * orders[:, None, None]
        try:
            inverse = np.linalg.inv(self.stiffness + s * self.damping + s**2 * np.eye(self.drive.size))
        except np.linalg.LinAlgError:
            raise ValueError(_NOT_HELD) from None
        slope = -inverse @ (1j * orders[:, None, None] * (self.damping + 2.0 * s * np.eye(self.drive.size))) @ inverse
        return inverse, slope

    def transfer(self, omega_rad_s: float, orders: NDArray[np.int64]) -> tuple[Complex, Complex]:
        """Return T [n_order, n_site + 2, n_site + 1] and its derivative by W.

        The outputs are site coordinates, force and drive displacement.
        """
        inverse, slope = self._receptance(omega_rad_s, orders)
        s = 1j * omega_rad_s * orders[:, None, None]
        drive = np.broadcast_to(self.drive.astype(np.complex128), (orders.size, 1, self.drive.size))
        rows = np.concatenate([self.rows + s * self.rate_rows, drive], axis=1)
        by_omega = np.zeros_like(rows)
        by_omega[:, : self.n_site] = 1j * orders[:, None, None] * self.rate_rows
        states = inverse @ self.columns
        value, change = rows @ states, rows @ (slope @ self.columns) + by_omega @ states
        force, none = np.zeros((2, orders.size, 1, self.n_site + 1), np.complex128)
        force[..., -1] = 1.0
        n = self.n_site
        return (
            np.concatenate([value[:, :n], force, value[:, n:]], axis=1),
            np.concatenate([change[:, :n], none, change[:, n:]], axis=1),
        )

    def states(self, omega_rad_s: float, inputs: Complex) -> Complex:
        """Return the harmonics of the rig's state [n_order, n] from those of site forces and force [n_site + 1, n_order]."""
        orders = np.arange(inputs.shape[1])
        s = 1j * omega_rad_s * orders
        modal = np.einsum("hij,jh->hi", self._receptance(omega_rad_s, orders)[0], self.columns @ inputs)
        armature = modal @ self.drive + inputs[-1] / (self.stinger.stiffness_n_m + s * self.stinger.damping_n_s_m)
        none = np.zeros_like(armature)
        return np.column_stack([modal, s[:, None] * modal, armature, s * armature, none])


def _check_held(plant: LinearPlant) -> None:
    """Raise `ValueError` if a site loads a motion without static stiffness: its static deflection would be unbounded.

    The static stiffness of modal coordinates and armature is ``K = -d(q'', v_a')/d(q, x_a)``; it is symmetric except for the
    factor of the armature's mass.
    """
    m = plant.n_mode
    moved, pushed = [*range(m), 2 * m], [*range(m, 2 * m), 2 * m + 1]
    values, vectors = np.linalg.eig(-plant.dynamics[np.ix_(pushed, moved)])
    free = np.real(vectors[:, np.real(values) < _FREE * np.max(np.abs(values))])
    rows = np.abs(plant.site_columns[pushed].T)
    if np.any(np.abs(plant.site_columns[pushed].T @ free) > _LOADED * np.max(rows, axis=1, keepdims=True, initial=0.0)):
        raise ValueError(_NOT_HELD)

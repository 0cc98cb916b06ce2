"""The linear part of the coupled rig in the frequency domain, condensed to what the harmonic balance needs."""

import numpy as np
from numpy.typing import NDArray

from simulators.plant.assembly import LinearPlant
from simulators.virtual_rig import VirtualRig

__all__ = ["CondensedRig", "CondensedStructure"]

Real = NDArray[np.float64]
Complex = NDArray[np.complex128]

_NOT_HELD = "structure: has a motion that no stiffness holds, allowed is a rig that returns to rest"
_FREE = 1e-12
"""Static stiffness over the largest there is, from which on down a motion counts as free."""
_LOADED = 1e-6
"""Share of its largest coefficient from which on a site's coordinate counts as moved."""


class CondensedRig:
    """Transfer from site forces and voltage to site coordinates, stinger force and drive-point displacement.

    Per harmonic h of the angular frequency W, exactly: ``X_h = (i h W - A)^-1 (B_f F_h + b_u U_h)``. The time is
    continuous: the hold of a converter is not in it.
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
        """``(i h W - A)^-1`` [n_order, n, n]; `ValueError` where the rig has no static equilibrium."""
        s = 1j * omega_rad_s * orders[:, None, None]
        try:
            return np.asarray(np.linalg.inv(s * np.eye(self.dynamics.shape[0]) - self.dynamics))
        except np.linalg.LinAlgError:
            raise ValueError(_NOT_HELD) from None

    def transfer(self, omega_rad_s: float, orders: NDArray[np.int64]) -> tuple[Complex, Complex]:
        """T [n_order, n_site + 2, n_site + 1] and its derivative by W; rows as `rows`, columns as `columns`."""
        inverse = self.resolvent(omega_rad_s, orders)
        states, left = inverse @ self.columns, self.rows @ inverse
        return self.rows @ states, -1j * orders[:, None, None] * (left @ states)

    def states(self, omega_rad_s: float, inputs: Complex) -> Complex:
        """Harmonics of the state [n_order, n] from those of site forces and voltage [n_site + 1, n_order]."""
        orders = np.arange(inputs.shape[1])
        forced = self.columns @ inputs
        return np.asarray(np.einsum("hij,jh->hi", self.resolvent(omega_rad_s, orders), forced))


class CondensedStructure:
    """The structure alone under a force of a pure sine at the drive point: no exciter feeds harmonics back.

    As `CondensedRig`, with the force in the place of the voltage. What the rig's outputs are read off is the state of a rig
    whose armature is moved so that the stinger's force is just that: ``X_a,h = X_d,h + F_h / (k_s + i h W c_s)``.
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
        """``(K + s C + s^2)^-1`` [n_order, n_mode, n_mode] at ``s = i h W``, and its derivative by W."""
        s = 1j * omega_rad_s * orders[:, None, None]
        try:
            inverse = np.linalg.inv(self.stiffness + s * self.damping + s**2 * np.eye(self.drive.size))
        except np.linalg.LinAlgError:
            raise ValueError(_NOT_HELD) from None
        slope = -inverse @ (1j * orders[:, None, None] * (self.damping + 2.0 * s * np.eye(self.drive.size))) @ inverse
        return inverse, slope

    def transfer(self, omega_rad_s: float, orders: NDArray[np.int64]) -> tuple[Complex, Complex]:
        """T [n_order, n_site + 2, n_site + 1] and its derivative by W: site coordinates, force, drive displacement."""
        inverse, slope = self._receptance(omega_rad_s, orders)
        s = 1j * omega_rad_s * orders[:, None, None]
        rows = np.concatenate([self.rows + s * self.rate_rows, self._drive_rows(orders)], axis=1)
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

    def _drive_rows(self, orders: NDArray[np.int64]) -> Complex:
        return np.broadcast_to(self.drive.astype(np.complex128), (orders.size, 1, self.drive.size))

    def states(self, omega_rad_s: float, inputs: Complex) -> Complex:
        """Harmonics of the rig's state [n_order, n] from those of site forces and force [n_site + 1, n_order]."""
        orders = np.arange(inputs.shape[1])
        s = 1j * omega_rad_s * orders
        modal = np.einsum("hij,jh->hi", self._receptance(omega_rad_s, orders)[0], self.columns @ inputs)
        armature = modal @ self.drive + inputs[-1] / (self.stinger.stiffness_n_m + s * self.stinger.damping_n_s_m)
        none = np.zeros_like(armature)
        return np.column_stack([modal, s[:, None] * modal, armature, s * armature, none])


def _check_held(plant: LinearPlant) -> None:
    """`ValueError` where a site pushes a motion that nothing holds at rest: its static deflection would have no bound.

    Static stiffness of modal coordinates and armature, ``K = -d(q'', v_a')/d(q, x_a)``: symmetric but for the armature's mass.
    """
    m = plant.n_mode
    moved, pushed = [*range(m), 2 * m], [*range(m, 2 * m), 2 * m + 1]
    values, vectors = np.linalg.eig(-plant.dynamics[np.ix_(pushed, moved)])
    free = np.real(vectors[:, np.real(values) < _FREE * np.max(np.abs(values))])
    rows = np.abs(plant.site_columns[pushed].T)
    if np.any(np.abs(plant.site_columns[pushed].T @ free) > _LOADED * np.max(rows, axis=1, keepdims=True, initial=0.0)):
        raise ValueError(_NOT_HELD)

"""The linear part of the coupled rig in the frequency domain, condensed to what the harmonic balance needs."""

import numpy as np
from numpy.typing import NDArray

from simulators.plant.assembly import LinearPlant
from simulators.virtual_rig import VirtualRig

__all__ = ["CondensedRig"]

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

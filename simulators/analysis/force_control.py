"""Stinger force whose harmonics a test controls: the voltage has the harmonics that this takes.

A controlled harmonic h is prescribed relative to the fundamental F_1 of the force, ``F_h = c_h |F_1| exp(i h arg F_1)``. The
angle of ``c_h`` is thus the phase of harmonic h where the fundamental of the force is at its maximum. The voltage V_h is
unknown. With the transfer of the coupled rig, ``F_h = T_Ff f_h + T_Fu V_h`` from site forces and voltage, every other output is
``y_h = (T_yf - c T_Ff) f_h + c F_h`` with ``c = T_yu / T_Fu``: the structure is driven by the prescribed force.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from numbers import Complex as Number

import numpy as np
from numpy.typing import NDArray

from vibrolock.arrays import Complex
from vibrolock.errors import InputError

ForceHarmonics = int | Mapping[int, complex]
"""Controlled harmonics of the force: the highest one, all from the second on being zero, or each with its value ``c_h``."""


@dataclass(frozen=True, eq=False)
class ForceControl:
    """Harmonics of the force that are prescribed, and their values."""

    orders: NDArray[np.int64]
    """Controlled harmonics [n], rising, each at least 2."""
    ratios: Complex
    """Values ``c_h`` [n] of ``F_h = c_h |F_1| exp(i h arg F_1)``."""

    @classmethod
    def of(cls, force_harmonics: ForceHarmonics | None, harmonics: int) -> "ForceControl":
        """Return the control of the given harmonics after a check; ``harmonics`` is the highest one that is computed."""
        ratios = _ratios({} if force_harmonics is None else force_harmonics, harmonics)
        orders = sorted(ratios)
        return cls(np.array(orders, dtype=np.int64), np.array([ratios[h] for h in orders], dtype=np.complex128))

    def driven(self, transfer: Complex, by_omega: Complex) -> tuple[Complex, Complex]:
        """Return the transfer [H + 1, n_site + 2, n_site + 1] and its derivative with the force as input where controlled.

        The last input of a controlled harmonic is the force instead of the voltage.
        """
        value, change, at = transfer.copy(), by_omega.copy(), self.orders
        whole, slope, force = transfer[at], by_omega[at], -2  # outputs: sites, force, drive displacement
        gain = whole[:, force, -1, None]
        share = whole[:, :, -1] / gain
        share_slope = (slope[:, :, -1] - share * slope[:, force, -1, None]) / gain
        value[at] = whole - share[:, :, None] * whole[:, force, None]
        change[at] = slope - share_slope[:, :, None] * whole[:, force, None] - share[:, :, None] * slope[:, force, None]
        value[at, :, -1], change[at, :, -1] = share, share_slope
        value[at, force], change[at, force] = np.eye(whole.shape[2])[-1], 0.0  # without rounding errors
        return value, change

    def forces(self, fundamental: complex, slope: Complex) -> tuple[Complex, Complex]:
        """Return the prescribed harmonics [n], and their derivatives [n, m] from that of the fundamental [m]."""
        phase = np.exp(1j * self.orders * np.angle(fundamental))
        forces = self.ratios * abs(fundamental) * phase
        relative = slope / fundamental  # d ln|F_1| + i d arg F_1
        return forces, forces[:, None] * (relative.real + 1j * np.outer(self.orders, relative.imag))

    def voltages(self, transfer: Complex, inputs: Complex) -> Complex:
        """Return the voltages [n] for ``inputs`` [n_site + 1, H + 1], whose last row has the forces where controlled."""
        rows = transfer[self.orders, -2]
        given = inputs[:, self.orders].T
        return np.asarray((given[:, -1] - np.sum(rows[:, :-1] * given[:, :-1], axis=1)) / rows[:, -1])


def _ratios(force_harmonics: ForceHarmonics, harmonics: int) -> dict[int, complex]:
    if isinstance(force_harmonics, Mapping):
        for order, ratio in force_harmonics.items():
            _check_order("force_harmonics: harmonic", order, harmonics)
            if not (isinstance(ratio, Number) and np.isfinite(complex(ratio))):
                allowed = "a finite number, real or complex"
                raise InputError(field=f"force_harmonics[{order}]", value=ratio, allowed=allowed)
        return {int(order): complex(ratio) for order, ratio in force_harmonics.items()}
    _check_order("force_harmonics", force_harmonics, harmonics)
    return dict.fromkeys(range(2, force_harmonics + 1), 0j)


def _check_order(field: str, order: object, harmonics: int) -> None:
    if not isinstance(order, int | np.integer) or isinstance(order, bool) or not 2 <= order <= harmonics:
        raise InputError(field=field, value=order, allowed=f"2 to {harmonics}, the highest harmonic computed")

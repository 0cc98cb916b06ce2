"""Linear modes of the structure and of the coupled rig."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from simulators.plant.assembly import LinearPlant

_FREE = 1e-6
"""Fraction of the highest frequency below which a frequency counts as zero, that of a free motion with rounding errors."""


@dataclass(frozen=True, eq=False)
class LinearModes:
    """Modes of a linear system, lowest frequency first."""

    frequency_hz: NDArray[np.float64]
    """Natural frequencies [n_mode], undamped."""
    damping_ratio: NDArray[np.float64]
    """Damping ratios [n_mode]."""
    drive_shape: NDArray[np.float64]
    """Mass-normalised deflection of the drive point [n_mode] (kg^-1/2), positive; empty for the coupled rig."""
    vectors: NDArray[np.float64]
    """Modes as columns over the structure's modal coordinates [n_mode, n_mode]; empty for the coupled rig."""

    def at(self, shape: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the mass-normalised deflection [n_mode] (kg^-1/2) of a point from its ``VirtualRig.shape``; structure only."""
        return shape @ self.vectors

    def nearest(self, near_hz: float) -> int:
        """Return the index of the mode nearest to a frequency; free motions (0 Hz) count only if there are no other modes."""
        held = self.frequency_hz > _FREE * np.max(self.frequency_hz)
        return int(np.argmin(np.where(held, np.abs(self.frequency_hz - near_hz), np.inf)))


def structure_modes(plant: LinearPlant) -> LinearModes:
    """Return the structure's undamped modes with linear elements and stuck joints; damping: diagonal of the modal matrix."""
    squared, vectors = np.linalg.eigh(plant.modal_stiffness)
    omega = np.sqrt(np.maximum(squared, 0.0))
    drive = plant.drive_shape @ vectors
    vectors = vectors * np.where(drive < 0.0, -1.0, 1.0)
    damping = np.einsum("ik,i,ik->k", vectors, plant.modal_damping, vectors)
    ratio = np.divide(damping, 2.0 * omega, out=np.zeros_like(omega), where=omega > 0.0)
    return LinearModes(omega / (2.0 * np.pi), ratio, np.abs(drive), vectors)


def coupled_modes(plant: LinearPlant) -> LinearModes:
    """Return the oscillating eigenvalues of the coupled rig with the voltage as input."""
    poles = np.linalg.eigvals(plant.dynamics)
    poles = poles[poles.imag > 0.0]
    poles = poles[np.argsort(np.abs(poles))]
    empty = np.empty((0, 0))
    return LinearModes(np.abs(poles) / (2.0 * np.pi), -poles.real / np.abs(poles), empty[0:0].ravel(), empty)

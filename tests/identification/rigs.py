"""Closed-form linear rigs whose measurements the tests identify."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from identification import Channel, PeriodicVibration

CHANNELS = (Channel("force", "force", "N"), Channel("drive", "drive", "m/s2"))
PHI = 1.7


def one_mode_point(
    lag_deg: float = 90.0,
    *,
    f0_hz: float = 24.37,
    zeta: float = 0.004,
    forces: Sequence[complex] = (0.0, 0.3),
    unit: str = "m/s2",
) -> PeriodicVibration:
    """Steady state of one linear mode at the frequency where displacement lags force by ``lag_deg``.

    ``forces`` are the force's harmonics from 0; tan(lag) = 2 z r / (1 - r^2) is solved for r = W / w0.
    """
    slope = zeta / np.tan(np.radians(lag_deg))
    ratio = -slope + np.sqrt(slope**2 + 1.0)
    omega0, omega = 2 * np.pi * f0_hz, 2 * np.pi * f0_hz * ratio
    force = np.asarray(forces, dtype=complex)
    s = 1j * omega * np.arange(force.size)
    displacement = PHI**2 * force / (s**2 + 2 * zeta * omega0 * s + omega0**2)
    motion = displacement * s ** {"m": 0, "m/s": 1, "m/s2": 2}[unit]
    channels = (CHANNELS[0], Channel("drive", "drive", unit))
    return PeriodicVibration(channels, omega / (2 * np.pi), np.array([force, motion]), 50, np.zeros(2))


def sampled(harmonics: NDArray[np.complex128], theta: NDArray[np.float64]) -> NDArray[np.float64]:
    """float[n_channels, n]: Re sum_h Y_h exp(i h theta)."""
    return np.real(harmonics @ np.exp(1j * np.outer(np.arange(harmonics.shape[1]), theta)))

"""Nonlinear modes with given properties, as if identified without error."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from identification import NonlinearMode

SHAPE = 1.7
F0_HZ = 24.0
ZETA = 0.005


def mode_with(
    q: ArrayLike, frequency_hz: ArrayLike = F0_HZ, damping: ArrayLike = ZETA, **changes: Any
) -> NonlinearMode:
    """One level per modal amplitude; force at phase resonance, drive shape 1.7, no harmonics."""
    amplitude = np.atleast_1d(np.asarray(q, dtype=float))
    frequency, z = (np.broadcast_to(value, amplitude.shape).astype(float) for value in (frequency_hz, damping))
    force = 2.0 * z * (2 * np.pi * frequency) ** 2 * amplitude / SHAPE
    none, zero = np.full(amplitude.shape, np.nan), np.zeros(amplitude.shape)
    harmonics = np.column_stack([zero, force, zero]).astype(complex)
    values: dict[str, Any] = {
        "force_n": force,
        "frequency_hz": frequency,
        "phase_lag_deg": np.full(amplitude.shape, 90.0),
        "amplitude_m": SHAPE * amplitude,
        "modal_frequency_hz": frequency,
        "modal_frequency_std_hz": zero,
        "damping_ratio": z,
        "damping_ratio_std": zero,
        "damping_ratio_total_power": z,
        "damping_ratio_uncorrected": z,
        "modal_amplitude": amplitude,
        "apparent_mass_kg": np.full(amplitude.shape, SHAPE**-2),
        "mac": none,
        "force_purity": none,
        "response_purity": none,
        "fit_residual": none,
        "force_harmonics": harmonics,
        "response_harmonics_m": harmonics,
        "source": "backbone",
        "specimen": "beam",
    }
    return NonlinearMode(**(values | changes))


def duffing(q: ArrayLike, zeta: float = ZETA, hardening: float = 900.0) -> NonlinearMode:
    """Levels of ``w^2 = w0^2 (1 + hardening q^2)``, constant damping ratio."""
    amplitude = np.asarray(q, dtype=float)
    return mode_with(amplitude, F0_HZ * np.sqrt(1.0 + hardening * amplitude**2), zeta)

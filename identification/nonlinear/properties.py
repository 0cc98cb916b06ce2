"""The one-mode equation, evaluated for all points and all Monte Carlo draws at once.

It is ``D = (phi_d F / q) exp(i psi) = w^2 + s^2 + 2 s w z`` with ``s = i W + sigma``. sigma is the relative rate at which the
fundamental of the motion still drifted. The energy that a growing vibration stores, and that a decaying one returns, is not
counted as damping. To first order ``D = w^2 - W^2 + 2 i W (w z + sigma)``.
"""

from dataclasses import dataclass

import numpy as np

from vibrolock.arrays import Complex, Float


@dataclass(frozen=True, eq=False)
class States:
    """Vibrations at n points; ``...`` is the axis of the draws, or no axis."""

    frequency_hz: Float
    """float[n], frequency of the vibration."""
    force: Complex
    """complex[..., n, H + 1], harmonics of the force, N."""
    drive_m: Complex
    """complex[..., n, H + 1], harmonics of the drive-point displacement."""
    drift: Complex
    """complex[..., n], relative drift rate sigma of the motion, 1/s."""
    deflection_m: Complex
    """complex[..., n, C], fundamentals at the channels of the shapes, m."""
    inverse: Float | None
    """float[..., M, C], pseudo-inverse of the mass-normalised shapes; None without shapes."""
    drive_shape: float | Float | None
    """Mass-normalised shape at the drive point, used without ``inverse``; a number, or float[..., 1] for draws that
    differ. None if unknown."""
    linear_shape: Float
    """float[..., K], linear shape for the MAC; K = 0 for none."""
    linear_columns: tuple[int, ...]
    """Its K columns in ``deflection_m``."""


def properties(states: States) -> dict[str, Float]:
    """Return the properties of `NonlinearMode` by name, float[..., n] each; NaN where they are unknown."""
    omega = 2.0 * np.pi * states.frequency_hz
    force, drive = states.force[..., 1], states.drive_m[..., 1]
    turn = force * np.conj(drive)
    found = {
        "force_n": np.abs(force),
        "amplitude_m": np.abs(drive),
        "phase_lag_deg": np.degrees(np.angle(turn)),
        "mac": _mac(states),
        "force_purity": _purity(states.force),
        "response_purity": _purity(states.drive_m),
    }
    q = _modal_amplitude(states)
    if q is None:
        unknown = np.full(turn.shape, np.nan)
        names = ("modal_amplitude", "apparent_mass_kg", "damping_ratio", "damping_ratio_total_power")
        still = np.broadcast_to(states.frequency_hz, turn.shape)
        return {
            **found,
            "modal_frequency_hz": still,
            "damping_ratio_uncorrected": unknown,
            **dict.fromkeys(names, unknown),
        }
    squared = omega**2 + turn.real / q**2 + 2.0 * omega * states.drift.imag
    modal = np.sqrt(np.where(squared > 0.0, squared, np.nan))
    powers = _active_powers(states, omega)
    scale, stored = omega**2 * modal * q**2, states.drift.real / modal
    return {
        **found,
        "modal_amplitude": q,
        "apparent_mass_kg": (q / np.abs(drive)) ** 2,
        "modal_frequency_hz": modal / (2.0 * np.pi),
        "damping_ratio": powers[..., 0] / scale - stored,
        "damping_ratio_total_power": np.sum(powers, axis=-1) / scale - stored,
        "damping_ratio_uncorrected": powers[..., 0] / (omega**3 * q**2),
    }


def _modal_amplitude(states: States) -> Float | None:
    """Modal amplitude ``q^2 = psi^H (Phi^T)^+ Phi^+ psi`` (founding paper), or ``|Q_d| / phi_d``."""
    if states.inverse is not None:
        modal = np.einsum("...mc,...nc->...nm", states.inverse, states.deflection_m)
        return np.asarray(np.linalg.norm(modal, axis=-1))
    if states.drive_shape is not None:
        return np.asarray(np.abs(states.drive_m[..., 1]) / np.abs(states.drive_shape))
    return None


def _active_powers(states: States, omega: Float) -> Float:
    """float[..., n, H]: mean power of the force at harmonics 1 to H, W."""
    orders = np.arange(1, states.force.shape[-1])
    velocity = 1j * omega[:, None] * orders * states.drive_m[..., 1:]
    return np.asarray(0.5 * np.real(states.force[..., 1:] * np.conj(velocity)))


def _purity(harmonics: Complex) -> Float:
    """float[..., n]: amplitude of the fundamental over the root sum of squares of all harmonics from the first."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.abs(harmonics[..., 1]) / np.linalg.norm(harmonics[..., 1:], axis=-1))


def _mac(states: States) -> Float:
    """float[..., n]: ``|a^T b|^2 / ((a^T a) (b^H b))`` of the linear shape and the measured one."""
    if not states.linear_columns:
        return np.full(states.force.shape[:-1], np.nan)
    measured, linear = states.deflection_m[..., states.linear_columns], states.linear_shape
    product = np.abs(np.einsum("...k,...nk->...n", linear, measured)) ** 2
    size = np.sum(linear**2, axis=-1)[..., None] * np.sum(np.abs(measured) ** 2, axis=-1)
    return np.asarray(product / size)

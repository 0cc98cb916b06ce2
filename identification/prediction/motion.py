"""From steady states of one mode to what sensors measure: drive point, other points, the other modes' share."""

import numpy as np
from numpy.typing import NDArray

from identification.linear.modes import LinearModes
from identification.nonlinear.nonlinear_modes import NonlinearMode
from identification.prediction.properties import FLAGGED_BEYOND, REFUSED_BEYOND, ModalProperties
from identification.prediction.steady_states import modal_stiffness
from identification.validation import one_specimen

__all__ = ["fundamental_motion", "range_notes"]

Complex = NDArray[np.complex128]
Float = NDArray[np.float64]


def fundamental_motion(
    mode: NonlinearMode,
    properties: ModalProperties,
    q: Float,
    omega: Float,
    fundamental_n: Float,
    modes: LinearModes | None,
    residuals: bool,
) -> tuple[tuple[str, ...], Complex]:
    """Names of the channels, drive point first, and complex[n, n_channels] displacement against the force.

    Parameters
    ----------
    mode, properties
        The nonlinear mode and what was made of it.
    q, omega, fundamental_n
        float[n], modal amplitude, frequency W (rad/s) and peak of the fundamental of the force (N) of each state.
    modes
        Linear modes for the other channels: their part in the tested mode goes with the drive point's. Else None.
    residuals
        Whether to add the linear response of all modes but the tested one.
    """
    lag = np.angle(modal_stiffness(properties, q, omega)) + _turn_rad(mode, q)
    drive = properties.drive_shape(q) * q * np.exp(-1j * lag)
    if modes is None:
        return ("drive",), drive[:, None]
    one_specimen(mode=mode.specimen, modes=modes.specimen)
    frequency = omega / (2.0 * np.pi)
    tested = modes.nearest(float(mode.modal_frequency_hz[int(np.argmin(mode.amplitude_m))]))
    order = [modes.drive_row, *(row for row in range(len(modes.channels)) if row != modes.drive_row)]
    ratio = modes.shapes[order, tested] / modes.drive_shape[tested]
    motion = drive[:, None] * ratio
    names = tuple(modes.channels[row].name for row in order)
    if residuals:
        others = np.column_stack([modes.receptance(frequency, name, without=tested) for name in names])
        motion = motion + others * fundamental_n[:, None]
    return names, motion


def _turn_rad(mode: NonlinearMode, q: Float) -> Float:
    """float[n]: turn of the modal constant over q, which a fit of stepped sines has found; else zero."""
    if mode.source != "stepped sine":
        return np.zeros_like(q)
    at = mode.amplitude_m * np.sqrt(mode.apparent_mass_kg)
    order = np.argsort(at, kind="stable")
    return np.asarray(np.interp(q, at[order], np.radians(mode.phase_lag_deg[order] - 90.0)))


def range_notes(properties: ModalProperties, q: Float) -> list[str]:
    """Whether a response leaves the identified range, one line each."""
    use = float(properties.range_use(np.max(q)))
    notes = []
    if use > REFUSED_BEYOND:
        notes.append(f"reaches {use:.2f} times the largest modal amplitude identified: not to be trusted")
    elif use > FLAGGED_BEYOND:
        notes.append(f"reaches {use:.2f} times the largest modal amplitude identified: extrapolated")
    if np.max(q) < properties.q_range[0]:
        notes.append("stays below the lowest level identified: modal properties are those of the lowest level")
    return notes

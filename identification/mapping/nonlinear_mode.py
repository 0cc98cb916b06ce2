"""Import identified nonlinear modes from elsewhere, given as a table over the level, as `NonlinearMode`."""

from typing import Any, Literal

import numpy as np

from identification.errors import IdentificationError
from identification.mapping.base import MeasurementMapping, Path, numbers, value_at
from identification.mapping.units import si_of
from identification.nonlinear.nonlinear_modes import NonlinearMode

_ORDER = {"m": 0, "m/s": 1, "m/s2": 2}


class NonlinearModeMapping(MeasurementMapping):
    """Where the properties of a nonlinear mode are in the data and what they mean."""

    kind: Literal["nonlinear-mode"]
    source: str = "imported"
    """Where the data comes from."""
    values: Literal["peak", "rms"]
    """Whether amplitudes and forces are stored as peak or as RMS."""
    frequency: Path
    """Path of the modal frequencies."""
    frequency_unit: Literal["Hz", "rad/s"] = "Hz"
    """Unit of the frequencies."""
    damping: Path
    """Path of the modal damping ratios."""
    damping_unit: Literal["1", "%"]
    """Unit of the damping ratios."""
    amplitude: Path
    """Path of the amplitudes at the drive point."""
    amplitude_unit: str
    """Unit of the amplitudes; it also says whether they are displacement, velocity or acceleration."""
    force: Path | None = None
    """Path of the fundamental forces."""
    force_unit: str = "N"
    """Unit of the forces."""
    drive_mode_shape: float | None = None
    """Mass-normalised shape at the drive point, kg^-1/2; if given, the modal amplitude is computed."""


def map_nonlinear_mode(data: Any, mapping: NonlinearModeMapping) -> NonlinearMode:
    """Return the mode in ``data`` in SI units and peak values; properties that the table does not give are NaN.

    Raises `IdentificationError` if a path does not exist, lengths differ, values are NaN, or a unit is unknown.

    Parameters
    ----------
    data
        What a file holds: nested mappings and arrays, as its reader returns them.
    mapping
        Where the quantities lie, in which units.
    """
    columns = {"frequency": mapping.frequency, "damping": mapping.damping, "amplitude": mapping.amplitude}
    if mapping.force is not None:
        columns["force"] = mapping.force
    stored = {}
    for name, path in columns.items():
        stored[name] = np.asarray(numbers(value_at(data, path, name), 1, f"{name} '{path}'"), dtype=np.float64)
        if not np.all(np.isfinite(stored[name])):
            reason = f"{name} '{path}': is not finite at [{int(np.argmin(np.isfinite(stored[name])))}]"
            raise IdentificationError(reason)
    if len({array.size for array in stored.values()}) > 1:
        sizes = ", ".join(f"{name} {array.size}" for name, array in stored.items())
        raise IdentificationError(f"unequal lengths ({sizes})", field="columns")
    frequency = stored["frequency"] / (1.0 if mapping.frequency_unit == "Hz" else 2.0 * np.pi)
    damping = stored["damping"] * (0.01 if mapping.damping_unit == "%" else 1.0)
    peak = np.sqrt(2.0) if mapping.values == "rms" else 1.0
    unit, factor = si_of(mapping.amplitude_unit, "amplitude_unit")
    if unit not in _ORDER:
        allowed = "a displacement, velocity or acceleration"
        raise IdentificationError(field="amplitude_unit", value=mapping.amplitude_unit, allowed=allowed)
    amplitude = stored["amplitude"] * factor * peak / (2.0 * np.pi * frequency) ** _ORDER[unit]
    force_unit, force_factor = si_of(mapping.force_unit, "force_unit")
    IdentificationError.raise_if(force_unit != "N", field="force_unit", value=mapping.force_unit, allowed="a force")
    force = stored["force"] * force_factor * peak if "force" in stored else np.full(frequency.size, np.nan)
    return _mode(mapping, frequency, damping, amplitude, force)


def _mode(mapping: NonlinearModeMapping, frequency: Any, damping: Any, amplitude: Any, force: Any) -> NonlinearMode:
    shape = np.nan if mapping.drive_mode_shape is None else abs(mapping.drive_mode_shape)
    nothing = np.zeros(frequency.size, dtype=np.complex128)
    return NonlinearMode(
        force_n=force,
        frequency_hz=frequency,
        phase_lag_deg=np.full(frequency.size, 90.0),
        amplitude_m=amplitude,
        modal_frequency_hz=frequency,
        damping_ratio=damping,
        modal_amplitude=amplitude / shape,
        apparent_mass_kg=np.full(frequency.size, 1.0 / shape**2),
        force_harmonics=np.stack([nothing, force + 0j], axis=1),
        response_harmonics_m=np.stack([nothing, -1j * amplitude], axis=1),
        source=mapping.source,
        specimen=mapping.specimen,
        notes=("imported: only what the table says is known",),
    )

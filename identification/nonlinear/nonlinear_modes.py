"""An identified nonlinear mode: modal frequency and damping ratio over the vibration level."""

from dataclasses import dataclass, field, fields
from typing import Any, get_origin

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.storage import stored
from identification.validation import read_only, table_rows
from vibrolock.arrays import Complex, Float
from vibrolock.results import Result

STANDARD_ERRORS = {
    "force_n": "force_std_n",
    "amplitude_m": "amplitude_std_m",
    "phase_lag_deg": "phase_lag_std_deg",
    "modal_frequency_hz": "modal_frequency_std_hz",
    "damping_ratio": "damping_ratio_std",
    "damping_ratio_total_power": "damping_ratio_total_power_std",
    "modal_amplitude": "modal_amplitude_std",
    "apparent_mass_kg": "apparent_mass_std_kg",
    "mac": "mac_std",
    "force_purity": "force_purity_std",
    "response_purity": "response_purity_std",
}
"""Quantities of a nonlinear mode, and the fields that hold their standard errors."""
QUANTITIES = tuple(STANDARD_ERRORS)

_LATER = tuple(name for name in STANDARD_ERRORS.values() if name not in ("modal_frequency_std_hz", "damping_ratio_std"))
"""Standard errors that files of the first versions lack."""
_TABLE = (
    *("force_n", "frequency_hz", "amplitude_m", "phase_lag_deg", "modal_frequency_hz", "modal_frequency_std_hz"),
    *("damping_ratio", "damping_ratio_std", "damping_ratio_total_power", "damping_ratio_uncorrected"),
    *("modal_amplitude", "mac", "force_purity", "response_purity", "fit_residual"),
    *_LATER,
)


def _unknown() -> Float:
    """Return NaN, which the mode expands to one entry per point."""
    return np.array(np.nan)


def _note_missing_errors(arrays: dict[str, NDArray[Any]], attributes: dict[str, Any]) -> None:
    """Add a note to files of earlier versions, which hold fewer standard errors."""
    notes = attributes.get("notes", [])
    later = (*_LATER, "systematic_std", "random_std", "interval_95")
    if any(name not in arrays for name in later) and _EARLIER not in notes:
        attributes["notes"] = [*notes, _EARLIER]


@stored(upgrade=_note_missing_errors)
@dataclass(frozen=True, eq=False, kw_only=True)
class NonlinearMode(Result):
    """Properties of one nonlinear mode, one entry per measured point or level; NaN marks unknown values.

    Parameters
    ----------
    force_n
        float[n], peak of the fundamental of the force (at the modal frequency, where it comes from a fit).
    frequency_hz
        float[n], frequency of the vibration that was measured.
    phase_lag_deg
        float[n], lag of the displacement behind the force at ``frequency_hz``; 90 is phase resonance.
    amplitude_m
        float[n], peak of the fundamental of the displacement at the drive point (or of the measured response).
    modal_frequency_hz, modal_frequency_std_hz
        float[n], undamped modal frequency with its standard error.
    damping_ratio, damping_ratio_std
        float[n], modal damping ratio from the active power of the fundamental, with its standard error.
    damping_ratio_total_power
        float[n], modal damping ratio from the active power of all harmonics.
    damping_ratio_uncorrected
        float[n], damping ratio computed with the frequency of the vibration in place of the modal frequency.
    modal_amplitude
        float[n], modal amplitude q, kg^1/2 m.
    apparent_mass_kg
        float[n], ``1 / (phi_force phi_response)``: ``(w^2 - W^2 + 2 i W w z) X = F / apparent_mass`` near resonance.
    mac
        float[n], MAC of the fundamental of the deflection shape against the linear one.
    force_purity, response_purity
        float[n], ``|Y_1| / sqrt(sum_{h>=1} |Y_h|^2)`` of the force and of the drive-point displacement.
    force_std_n, amplitude_std_m, phase_lag_std_deg
        float[n], standard errors of the quantities of these names, from all known sources of error.
    damping_ratio_total_power_std, modal_amplitude_std, apparent_mass_std_kg
        float[n], likewise.
    mac_std, force_purity_std, response_purity_std
        float[n], likewise.
    systematic_std
        float[n, n_quantities], the part of the standard errors that is common to all points (shapes, calibration), in the
        order of `QUANTITIES`; more points do not reduce it. See `systematic`.
    random_std
        float[n, n_quantities], the part of the standard errors that is independent between points; see `random`.
    interval_95
        float[n, n_quantities, 2], interval that holds the true value in 95 % of cases; see `interval`.
    fit_residual
        float[n], RMS residual of the fit relative to the measured data; NaN where nothing was fitted.
    force_harmonics, response_harmonics_m
        complex[n, H + 1], harmonics of force (N) and displacement (m) at the drive point.
    source
        ``backbone``, ``stepped sine`` or ``several backbones``.
    specimen
        Name of what was tested.
    notes
        Remarks on the quality of the result, one line each.
    drive_mode_shape, drive_mode_shape_std
        Mass-normalised mode shape at the drive point that damping and modal amplitude were computed with, kg^-1/2, and its
        standard error, which is in those of both; None if unknown, or if the shapes of a linear model were used.
    drive_mode_shape_source
        Where this mode shape comes from, in words; empty if it was not noted.
    """

    force_n: Float
    frequency_hz: Float
    phase_lag_deg: Float
    amplitude_m: Float
    modal_frequency_hz: Float
    modal_frequency_std_hz: Float = field(default_factory=_unknown)
    damping_ratio: Float
    damping_ratio_std: Float = field(default_factory=_unknown)
    damping_ratio_total_power: Float = field(default_factory=_unknown)
    damping_ratio_uncorrected: Float = field(default_factory=_unknown)
    modal_amplitude: Float = field(default_factory=_unknown)
    apparent_mass_kg: Float
    mac: Float = field(default_factory=_unknown)
    force_purity: Float = field(default_factory=_unknown)
    response_purity: Float = field(default_factory=_unknown)
    fit_residual: Float = field(default_factory=_unknown)
    force_harmonics: Complex
    response_harmonics_m: Complex
    source: str
    specimen: str = ""
    notes: tuple[str, ...] = ()
    drive_mode_shape: float | None = None
    drive_mode_shape_std: float | None = None
    drive_mode_shape_source: str = ""
    force_std_n: Float = field(default_factory=_unknown)
    amplitude_std_m: Float = field(default_factory=_unknown)
    phase_lag_std_deg: Float = field(default_factory=_unknown)
    damping_ratio_total_power_std: Float = field(default_factory=_unknown)
    modal_amplitude_std: Float = field(default_factory=_unknown)
    apparent_mass_std_kg: Float = field(default_factory=_unknown)
    mac_std: Float = field(default_factory=_unknown)
    force_purity_std: Float = field(default_factory=_unknown)
    response_purity_std: Float = field(default_factory=_unknown)
    systematic_std: Float = field(default_factory=_unknown)
    random_std: Float = field(default_factory=_unknown)
    interval_95: Float = field(default_factory=_unknown)

    def __post_init__(self) -> None:
        n = len(self.force_n)
        further: dict[str, tuple[int, ...]] = dict.fromkeys(("systematic_std", "random_std"), (n, len(QUANTITIES)))
        further["interval_95"] = (n, len(QUANTITIES), 2)
        for name in _ARRAYS:
            harmonic = name in _HARMONICS
            array = read_only(getattr(self, name), np.complex128 if harmonic else np.float64)
            if array.ndim == 0:
                array = read_only(np.full(further.get(name, (n,)), array), np.float64)
            object.__setattr__(self, name, array)
            allowed = (n, array.shape[-1]) if harmonic and array.ndim else further.get(name, (n,))
            if array.shape != allowed:
                raise IdentificationError(f"shape {array.shape} does not fit {n} points", field=name)
        IdentificationError.raise_if(not n, "a nonlinear mode needs at least one point", field="force_n")

    def systematic(self, quantity: str) -> Float:
        """float[n]: standard error of ``quantity`` (a name in `QUANTITIES`) that is common to all points."""
        return np.asarray(self.systematic_std[:, _column(quantity)])

    def random(self, quantity: str) -> Float:
        """float[n]: standard error of ``quantity`` that is independent between points; NaN if unknown."""
        return np.asarray(self.random_std[:, _column(quantity)])

    def interval(self, quantity: str) -> Float:
        """float[n, 2]: lower and upper end of the 95 % interval of ``quantity``."""
        return np.asarray(self.interval_95[:, _column(quantity)])

    def bound_95(self, quantity: str) -> Float:
        """float[n]: distance to the farther end of the 95 % interval of ``quantity``, to print after +-.

        If the interval is unknown, it is 1.96 standard errors.
        """
        ends = self.interval(quantity)
        farther = np.max(np.abs(ends - np.asarray(getattr(self, quantity))[:, None]), axis=1)
        normal = 1.96 * np.asarray(getattr(self, STANDARD_ERRORS[quantity]))
        return np.asarray(np.where(np.isfinite(farther), farther, normal))

    def interval_at(self, axis: str, quantity: str) -> Float:
        """float[n, 2]: ends of the 95 % interval of the backbone's ``quantity`` at the estimated ``axis`` of each point.

        ``axis``: force_n or amplitude_m. `interval` is about the recorded vibration, at its true amplitude. At the measured
        force the true backbone has another value: 1.96 standard errors of the force times the slope between the neighbouring
        points are added at both ends (not in quadrature: the same errors may be in both). NaN with fewer than two levels.
        """
        IdentificationError.unless_one_of("axis", axis, _AXES)
        along, values = np.asarray(getattr(self, axis)), np.asarray(getattr(self, quantity))
        error = 1.96 * np.asarray(getattr(self, STANDARD_ERRORS[axis])) * np.abs(_slopes(along, values))
        return np.asarray(self.interval(quantity) + error[:, None] * np.array([-1.0, 1.0]))

    @property
    def frequency_shift(self) -> float:
        """Modal frequency at the largest amplitude over that at the smallest, minus one."""
        smallest, largest = int(np.argmin(self.amplitude_m)), int(np.argmax(self.amplitude_m))
        return float(self.modal_frequency_hz[largest] / self.modal_frequency_hz[smallest] - 1.0)

    def force_harmonic_ratio(self, harmonic: int) -> Float:
        """float[n]: ``|F_h / F_1|``; NaN if that harmonic was not measured."""
        if not 0 <= harmonic < self.force_harmonics.shape[1]:
            return np.full(len(self.force_n), np.nan)
        return np.asarray(np.abs(self.force_harmonics[:, harmonic] / self.force_harmonics[:, 1]))

    def table(self) -> list[dict[str, float | None]]:
        """Return one JSON-able dictionary per point, with None for unknown values."""
        columns = {name: getattr(self, name) for name in _TABLE}
        columns["modal_frequency_bound_95_hz"] = self.bound_95("modal_frequency_hz")
        columns["damping_ratio_bound_95"] = self.bound_95("damping_ratio")
        columns["f2_over_f1"] = self.force_harmonic_ratio(2)
        columns["f3_over_f1"] = self.force_harmonic_ratio(3)
        return table_rows(columns)


_ARRAYS = tuple(entry.name for entry in fields(NonlinearMode) if get_origin(entry.type) is np.ndarray)
_EARLIER = "written by an earlier version: identify the recording again for the standard errors that are missing"
_HARMONICS = ("force_harmonics", "response_harmonics_m")
_AXES = ("force_n", "amplitude_m")
_SAME_LEVEL = 0.01  # relative distance of points that were measured at one level


def _column(quantity: str) -> int:
    IdentificationError.unless_one_of("quantity", quantity, QUANTITIES)
    return QUANTITIES.index(quantity)


def _slopes(along: Float, values: Float) -> Float:
    """float[n]: slope of ``values`` between the nearest points at a lower and at a higher level; at the ends to the nearest."""
    out = np.full(along.size, np.nan)
    for number, here in enumerate(along):
        below = np.flatnonzero(along < (1.0 - _SAME_LEVEL) * here)
        above = np.flatnonzero(along > (1.0 + _SAME_LEVEL) * here)
        first = below[np.argmax(along[below])] if below.size else number
        last = above[np.argmin(along[above])] if above.size else number
        if first != last:
            out[number] = (values[last] - values[first]) / (along[last] - along[first])
    return out

"""What a free decay tells of its modes."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from identification.channels import Channel
from identification.errors import IdentificationError
from identification.nonlinear.nonlinear_modes import QUANTITIES, STANDARD_ERRORS, NonlinearMode
from identification.storage import stored
from vibrolock.arrays import Complex, Float
from vibrolock.results import Result

_TABLE = (
    *("amplitude_m", "time_s", "frequency_hz", "modal_frequency_hz", "modal_frequency_std_hz"),
    *("modal_frequency_systematic_hz", "damping_ratio", "damping_ratio_std", "damping_ratio_systematic", "decay_ratio"),
)


@dataclass(frozen=True, eq=False, kw_only=True)
class DecayMode:
    """One mode over its amplitude, n levels from the largest to the smallest.

    Parameters
    ----------
    amplitude_m, amplitude_std_m
        float[n], peak of the fundamental of the displacement at the reference channel, and its standard error.
    time_s
        float[n], instants of the record at which the vibration passed these amplitudes.
    frequency_hz
        float[n], frequency of the vibration at these instants.
    modal_frequency_hz, damping_ratio
        float[n], undamped modal frequency ``sqrt(k) / (2 pi)`` and ratio ``c / (2 sqrt(k))`` of the one-mode equation.
    modal_frequency_std_hz, damping_ratio_std
        float[n], random standard errors, from the noise of the record.
    modal_frequency_systematic_hz, damping_ratio_systematic
        float[n], estimated bounds of the systematic errors: curvature within the fits, window, and what the force leaves.
    decay_ratio
        float[n], rate of decay over the modal frequency: the damping ratio of the vibration as it was, with an exciter that
        hung on the structure.
    deflection
        complex[n, n_channels], displacement of every motion channel over that of the reference; NaN for other channels.
    harmonics_m
        complex[n, H + 1], harmonics of the displacement of the reference, the first real.
    force_n
        complex[n], measured fundamental of the force against the displacement; 0 where there is none.
    reference
        Name of the channel of ``amplitude_m``.
    start_s, stop_s
        Stretch of the record that was evaluated, from the beginning of the free decay to the noise floor.
    floor_m
        RMS of the noise in the demodulated displacement of the reference, peak value.
    drive_mode_shape
        Mass-normalised mode shape at the drive point, kg^-1/2; None if it was not given.
    """

    amplitude_m: Float
    amplitude_std_m: Float
    time_s: Float
    frequency_hz: Float
    modal_frequency_hz: Float
    modal_frequency_std_hz: Float
    modal_frequency_systematic_hz: Float
    damping_ratio: Float
    damping_ratio_std: Float
    damping_ratio_systematic: Float
    decay_ratio: Float
    deflection: Complex
    harmonics_m: Complex
    force_n: Complex
    reference: str
    start_s: float
    stop_s: float
    floor_m: float
    drive_mode_shape: float | None = None

    @property
    def modal_frequency_bound_95_hz(self) -> Float:
        """float[n]: half width of the 95 % interval of the modal frequency, at the estimated amplitude."""
        return self._bound_95(self.modal_frequency_hz, self.modal_frequency_std_hz, self.modal_frequency_systematic_hz)

    @property
    def damping_ratio_bound_95(self) -> Float:
        """float[n]: half width of the 95 % interval of the damping ratio, at the estimated amplitude."""
        return self._bound_95(self.damping_ratio, self.damping_ratio_std, self.damping_ratio_systematic)

    def _bound_95(self, values: Float, std: Float, systematic: Float) -> Float:
        slope = np.gradient(values, self.amplitude_m) if values.size > 1 else np.zeros(values.size)
        return np.asarray(1.96 * np.hypot(std, slope * self.amplitude_std_m) + systematic)

    def table(self) -> list[dict[str, float]]:
        """Return one JSON-able dictionary per level."""
        columns = {name: getattr(self, name) for name in _TABLE}
        columns["modal_frequency_bound_95_hz"] = self.modal_frequency_bound_95_hz
        columns["damping_ratio_bound_95"] = self.damping_ratio_bound_95
        return [{name: float(values[row]) for name, values in columns.items()} for row in range(self.time_s.size)]


@stored(groups={"modes": "mode"})
@dataclass(frozen=True, eq=False, kw_only=True)
class DecayBackbone(Result):
    """Modes of one free decay.

    Parameters
    ----------
    modes
        The modes that were evaluated, lowest frequency first.
    channels
        The channels of the record.
    specimen
        Name of what was tested.
    notes
        Remarks, one line each: what is in the record besides, and what was not evaluated and why.
    """

    modes: tuple[DecayMode, ...]
    channels: tuple[Channel, ...]
    specimen: str = ""
    notes: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        IdentificationError.raise_if(not self.modes, "a decay needs at least one", field="modes")

    def mode(self, near_hz: float | None = None) -> DecayMode:
        """Return the mode nearest to a frequency; without one, the only mode there is."""
        if near_hz is None:
            if len(self.modes) > 1:
                listed = ", ".join(f"{mode.modal_frequency_hz[-1]:.4g} Hz" for mode in self.modes)
                reason = f"the decay has {len(self.modes)} modes ({listed})"
                raise IdentificationError(reason, field="near_hz", hint="name one")
            return self.modes[0]
        return min(self.modes, key=lambda mode: abs(float(mode.modal_frequency_hz[-1]) - near_hz))

    def nonlinear_mode(self, near_hz: float | None = None) -> NonlinearMode:
        """Return one mode as a nonlinear mode, which predictions, figures and comparisons take.

        The force is the one that would hold the amplitude at phase resonance, and the modal amplitude is that of
        ``drive_mode_shape``; both are NaN without it.
        """
        mode = self.mode(near_hz)
        shape = np.nan if mode.drive_mode_shape is None else abs(mode.drive_mode_shape)
        omega = 2.0 * np.pi * mode.modal_frequency_hz
        force = 2.0 * mode.damping_ratio * omega**2 * mode.amplitude_m / shape**2
        size = np.abs(mode.harmonics_m[:, 1:])
        resonant = np.full((mode.time_s.size, 2), np.nan, np.complex128)
        resonant[:, 1] = 1j * force
        relative = mode.damping_ratio_std / mode.damping_ratio
        relative_bound = mode.damping_ratio_systematic / mode.damping_ratio
        return NonlinearMode(
            **_with_errors(
                force_n=(force, np.abs(force * relative), np.abs(force) * relative_bound),
                amplitude_m=(mode.amplitude_m, mode.amplitude_std_m, np.full(force.size, np.nan)),
                phase_lag_deg=(np.full(force.size, 90.0), 0.0 * force, 0.0 * force),
                modal_frequency_hz=(
                    mode.modal_frequency_hz,
                    mode.modal_frequency_std_hz,
                    mode.modal_frequency_systematic_hz,
                ),
                damping_ratio=(mode.damping_ratio, mode.damping_ratio_std, mode.damping_ratio_systematic),
                modal_amplitude=(mode.amplitude_m / shape, mode.amplitude_std_m / shape, 0.0 * force),
            ),
            frequency_hz=mode.frequency_hz,
            apparent_mass_kg=np.full(force.size, 1.0 / shape**2),
            response_purity=size[:, 0] / np.linalg.norm(size, axis=1),
            force_harmonics=resonant,
            response_harmonics_m=mode.harmonics_m,
            source="free decay",
            specimen=self.specimen,
            notes=self.notes,
            drive_mode_shape=mode.drive_mode_shape,
        )


def _with_errors(**known: tuple[Float, Float, Float]) -> dict[str, Any]:
    """Return quantities of a nonlinear mode with their errors, from values, random standard errors and systematic bounds.

    Bounds of systematic errors count as two standard errors.
    """
    count = len(known["force_n"][0])
    table = {name: np.full((count, len(QUANTITIES)), np.nan) for name in ("random_std", "systematic_std")}
    intervals = np.full((count, len(QUANTITIES), 2), np.nan)
    found: dict[str, Any] = {}
    for name, (values, random, bound) in known.items():
        column = QUANTITIES.index(name)
        table["random_std"][:, column], table["systematic_std"][:, column] = random, 0.5 * bound
        half = 1.96 * random + bound
        intervals[:, column] = np.stack([values - half, values + half], axis=-1)
        found |= {name: values, STANDARD_ERRORS[name]: np.hypot(random, 0.5 * bound)}
    return {**found, **table, "interval_95": intervals}

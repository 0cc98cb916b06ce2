"""Errors of models simulated with the inputs of recorded experiments, and the spectra of these errors."""

from dataclasses import dataclass, field

import numpy as np

from identification.errors import IdentificationError
from identification.validation import read_only
from vibrolock.arrays import Float


def _unknown() -> Float:
    """Return NaN, which stands for one NaN per line."""
    return np.array(np.nan)


def _shape(result: object, names: tuple[str, ...], shape: tuple[int, ...], allowed: str) -> None:
    """Make arrays of a result read-only, and fill a single NaN; raise `IdentificationError` for one of another shape."""
    for name in names:
        array = np.asarray(getattr(result, name), dtype=np.float64)
        if array.ndim == 0 and np.isnan(array):
            array = np.full(shape, array)
        if array.shape != shape:
            raise IdentificationError(f"shape {array.shape}", field=name, allowed=allowed)
        object.__setattr__(result, name, read_only(array, np.float64))


@dataclass(frozen=True, eq=False, kw_only=True)
class SimulatedRun:
    """Errors of a model simulated with the input of an experiment.

    Parameters
    ----------
    name, level
        Name and level of the experiment.
    outputs
        Names of the outputs.
    error
        float[n_outputs], relative RMS error over the samples that count (Scheel et al., Section 3.3); inf for an
        unbounded run.
    range_use
        Largest state or input over the largest in the training data; beyond 1 the model extrapolates. inf for an
        unbounded run, NaN where the range is unknown.
    unbounded_at_s
        Time at which the simulation became unbounded, from the first sample of the record (even if that sample does not
        count); None if it stayed bounded.
    use
        Use of the experiment: ``training``, ``validation`` or ``test``; ``planned`` for one that has not been measured, whose
        errors are NaN.
    rms, peak
        float[n_outputs], RMS and largest magnitude of the simulated outputs over the samples that count, in their units; NaN
        if unknown or unbounded.
    over_noise
        float[n_outputs], RMS of the residual over that of the noise in the excited lines
        (`identification.experiments.residuals.residual_over_noise`); NaN where the noise is unknown.
    rms_band, peak_band
        float[2, n_outputs], ends of 95 % intervals of ``rms`` and ``peak``; NaN if unknown.
    error_band
        float[n_outputs], relative RMS error that is not exceeded in 95 % of cases, by what the model's data leave open; NaN if
        unknown.
    """

    name: str
    level: float
    outputs: tuple[str, ...]
    error: Float
    range_use: float
    unbounded_at_s: float | None = None
    use: str = "test"
    rms: Float = field(default_factory=_unknown)
    peak: Float = field(default_factory=_unknown)
    over_noise: Float = field(default_factory=_unknown)
    rms_band: Float = field(default_factory=_unknown)
    peak_band: Float = field(default_factory=_unknown)
    error_band: Float = field(default_factory=_unknown)

    def __post_init__(self) -> None:
        object.__setattr__(self, "outputs", tuple(self.outputs))
        count = len(self.outputs)
        each = ("error", "rms", "peak", "over_noise", "error_band")
        _shape(self, each, (count,), f"one for each of {count} outputs")
        _shape(self, ("rms_band", "peak_band"), (2, count), f"two for each of {count} outputs")

    @property
    def bounded(self) -> bool:
        """Whether the run stayed bounded."""
        return self.unbounded_at_s is None

    def row(self) -> dict[str, object]:
        """Return JSON-able numbers by name; None for numbers that are unknown or not finite."""
        errors, rms, peak, over_noise, at_most = (
            {name: _finite(value) for name, value in zip(self.outputs, values, strict=True)}
            for values in (self.error, self.rms, self.peak, self.over_noise, self.error_band)
        )
        bands = {
            what: {name: [_finite(end) for end in ends] for name, ends in zip(self.outputs, values.T, strict=True)}
            for what, values in (("rms_band", self.rms_band), ("peak_band", self.peak_band))
            if np.isfinite(values).any()
        }
        return {
            "name": self.name,
            "use": self.use,
            "level": _finite(self.level),
            "errors": errors,
            "rms": rms,
            "peak": peak,
            "over_noise": over_noise,
            **bands,
            **({"error_band": at_most} if bands else {}),
            "range_use": _finite(self.range_use),
            "unbounded": not self.bounded,
            "unbounded_at_s": self.unbounded_at_s,
        }


@dataclass(frozen=True, eq=False, kw_only=True)
class ErrorSpectra:
    """Amplitudes (peak) of a measured period, and of the errors of two models on it, by frequency line.

    Parameters
    ----------
    name
        Name of the experiment.
    outputs
        Names of the outputs.
    frequency_hz
        float[n_lines].
    measured, linear_error, error
        float[n_outputs, n_lines], amplitudes of the measurement, of the error of the linear start, and of the error of the
        model. Errors are NaN if there is no linear start or a run is unbounded.
    model
        float[n_outputs, n_lines], amplitudes of the model's outputs; NaN if the run is unbounded or they were not kept.
    noise
        float[n_outputs, n_lines], standard errors of the measured amplitudes; NaN if unknown.
    """

    name: str
    outputs: tuple[str, ...]
    frequency_hz: Float
    measured: Float
    linear_error: Float
    error: Float
    model: Float = field(default_factory=_unknown)
    noise: Float = field(default_factory=_unknown)

    def __post_init__(self) -> None:
        object.__setattr__(self, "outputs", tuple(self.outputs))
        object.__setattr__(self, "frequency_hz", read_only(self.frequency_hz, np.float64))
        shape = (len(self.outputs), self.frequency_hz.size)
        _shape(self, ("measured", "linear_error", "error", "model", "noise"), shape, str(shape))


@dataclass(frozen=True, eq=False, kw_only=True)
class OutputStretch:
    """A short stretch of an experiment around its largest output, with what a model simulates there.

    Parameters
    ----------
    name
        Name of the experiment.
    outputs
        Names of the outputs.
    time_s
        float[n], time since the first sample of the record.
    measured, simulated
        float[n_outputs, n], in the units of the outputs; simulated values are NaN after a run became unbounded.
    """

    name: str
    outputs: tuple[str, ...]
    time_s: Float
    measured: Float
    simulated: Float

    def __post_init__(self) -> None:
        object.__setattr__(self, "outputs", tuple(self.outputs))
        object.__setattr__(self, "time_s", read_only(self.time_s, np.float64))
        shape = (len(self.outputs), self.time_s.size)
        _shape(self, ("measured", "simulated"), shape, str(shape))


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None

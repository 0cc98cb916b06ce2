"""Nonlinear state-space models on recorded experiments: errors of every output, the range used, and their spectra."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.pnlss.errors import estimated_initial_state
from identification.pnlss.experiment import Experiment
from identification.pnlss.fitting.checks import check_not_zero
from identification.pnlss.model import PnlssModel
from identification.pnlss.simulation import Simulation
from identification.validation import read_only

__all__ = ["ErrorSpectra", "SimulatedRun", "error_spectra", "estimated_initial_state", "simulated_run"]

Float = NDArray[np.float64]


@dataclass(frozen=True, eq=False, kw_only=True)
class SimulatedRun:
    """A model simulated with the input of an experiment, beside what was measured.

    Parameters
    ----------
    name, level
        Those of the experiment.
    outputs
        Names of the outputs.
    error
        float[n_outputs], relative RMS error over the samples that count (Scheel et al., Section 3.3); inf for an
        unbounded run.
    range_use
        Largest state or input over the largest in the training data; beyond 1 the model extrapolates. inf for an
        unbounded run, NaN where the range is unknown.
    unbounded_at_s
        When the run left all bounds, after the first sample of the record, of which the first may not count; None if it
        never did.
    use
        What the experiment was to the model: ``training``, ``validation`` or ``test``.
    """

    name: str
    level: float
    outputs: tuple[str, ...]
    error: Float
    range_use: float
    unbounded_at_s: float | None = None
    use: str = "test"

    def __post_init__(self) -> None:
        object.__setattr__(self, "outputs", tuple(self.outputs))
        object.__setattr__(self, "error", read_only(self.error, np.float64))
        if self.error.shape != (len(self.outputs),):
            raise IdentificationError(
                f"error: shape {self.error.shape}, needs one for each of {len(self.outputs)} outputs"
            )

    @property
    def bounded(self) -> bool:
        """Whether the run stayed bounded."""
        return self.unbounded_at_s is None

    def row(self) -> dict[str, object]:
        """The numbers by name, ready for JSON: None for what is not known or not finite."""
        errors = {name: _finite(value) for name, value in zip(self.outputs, self.error, strict=True)}
        return {
            "name": self.name,
            "use": self.use,
            "level": _finite(self.level),
            "errors": errors,
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
        Of the experiment.
    outputs
        Names of the outputs.
    frequency_hz
        float[n_lines].
    measured, linear_error, error
        float[n_outputs, n_lines], of the measurement, of the linear start's error and of the model's; the errors NaN where
        there is no linear start, or a run is unbounded.
    """

    name: str
    outputs: tuple[str, ...]
    frequency_hz: Float
    measured: Float
    linear_error: Float
    error: Float

    def __post_init__(self) -> None:
        object.__setattr__(self, "outputs", tuple(self.outputs))
        object.__setattr__(self, "frequency_hz", read_only(self.frequency_hz, np.float64))
        for name in ("measured", "linear_error", "error"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.float64))
            if getattr(self, name).shape != (len(self.outputs), self.frequency_hz.size):
                raise IdentificationError(
                    f"{name}: shape {getattr(self, name).shape}, needs ({len(self.outputs)}, {self.frequency_hz.size})"
                )


def simulated_run(
    model: PnlssModel, experiment: Experiment, *, initial_state: Float | None = None, use: str = "test"
) -> SimulatedRun:
    """Simulate an experiment from rest, or from ``initial_state``; it is estimated where the experiment asks for it.

    Raises `IdentificationError` where the channels or rates of the two differ, and where an output is zero where it counts.
    """
    check_channels(model, experiment)
    check_not_zero(experiment, f"experiment '{experiment.name}'")
    run = _simulated(model, experiment, initial_state)
    measured = experiment.counted_outputs
    size = np.linalg.norm(measured, axis=1)
    with np.errstate(over="ignore", invalid="ignore"):
        error = np.linalg.norm(run.outputs[:, experiment.counted_from :] - measured, axis=1) / size
    at = run.unbounded_at
    return SimulatedRun(
        name=experiment.name,
        level=experiment.level,
        outputs=tuple(channel.name for channel in experiment.output_channels),
        error=error if at is None else np.full(error.size, np.inf),
        range_use=run.range_use,
        unbounded_at_s=None if at is None else at / experiment.sample_rate_hz,
        use=use,
    )


def error_spectra(model: PnlssModel, linear: PnlssModel | None, experiment: Experiment) -> ErrorSpectra:
    """Amplitudes by line of a periodic experiment: measured, and the errors of a model and of the linear one it began as.

    Raises `IdentificationError` for an experiment that is not periodic.
    """
    period = experiment.period_samples
    if not period:
        raise IdentificationError(f"experiment '{experiment.name}': is not periodic and has no lines")

    def lines(values: Float) -> Float:
        mean = values.reshape(values.shape[0], -1, period).mean(axis=1)
        return np.abs(np.fft.rfft(mean, axis=1))[:, 1 : (period + 1) // 2] * (2.0 / period)

    def error(one: PnlssModel | None) -> Float:
        run = None if one is None else _simulated(one, experiment, None)
        if run is None or not run.bounded:
            return np.full(measured.shape, np.nan)
        return lines(run.outputs[:, experiment.counted_from :] - experiment.counted_outputs)

    measured = lines(experiment.counted_outputs)
    return ErrorSpectra(
        name=experiment.name,
        outputs=tuple(channel.name for channel in experiment.output_channels),
        frequency_hz=np.arange(1, measured.shape[1] + 1) * experiment.sample_rate_hz / period,
        measured=measured,
        linear_error=error(linear),
        error=error(model),
    )


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _simulated(model: PnlssModel, experiment: Experiment, initial_state: Float | None) -> Simulation:
    check_channels(model, experiment)
    if initial_state is None and experiment.initial_state == "estimated":
        initial_state = estimated_initial_state(model, experiment)
    return model.simulate(experiment.inputs, initial_state=initial_state)


def check_channels(model: PnlssModel, experiment: Experiment) -> None:
    """Raise `IdentificationError` unless the experiment has the model's channels and rate."""
    for what, mine, theirs in (
        ("inputs", model.inputs, experiment.input_channels),
        ("outputs", model.outputs, experiment.output_channels),
    ):
        names: Sequence[str] = [channel.name for channel in mine]
        others = [channel.name for channel in theirs]
        if names != others:
            raise IdentificationError(
                f"experiment '{experiment.name}': {what} are {', '.join(others)}, the model's {', '.join(names)}"
            )
    if abs(model.sample_rate_hz / experiment.sample_rate_hz - 1.0) > 1e-9:
        raise IdentificationError(
            f"experiment '{experiment.name}': sampled at {experiment.sample_rate_hz:g} Hz, the model at "
            f"{model.sample_rate_hz:g} Hz"
        )

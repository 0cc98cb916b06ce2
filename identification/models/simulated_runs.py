"""Experiments as a model simulates them: errors, their spectra, and a stretch of time. For any model that can be simulated."""

import numpy as np

from identification.errors import IdentificationError
from identification.experiments.checks import belongs, check_not_zero
from identification.experiments.experiment import Experiment
from identification.experiments.residuals import residual_over_noise
from identification.experiments.simulation import Simulation
from identification.experiments.simulators import Simulator, Stepped
from identification.models.balanced_model import begun_at_rest
from identification.models.dynamic_model import dynamic_model, has_kind
from identification.prediction.simulated_runs import ErrorSpectra, OutputStretch, SimulatedRun
from vibrolock.arrays import Float


def simulated_run(
    model: Simulator,
    experiment: Experiment,
    *,
    initial_state: Float | None = None,
    use: str = "test",
    steps_left: float = 1.0,
) -> SimulatedRun:
    """Simulate an experiment.

    Raises `IdentificationError` if channels or sample rates of model and experiment differ, or an output is zero where it
    counts.

    Parameters
    ----------
    model
        The model.
    experiment
        The experiment.
    initial_state
        State before the first sample, float[n_states]; by default rest, or an estimate if the experiment requires it.
    use
        What the experiment is for, as it is stored with the run, such as ``training`` or ``test``.
    steps_left
        Share of the errors of the model's steps that its fit has not made up for (`StructuredFit.steps_left`).
    """
    belongs(model, experiment, f"experiment '{experiment.name}'")
    check_not_zero(experiment, f"experiment '{experiment.name}'")
    run = run_of(model, experiment, initial_state)
    measured = experiment.counted_outputs
    size = np.linalg.norm(measured, axis=1)
    with np.errstate(over="ignore", invalid="ignore"):
        error = np.linalg.norm(run.outputs[:, experiment.counted_from :] - measured, axis=1) / size
    at = run.unbounded_at
    counted = run.outputs[:, experiment.counted_from :] if at is None else np.full(measured.shape, np.nan)
    return SimulatedRun(
        name=experiment.name,
        level=experiment.level,
        outputs=tuple(channel.name for channel in experiment.output_channels),
        error=error if at is None else np.full(error.size, np.inf),
        range_use=run.range_use,
        unbounded_at_s=None if at is None else at / experiment.sample_rate_hz,
        use=use,
        rms=np.sqrt(np.mean(counted**2, axis=1)),
        peak=np.max(np.abs(counted), axis=1),
        over_noise=_over_noise(model, experiment, counted, initial_state, steps_left),
    )


def _over_noise(
    model: Simulator, experiment: Experiment, counted: Float, initial_state: Float | None, steps_left: float
) -> Float:
    """float[n_outputs]: the residual over the noise and what is left of the errors of the steps, by a run with half of them."""
    of_steps = None
    if isinstance(model, Stepped) and experiment.noise_covariance is not None:
        finer = run_of(model.with_half_steps(), experiment, initial_state).outputs[:, experiment.counted_from :]
        of_steps = 4.0 / 3.0 * steps_left * (counted - finer)
    return residual_over_noise(experiment, counted, of_steps)


def error_spectra(model: Simulator, linear: Simulator | None, experiment: Experiment) -> ErrorSpectra:
    """Return amplitudes by line of a periodic experiment: measurement, noise, model, errors of the model and its linear start.

    Raises `IdentificationError` for an experiment that is not periodic.

    Parameters
    ----------
    model
        The model.
    linear
        The linear model with which the fit began; None without one.
    experiment
        A periodic experiment.
    """
    period = experiment.period_samples
    if not period:
        raise IdentificationError(f"experiment '{experiment.name}': is not periodic and has no lines")

    def lines(values: Float) -> Float:
        mean = values.reshape(values.shape[0], -1, period).mean(axis=1)
        return np.abs(np.fft.rfft(mean, axis=1))[:, 1 : (period + 1) // 2] * (2.0 / period)

    def output(one: Simulator | None) -> Float:
        run = None if one is None else run_of(one, experiment)
        if run is None or run.unbounded_at is not None:
            return np.full(experiment.counted_outputs.shape, np.nan)
        return run.outputs[:, experiment.counted_from :]

    measured, simulated = lines(experiment.counted_outputs), output(model)
    return ErrorSpectra(
        name=experiment.name,
        outputs=tuple(channel.name for channel in experiment.output_channels),
        frequency_hz=np.arange(1, measured.shape[1] + 1) * experiment.sample_rate_hz / period,
        measured=measured,
        linear_error=lines(output(linear) - experiment.counted_outputs),
        error=lines(simulated - experiment.counted_outputs),
        model=lines(simulated),
        noise=np.full(measured.shape, np.nan) if experiment.output_noise is None else experiment.output_noise,
    )


def output_stretch(
    model: Simulator, experiment: Experiment, *, samples: int = 400, initial_state: Float | None = None
) -> OutputStretch:
    """Return some samples around the largest measured value of the first output, and the model's outputs there.

    Raises `IdentificationError` if channels or sample rates of model and experiment differ.

    Parameters
    ----------
    model
        The model.
    experiment
        The experiment.
    samples
        Largest number of samples that are returned.
    initial_state
        State before the first sample, float[n_states]; by default rest, or an estimate if the experiment requires it.
    """
    belongs(model, experiment, f"experiment '{experiment.name}'")
    run = run_of(model, experiment, initial_state)
    largest = experiment.counted_from + int(np.argmax(np.abs(experiment.counted_outputs[0])))
    last = experiment.outputs.shape[1]
    first = max(min(largest - samples // 2, last - samples), experiment.counted_from)
    stop = min(first + samples, last)
    simulated = np.where(np.isfinite(run.outputs), run.outputs, np.nan)
    if run.unbounded_at is not None:
        simulated[:, run.unbounded_at :] = np.nan
    return OutputStretch(
        name=experiment.name,
        outputs=tuple(channel.name for channel in experiment.output_channels),
        time_s=np.arange(first, stop) / experiment.sample_rate_hz,
        measured=experiment.outputs[:, first:stop],
        simulated=simulated[:, first:stop],
    )


def run_of(model: Simulator, experiment: Experiment, initial_state: Float | None = None) -> Simulation:
    """Return the run under the inputs of an experiment, which begins as the experiment and the model require.

    Raises `IdentificationError` if channels or sample rates differ, or the model cannot begin as the experiment does.
    """
    belongs(model, experiment, f"experiment '{experiment.name}'")
    if has_kind(model):
        return dynamic_model(model).simulate_experiment(experiment, initial_state)
    return begun_at_rest(model, experiment, initial_state)

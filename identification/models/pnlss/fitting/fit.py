"""Levenberg-Marquardt fit of all parameters of a nonlinear state-space model to experiments, in the time domain.

Cost and its gradient as in Paduart et al., Automatica 46, 2010, Section 4.3 (weighted squared simulation errors,
sensitivities by recursion); the damping after Marquardt, J. SIAM 11, 1963.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from identification.errors import IdentificationError
from identification.experiments.experiment import Experiment, excited_band
from identification.fitting.levenberg_marquardt import DampingRule, Minimum, Step, minimise
from identification.fitting.result import Ending, FitProgress, FitStatus
from identification.fitting.threads import threads
from identification.models.pnlss.fitting.blocks import fitted_initial_state
from identification.models.pnlss.fitting.checks import check_data, check_memory, check_resumed
from identification.models.pnlss.fitting.parameters import Parameters
from identification.models.pnlss.fitting.problem import Problem, scales_of
from identification.models.pnlss.fitting.result import FitHistory, FitSettings, PnlssFit
from identification.models.pnlss.model import PnlssModel
from vibrolock.arrays import Float

_RULE = DampingRule(first=1e-3, factor=10.0, smallest=1e-16, largest=1e8, worth=0.01)
"""Choice of the damping, relative to the largest eigenvalue; chosen: a cost takes far less time than a linearisation, so that
the factor can be large and a small gain pays for a further trial. The settings give the first damping."""
_RECENT = 10
"""Last iterations of which the message of a fit at its limit gives the gain; half of them if there are fewer than twice as
many. Chosen."""
_STALLED = 5
"""A fit ends after this many successive iterations without a gain above the tolerance. Chosen."""


_HOPELESS = 1e3
"""A start is refused if its outputs exceed this multiple of the measured ones. Chosen."""


@dataclass(eq=False)
class Iterates:
    """The last iterate, the best one, and the history of the fit."""

    vector: Float
    best: Float
    history: FitHistory


def iterate(problem: Problem, iterates: Iterates, progress: Callable[[FitProgress], None] | None) -> Minimum:
    """Iterate until there is a reason to stop."""
    settings, began = problem.settings, time.perf_counter() - float(iterates.history.seconds[-1])

    def accepted(step: Step) -> None:
        with threads():
            training, validation = problem.training_error(step.vector), problem.validation_error(step.vector)
        seconds = time.perf_counter() - began
        iterates.vector = step.vector
        iterates.history = history = iterates.history.with_iterate(training, validation, step.damping, seconds)
        if history.best == history.iterations:
            iterates.best = step.vector
        if progress is not None:
            progress(
                FitProgress(
                    iteration=history.iterations,
                    iterations=settings.iterations,
                    training_error=training,
                    validation_error=validation,
                    damping=step.damping,
                    seconds=seconds,
                )
            )

    return minimise(
        problem,
        iterates.vector,
        replace(_RULE, first=float(iterates.history.damping[-1])),
        lambda _iterations, _step: _ending(iterates.history, settings),
        accepted,
    )


def _ending(history: FitHistory, settings: FitSettings) -> Ending | None:
    """Return why no further iteration is made; None if one is."""
    errors = history.training_error[-_STALLED - 1 :]
    error = "validation" if history.validated else "training"
    if errors[-1] <= 0.0:
        return Ending.of(FitStatus.NO_ERROR)
    if settings.patience and history.since_gain(settings.least_gain) >= settings.patience:
        by = f" by {100 * settings.least_gain:g} %" if settings.least_gain else ""
        return Ending.of(FitStatus.NO_FURTHER_GAIN, count=settings.patience, error=error, by=by)
    if errors.size > _STALLED and np.all(np.diff(errors) > -settings.tolerance * errors[:-1]):
        return Ending.of(FitStatus.CONVERGED, count=_STALLED, tolerance=settings.tolerance)
    if history.iterations < settings.iterations:
        return None
    last = max(min(history.iterations // 2, _RECENT), 1)
    gain = history.gained(last)
    improving = history.iterations and gain > settings.least_gain
    status = FitStatus.STILL_IMPROVING if improving else FitStatus.ITERATION_LIMIT
    of = f"the last {last}" if last > 1 else "the last one"
    return Ending.of(status, limit=settings.iterations, of=of, error=error, gain=100 * gain)


def fit_pnlss(
    start: PnlssModel,
    experiments: Sequence[Experiment],
    *,
    validation: Sequence[Experiment] = (),
    settings: FitSettings | None = None,
    progress: Callable[[FitProgress], None] | None = None,
    resume: PnlssFit | None = None,
) -> PnlssFit:
    """Fit all coefficients of ``start``, the weights in its features, and estimated initial states.

    Raises `IdentificationError` if data and model do not match, the data cannot determine the parameters, or the simulated
    start is unbounded.

    Parameters
    ----------
    start
        Initial model, usually a linear model `with_features`. Its simulation must stay bounded.
    experiments
        Training data.
    validation
        Data on which the iterate is chosen; never part of the fit.
    settings
        `FitSettings`; None for the defaults.
    progress
        Called after each iteration.
    resume
        An earlier fit of the same start, experiments and settings, which continues as if it had never stopped. A fit that
        had ended continues with more iterations, or another tolerance or patience.

    Returns
    -------
    PnlssFit
        The fit; after Ctrl-C, the fit reached so far, marked ``interrupted``.
    """
    settings = FitSettings() if settings is None else settings
    estimated = sum(e.initial_state == "estimated" for e in experiments)
    parameters = Parameters(start, estimated)
    check_data(start, experiments, validation, parameters.count, settings.by_frequency)
    check_memory(parameters, [*experiments, *validation], settings.by_frequency)
    if resume is not None:
        check_resumed(start, resume, estimated, bool(validation))
    scales = scales_of(experiments, _state_scale(start, experiments) if resume is None else resume.state_scale)
    parameters = Parameters(scales.model(start if resume is None else resume.last), estimated)
    problem = Problem(parameters, scales, experiments, validation, settings)
    if resume is None:
        iterates = _begin(problem)
    else:
        pairs = ((resume.last, resume.last_initial_states), (resume.model, resume.initial_states))
        newest, best = (parameters.vector(scales.model(m), begins / scales.states) for m, begins in pairs)
        iterates = Iterates(newest, best, resume.history)
    found = iterate(problem, iterates, progress)

    def physical(vector: Float) -> tuple[PnlssModel, Float]:
        begins = parameters.initial_states(vector) * scales.states
        return _trained(scales.physical(parameters.model(vector)), experiments, begins), begins

    (model, begins), (last, last_begins) = physical(iterates.best), physical(iterates.vector)
    return PnlssFit(
        model=model,
        last=last,
        linear=_linear_part(start) if resume is None else resume.linear,
        history=iterates.history,
        chosen=iterates.history.best,
        initial_states=begins,
        last_initial_states=last_begins,
        state_scale=scales.states,
        settings=settings,
        status=found.ending.status,
        message=found.ending.message,
        evaluations=found.evaluations,
        iterations=iterates.history.iterations,
        seconds=float(iterates.history.seconds[-1]),
    )


def _state_scale(start: PnlssModel, experiments: Sequence[Experiment]) -> Float:
    """RMS of each state of the simulated start; raises `IdentificationError` if it is unbounded or far too large."""
    total, samples = np.zeros(start.states), 0
    for index, experiment in enumerate(experiments):
        run = start.simulate(experiment.inputs)
        what = f"experiments[{index}]{f' ({experiment.name})' if experiment.name else ''}"
        if run.unbounded_at is not None:
            raise IdentificationError(
                f"diverges at sample {run.unbounded_at} of {what}",
                field="start",
                allowed="a model that is stable there",
            )
        largest, measured = (float(np.max(np.abs(y))) for y in (run.outputs, experiment.outputs))
        if not largest <= _HOPELESS * max(measured, 1e-300):
            raise IdentificationError(
                f"its outputs reach {largest / max(measured, 1e-300):.3g} times those of {what}",
                field="start",
                allowed="a model that is stable and in the units of the channels",
            )
        total += np.sum(run.states**2, axis=1)
        samples += run.states.shape[1]
    rms = np.sqrt(total / samples)
    return np.where(rms > 0.0, rms, np.max(rms) if np.any(rms > 0.0) else 1.0)


def _begin(problem: Problem) -> Iterates:
    parameters = problem.parameters
    rest = np.zeros((parameters.estimated, parameters.start.states))
    system = parameters.system(parameters.vector(parameters.start, rest))
    begins = [fitted_initial_state(system, r, problem.weights) for r in problem.training if r.place is not None]
    vector = parameters.vector(parameters.start, np.array(begins).reshape(rest.shape))
    training, validation = problem.training_error(vector), problem.validation_error(vector)
    first = FitHistory(
        training_error=np.array([training]),
        validation_error=np.array([validation]),
        damping=np.array([problem.settings.damping]),
        seconds=np.zeros(1),
    )
    return Iterates(vector, vector, first)


def _trained(model: PnlssModel, experiments: Sequence[Experiment], begins: Float) -> PnlssModel:
    states, place = np.zeros(model.states), 0
    free = replace(model, state_range=np.full(model.states, np.nan))
    for experiment in experiments:
        begin = None
        if experiment.initial_state == "estimated":
            begin, place = begins[place], place + 1
        run = free.simulate(experiment.inputs, initial_state=begin)
        states = np.fmax(states, np.max(np.abs(run.states), axis=1))
    return replace(
        model,
        state_range=states,
        input_range=np.max([np.max(np.abs(e.inputs), axis=1) for e in experiments], axis=0),
        excited_hz=excited_band(experiments) or model.excited_hz,
        training=tuple(e.name or f"experiment {index + 1}" for index, e in enumerate(experiments)),
        specimen=model.specimen or experiments[0].specimen,
    )


def _linear_part(start: PnlssModel) -> PnlssModel | None:
    if np.any(start.e) or np.any(start.f):
        return None
    return PnlssModel.linear(
        start.linear_part,
        sample_rate_hz=start.sample_rate_hz,
        inputs=start.inputs,
        outputs=start.outputs,
        specimen=start.specimen,
        notes=start.notes,
    )

"""Iterates of a fit of a nonlinear state-space model, with their history and the reasons to stop."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from identification.fitting.levenberg_marquardt import DampingRule, Minimum, Step, minimise
from identification.fitting.result import Ending, FitStatus
from identification.fitting.threads import threads
from identification.models.pnlss.fitting.problem import Problem
from identification.models.pnlss.fitting.result import FitHistory
from identification.models.pnlss.fitting.settings import FitProgress, FitSettings
from vibrolock.arrays import Float

_RULE = DampingRule(first=1e-3, factor=10.0, smallest=1e-16, largest=1e8, worth=0.01)
"""Choice of the damping, relative to the largest eigenvalue; chosen: a cost takes far less time than a linearisation, so that
the factor can be large and a small gain pays for a further trial. The settings give the first damping."""
_RECENT = 10
"""Last iterations of which the message of a fit at its limit gives the gain; half of them if there are fewer than twice as
many. Chosen."""
_STALLED = 5
"""A fit ends after this many successive iterations without a gain above the tolerance. Chosen."""


@dataclass(eq=False)
class Iterates:
    """The last iterate, the best one, and the history of the fit."""

    vector: Float
    best: Float
    damping: float
    training: list[float]
    validation: list[float]
    dampings: list[float]
    seconds: list[float]
    began: float = field(default_factory=time.perf_counter)

    @classmethod
    def begin(cls, problem: Problem, vector: Float) -> "Iterates":
        """Return the iterates at the start of a fit."""
        damping = problem.settings.damping
        errors = problem.training_error(vector), problem.validation_error(vector)
        return cls(vector, vector, damping, [errors[0]], [errors[1]], [damping], [0.0])

    @classmethod
    def resumed(cls, last: Float, best: Float, history: FitHistory) -> "Iterates":
        """Return the iterates at which an earlier fit stopped."""
        lists = (history.training_error, history.validation_error, history.damping, history.seconds)
        training, validation, dampings, seconds = (list(map(float, values)) for values in lists)
        began = time.perf_counter() - seconds[-1]
        return cls(last, best, dampings[-1], training, validation, dampings, seconds, began)

    @property
    def history(self) -> FitHistory:
        """History of the fit for its result."""
        return FitHistory(
            training_error=np.array(self.training),
            validation_error=np.array(self.validation),
            damping=np.array(self.dampings),
            seconds=np.array(self.seconds),
        )

    def add(self, problem: Problem, vector: Float, damping: float) -> None:
        """Append an iterate."""
        with threads():
            training, validation = problem.training_error(vector), problem.validation_error(vector)
        self.vector, self.damping = vector, damping
        self.training.append(training)
        self.validation.append(validation)
        self.dampings.append(damping)
        self.seconds.append(time.perf_counter() - self.began)
        if self.history.best == len(self.training) - 1:
            self.best = vector


def iterate(problem: Problem, iterates: Iterates, progress: Callable[[FitProgress], None] | None) -> Minimum:
    """Iterate until there is a reason to stop."""
    settings = problem.settings

    def accepted(step: Step) -> None:
        iterates.add(problem, step.vector, step.damping)
        if progress is not None:
            progress(_progress(iterates, settings))

    return minimise(
        problem,
        iterates.vector,
        replace(_RULE, first=iterates.damping),
        lambda _iterations, _step: _ending(iterates, settings),
        accepted,
    )


def _ending(iterates: Iterates, settings: FitSettings) -> Ending | None:
    """Return why no further iteration is made; None if one is."""
    history = iterates.history
    errors = np.array(iterates.training[-_STALLED - 1 :])
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


def _progress(iterates: Iterates, settings: FitSettings) -> FitProgress:
    return FitProgress(
        iteration=len(iterates.training) - 1,
        iterations=settings.iterations,
        training_error=iterates.training[-1],
        validation_error=iterates.validation[-1],
        damping=iterates.damping,
        seconds=iterates.seconds[-1],
    )

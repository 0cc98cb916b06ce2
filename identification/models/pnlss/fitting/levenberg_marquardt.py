"""Levenberg-Marquardt iterations: damped steps, choice of the damping, stopping, and the stored iterates.

Normal equations are scaled to columns of unit norm and decomposed once; each damping then only changes a diagonal.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from identification.fitting.threads import threads
from identification.models.pnlss.fitting.normal_equations import NormalEquations
from identification.models.pnlss.fitting.problem import Problem
from identification.models.pnlss.fitting.result import FitHistory
from identification.models.pnlss.fitting.settings import FitProgress, FitSettings
from vibrolock.arrays import Float

_FACTOR = 10.0
_SMALLEST, _LARGEST = 1e-16, 1e8
"""Range of dampings that are tried."""
_WORTH = 0.01
"""A smaller damping is tried if its predicted gain exceeds the gain achieved by more than this share."""
_LATELY = 10
"""Last iterations whose gain a fit that was stopped tells; half of them if there are fewer than twice as many."""
_STALLED = 5
"""A fit ends after this many successive iterations without a gain above the tolerance."""


class Steps:
    """Solutions of ``(H + damping w_max D^2) step = -g`` in the span of the eigenvectors that the data determine.

    D^2 is the diagonal of H, so that the step does not depend on units or on the degrees of monomials; w_max is the largest
    eigenvalue of ``D^-1 H D^-1``. n_states^2 directions change no output. Eigenvalues below ``truncation w_max`` are
    therefore left out, which a factorisation could not do.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the decomposition does not converge.
    """

    def __init__(self, equations: NormalEquations, truncation: float) -> None:
        diagonal = np.sqrt(np.diag(equations.hessian))
        self._scale = np.divide(1.0, diagonal, out=np.zeros_like(diagonal), where=diagonal > 0.0)
        scaled = equations.hessian * self._scale * self._scale[:, None]
        values, vectors = np.linalg.eigh(scaled)
        self._kept = values > max(truncation, np.finfo(float).tiny) * values[-1]
        self._values = values[self._kept]
        self._vectors = vectors[:, self._kept]
        self._gradient = self._vectors.T @ (self._scale * equations.gradient)

    @property
    def rank(self) -> int:
        """Number of directions kept."""
        return int(np.count_nonzero(self._kept))

    def at(self, damping: float) -> Float:
        """Return the step with this damping, which is relative to the largest eigenvalue."""
        if not self.rank:
            return np.zeros_like(self._scale)
        solved = self._gradient / (self._values + damping * self._values[-1])
        return np.asarray(-self._scale * (self._vectors @ solved))

    def promised(self, damping: float) -> float:
        """Return the predicted decrease of the squared errors with this damping, for outputs linear in the parameters."""
        values, damped = self._values, self._values + damping * self._values[-1:]
        return float(np.sum(self._gradient**2 * (2.0 * damped - values) / damped**2))


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

    def add(self, problem: Problem, vector: Float, training: float, damping: float) -> None:
        """Append an iterate."""
        validation = problem.validation_error(vector)
        self.vector, self.damping = vector, damping
        self.training.append(training)
        self.validation.append(validation)
        self.dampings.append(damping)
        self.seconds.append(time.perf_counter() - self.began)
        if self.history.best == len(self.training) - 1:
            self.best = vector


class Ending(NamedTuple):
    """Why the iterations ended."""

    reason: str
    limited: bool = False
    """Whether the settings allow no further iteration, while the last ones still lowered the error."""
    interrupted: bool = False


def iterate(problem: Problem, iterates: Iterates, progress: Callable[[FitProgress], None] | None) -> Ending:
    """Iterate until there is a reason to stop, and return it."""
    settings = problem.settings
    try:
        while (ending := _ending(iterates, settings)) is None:
            with threads() as count:
                equations = problem.equations(iterates.vector, count)
                if not (np.all(np.isfinite(equations.hessian)) and np.all(np.isfinite(equations.gradient))):
                    return Ending("the sensitivities of the last iterate leave all bounds")
                found = _descend(problem, Steps(equations, settings.truncation), iterates)
                if found is None:
                    return Ending("no step of any damping fits better")
                iterates.add(problem, *found)
            if progress is not None:
                progress(_told(iterates, settings))
    except KeyboardInterrupt:
        return Ending("interrupted", interrupted=True)
    except np.linalg.LinAlgError:
        return Ending("the normal equations of the last iterate could not be decomposed")
    return ending


def _ending(iterates: Iterates, settings: FitSettings) -> Ending | None:
    """Return why no further iteration is made; None if one is."""
    history = iterates.history
    errors = np.array(iterates.training[-_STALLED - 1 :])
    if errors[-1] <= 0.0:
        return Ending("no error is left")
    if settings.patience and history.since_gain(settings.least_gain) >= settings.patience:
        error = "validation" if history.validated else "training"
        least = f" by {100 * settings.least_gain:g} %" if settings.least_gain else ""
        return Ending(f"{settings.patience} iterations did not lower the {error} error{least}")
    if errors.size > _STALLED and np.all(np.diff(errors) > -settings.tolerance * errors[:-1]):
        return Ending(f"{_STALLED} iterations whose gain was below {settings.tolerance:g}")
    return _at_limit(history, settings) if history.iterations >= settings.iterations else None


def _at_limit(history: FitHistory, settings: FitSettings) -> Ending:
    """Return the end of a fit that may not go on, with what its last iterations gained."""
    limit = f"stopped at its limit of {settings.iterations} iterations"
    last = max(min(history.iterations // 2, _LATELY), 1)
    gain = history.gained(last)
    if not history.iterations or not gain > settings.least_gain:
        return Ending(limit)
    error = "validation" if history.validated else "training"
    lately = f"the last {last}" if last > 1 else "the last one"
    return Ending(
        f"{limit} while it still paid: {lately} lowered the {error} error by {100 * gain:.2g} %", limited=True
    )


def _descend(problem: Problem, steps: Steps, iterates: Iterates) -> tuple[Float, float, float] | None:
    """Return parameters, training error and damping of a step that reduces the cost; None if no step does.

    A simulation costs far less than sensitivities, so that several dampings are tried: smaller ones as long as the cost and
    its prediction improve, and larger ones if the first did not reduce the cost.
    """

    def tried(damping: float) -> tuple[float, Float, float]:
        vector = iterates.vector + steps.at(damping)
        error = problem.training_error(vector)
        return problem.cost(vector, error), vector, error

    before = problem.cost(iterates.vector, iterates.training[-1])
    damping = max(iterates.damping / _FACTOR, _SMALLEST)
    best = tried(damping)
    if best[0] < before:
        while damping > _SMALLEST:
            if steps.promised(damping / _FACTOR) < (1.0 + _WORTH) * steps.promised(damping):
                break
            other = tried(damping / _FACTOR)
            if not other[0] < best[0]:
                break
            best, damping = other, damping / _FACTOR
        return best[1], best[2], damping
    while damping < _LARGEST:
        damping *= _FACTOR
        best = tried(damping)
        if best[0] < before:
            return best[1], best[2], damping
    return None


def _told(iterates: Iterates, settings: FitSettings) -> FitProgress:
    return FitProgress(
        iteration=len(iterates.training) - 1,
        iterations=settings.iterations,
        training_error=iterates.training[-1],
        validation_error=iterates.validation[-1],
        damping=iterates.damping,
        seconds=iterates.seconds[-1],
    )

"""Levenberg-Marquardt iterations: the one loop that fits all models.

The method of Marquardt (J. SIAM 11, 1963, 431). A problem linearises itself at a vector and solves the damped linear problem;
there are two solvers for that, with bounds (`identification.fitting.bounded_steps`) and with directions left out that the data
do not determine (`identification.fitting.truncated_steps`). Dampings, stopping and the reasons to stop are here or given.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np

from identification.fitting.result import Ending, FitStatus
from vibrolock.arrays import Float


class DampedSteps(Protocol):
    """Steps from one vector, for any damping."""

    @property
    def cost(self) -> float:
        """Cost at the vector from which the steps lead."""

    def vector(self, damping: float) -> Float:
        """Return the vector to which the step with this damping leads."""

    def predicted(self, damping: float) -> float:
        """Return the decrease of the cost that the linear problem predicts for this step."""


class LeastSquares(Protocol):
    """A problem: a sum of squares, and its linearisation."""

    def cost(self, vector: Float) -> float:
        """Return the sum of squares; inf where the model is unbounded."""

    def linearised(self, vector: Float) -> DampedSteps | None:
        """Return the steps from a vector; None if derivatives are not finite."""


@dataclass(frozen=True)
class DampingRule:
    """How the damping of a step is chosen."""

    first: float
    """Damping of the step before the first."""
    factor: float
    """Ratio of successive dampings."""
    smallest: float
    """Smallest damping that is tried."""
    largest: float
    """Largest damping that is tried."""
    worth: float
    """A smaller damping is tried if its predicted gain exceeds that of the last by more than this share."""


class Step(NamedTuple):
    """A step that was tried."""

    vector: Float
    damping: float
    predicted: float
    before: float
    """Cost before the step."""
    cost: float
    """Cost after the step."""


class Minimum(NamedTuple):
    """Where the iterations ended."""

    vector: Float
    ending: Ending
    evaluations: int
    """Number of linearisations."""
    iterations: int
    """Number of steps."""


def minimise(
    problem: LeastSquares,
    vector: Float,
    rule: DampingRule,
    ending: Callable[[int, Step | None], Ending | None],
    accepted: Callable[[Step], None] | None = None,
) -> Minimum:
    """Lower a sum of squares until there is a reason to stop.

    Parameters
    ----------
    problem
        The problem.
    vector
        float[P], where the iterations begin.
    rule
        Choice of the damping.
    ending
        Gets the number of iterations and the last step (None before the first), and returns why no further iteration is made;
        None if one is.
    accepted
        Called with every step that lowers the cost.
    """
    damping, evaluations, iterations, step = rule.first, 0, 0, None
    try:
        while (end := ending(iterations, step)) is None:
            steps, evaluations = problem.linearised(vector), evaluations + 1
            if steps is None:
                end = Ending.of(FitStatus.UNBOUNDED)
                break
            step = _descend(problem, steps, damping, rule)
            if step is None:
                end = Ending.of(FitStatus.NO_BETTER_STEP)
                break
            vector, damping, iterations = step.vector, step.damping, iterations + 1
            if accepted is not None:
                accepted(step)
    except KeyboardInterrupt:
        end = Ending.of(FitStatus.INTERRUPTED)
    except np.linalg.LinAlgError:
        end = Ending.of(FitStatus.SINGULAR)
    return Minimum(vector, end, evaluations, iterations)


def _descend(problem: LeastSquares, steps: DampedSteps, damping: float, rule: DampingRule) -> Step | None:
    """Return a step that lowers the cost; None if no step does.

    A cost takes far less than a linearisation. Several dampings are therefore tried: smaller ones as long as the cost and its
    prediction improve, and larger ones if the first did not lower the cost.
    """

    def tried(damping: float) -> Step:
        vector = steps.vector(damping)
        return Step(vector, damping, steps.predicted(damping), steps.cost, problem.cost(vector))

    best = tried(max(damping / rule.factor, rule.smallest))
    if best.cost < best.before:
        while best.damping > rule.smallest:
            if steps.predicted(best.damping / rule.factor) < (1.0 + rule.worth) * best.predicted:
                break
            other = tried(best.damping / rule.factor)
            if not other.cost < best.cost:
                break
            best = other
        return best
    while best.damping < rule.largest:
        best = tried(best.damping * rule.factor)
        if best.cost < best.before:
            return best
    return None

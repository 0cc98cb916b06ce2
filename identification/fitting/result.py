"""Result of a fit, the same for all models: why it ended, what it took, and the covariance of what it found."""

import warnings
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple

from numpy.typing import NDArray

from identification.storage import stored
from vibrolock.arrays import Float
from vibrolock.results import Result


class FitStatus(Enum):
    """Why a fit ended."""

    NO_ERROR = "no-error"
    """The residual is zero."""
    CONVERGED = "converged"
    """The last iterations gained less than the tolerance."""
    NO_BETTER_STEP = "no-better-step"
    """No step of any damping lowers the cost."""
    NO_FURTHER_GAIN = "no-further-gain"
    """For as many iterations as the settings allow, the error by which the iterate is chosen did not fall."""
    ITERATION_LIMIT = "iteration-limit"
    """The settings allow no further iteration; the last ones gained nothing."""
    STILL_IMPROVING = "still-improving"
    """The settings allow no further iteration, while the last ones still lowered the error."""
    INTERRUPTED = "interrupted"
    """The user has interrupted the fit. It can be resumed."""
    UNBOUNDED = "unbounded"
    """The sensitivities of the last iterate are not finite."""
    SINGULAR = "singular"
    """The linear problem of the last iterate could not be decomposed."""


MESSAGES = {
    FitStatus.NO_ERROR: "no error is left",
    FitStatus.CONVERGED: "{count} iterations whose gain was below {tolerance:g}",
    FitStatus.NO_BETTER_STEP: "no step of any damping fits better",
    FitStatus.NO_FURTHER_GAIN: "{count} iterations did not lower the {error} error{by}",
    FitStatus.ITERATION_LIMIT: "stopped at its limit of {limit} iterations",
    FitStatus.STILL_IMPROVING: (
        "stopped at its limit of {limit} iterations while still improving: {of} lowered the {error} error by {gain:.2g} %"
    ),
    FitStatus.INTERRUPTED: "interrupted",
    FitStatus.UNBOUNDED: "the sensitivities of the last iterate diverge",
    FitStatus.SINGULAR: "the normal equations of the last iterate could not be decomposed",
}
"""Sentence of each status; what is in braces is filled in where the fit ends."""


@dataclass(frozen=True, kw_only=True)
class FitProgress:
    """Progress of a fit.

    Parameters
    ----------
    iteration, iterations
        Number of this iteration, and the largest number of iterations.
    training_error, validation_error
        Relative RMS errors; NaN without validation data, inf for an unbounded run.
    damping
        Damping of the step to this iterate; NaN if it is not told.
    seconds
        Time since the fit began.
    stage
        ``start 3 of 8`` while starts are compared, or the stage of a fit in stages; else empty.
    usual_s
        Least and largest time that such a fit usually takes, s, from that of its first linearisation; None if unknown.
    """

    iteration: int
    iterations: int
    training_error: float
    validation_error: float
    damping: float
    seconds: float
    stage: str = ""
    usual_s: tuple[float, float] | None = None


class Ending(NamedTuple):
    """Why the iterations ended."""

    status: FitStatus
    message: str

    @classmethod
    def of(cls, status: FitStatus, **facts: Any) -> "Ending":
        """Return the end with its sentence, filled in with ``facts``."""
        return cls(status, MESSAGES[status].format(**facts))


_EARLIER = {
    "no error is left": FitStatus.NO_ERROR,
    "gain": FitStatus.CONVERGED,
    "no step": FitStatus.NO_BETTER_STEP,
    "did not lower": FitStatus.NO_FURTHER_GAIN,
    "still paid": FitStatus.STILL_IMPROVING,
    "limit": FitStatus.ITERATION_LIMIT,
    "interrupted": FitStatus.INTERRUPTED,
    "leave all bounds": FitStatus.UNBOUNDED,
    "decomposed": FitStatus.SINGULAR,
}
"""Status by a part of the sentence that earlier files hold in its place."""


def upgrade_fit(_arrays: dict[str, NDArray[Any]], attributes: dict[str, Any]) -> None:
    """Read why a fit of an earlier file ended from its sentence."""
    if "stopped" not in attributes:
        return
    message = attributes["message"] = str(attributes.pop("stopped"))
    found = next((status for part, status in _EARLIER.items() if part in message), FitStatus.CONVERGED)
    for flag, status in (("limited", FitStatus.STILL_IMPROVING), ("interrupted", FitStatus.INTERRUPTED)):
        found = status if attributes.pop(flag, False) else found
    attributes["status"] = found.value


@stored(upgrade=upgrade_fit)
@dataclass(frozen=True, eq=False, kw_only=True)
class FitResult(Result):
    """What the fits of all models have in common."""

    status: FitStatus
    """Why the fit ended."""
    message: str
    """The same as a sentence."""
    evaluations: int = 0
    """Number of linearisations: simulations of all experiments with derivatives; 0 if unknown."""
    iterations: int = 0
    """Number of steps that lowered the cost; 0 if unknown."""
    seconds: float = float("nan")
    """Wall time of the fit; NaN if unknown."""
    covariance: Float | None = None
    """float[P, P], covariance of the free numbers; None if it was not computed."""

    @property
    def stopped(self) -> str:
        """The `message`, under its earlier name; deprecated."""
        warnings.warn("`stopped` of a fit is now `message`", DeprecationWarning, stacklevel=2)
        return self.message

    @property
    def limited(self) -> bool:
        """Whether the settings allowed no further iteration, while the last ones still lowered the error."""
        return self.status is FitStatus.STILL_IMPROVING

    @property
    def interrupted(self) -> bool:
        """Whether the fit was interrupted. The result so far is complete."""
        return self.status is FitStatus.INTERRUPTED

"""Result of a fit: the chosen model, the last iterate, and the history of errors."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from identification.fitting.result import FitResult, upgrade_fit
from identification.models.pnlss.fitting.settings import FitSettings
from identification.models.pnlss.model import PnlssModel
from identification.storage import stored
from identification.validation import read_only
from vibrolock.arrays import Float


@dataclass(frozen=True, eq=False, kw_only=True)
class FitHistory:
    """Errors over the iterations, the start first.

    Parameters
    ----------
    training_error, validation_error
        float[n], relative RMS errors over all outputs; validation NaN without data, inf for an unbounded run.
    damping
        float[n], damping of the step to each iterate; the first is that of the settings.
    seconds
        float[n], time since the fit began.
    """

    training_error: Float
    validation_error: Float
    damping: Float
    seconds: Float

    def __post_init__(self) -> None:
        for name in ("training_error", "validation_error", "damping", "seconds"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.float64))

    @property
    def iterations(self) -> int:
        """Number of iterations after the start."""
        return int(self.training_error.size) - 1

    @property
    def validated(self) -> bool:
        """Whether there is validation data."""
        return not bool(np.all(np.isnan(self.validation_error)))

    @property
    def judged(self) -> Float:
        """float[n], the error that chooses the iterate: of the validation data, or of the training data without such."""
        errors = self.validation_error if self.validated else self.training_error
        return np.where(np.isnan(errors), np.inf, errors)

    @property
    def best(self) -> int:
        """Iteration with the smallest error `judged`."""
        return int(np.argmin(self.judged))

    def since_gain(self, share: float) -> int:
        """Number of iterations since the error `judged` was last lowered by ``share`` of what it was before."""
        mark, at = self.judged[0], 0
        for iteration, error in enumerate(self.judged):
            if error < mark * (1.0 - share):
                mark, at = error, iteration
        return self.iterations - at

    def gained(self, iterations: int) -> float:
        """Share by which the last ``iterations`` lowered the smallest error `judged`; NaN if no run before was bounded."""
        before = float(np.min(self.judged[: max(self.judged.size - iterations, 1)]))
        return 1.0 - float(np.min(self.judged)) / before if 0.0 < before < np.inf else float(np.nan)


def _upgrade(arrays: dict[str, NDArray[Any]], attributes: dict[str, Any]) -> None:
    """Drop a setting of files from before Hessians were always of all samples, and read why the fit ended."""
    upgrade_fit(arrays, attributes)
    attributes["settings"] = {key: value for key, value in attributes["settings"].items() if key != "every"}


@stored(upgrade=_upgrade)
@dataclass(frozen=True, eq=False, kw_only=True)
class PnlssFit(FitResult):
    """A fitted nonlinear state-space model.

    Further fields are those of `identification.fitting.result.FitResult`; ``resume`` of `fit_pnlss` continues it.

    Parameters
    ----------
    model
        The best iterate: on validation data if given, else on training data.
    last
        The last iterate, from which a resumed fit continues.
    linear
        The linear model with which the fit began; None if it began with a nonlinear one.
    history
        Errors over the iterations.
    chosen
        Number of the iteration that gave ``model``.
    initial_states, last_initial_states
        float[n_estimated, n_states], initial states of ``model`` and ``last`` in the experiments with an estimated initial
        state, in their order.
    state_scale
        float[n_states], RMS of the states in the start: their unit in the fit.
    settings
        Settings of the fit, as given.
    """

    model: PnlssModel
    last: PnlssModel
    linear: PnlssModel | None
    history: FitHistory
    chosen: int
    initial_states: Float
    last_initial_states: Float
    state_scale: Float
    settings: FitSettings

    def __post_init__(self) -> None:
        for name in ("initial_states", "last_initial_states", "state_scale"):
            object.__setattr__(self, name, read_only(getattr(self, name), np.float64))

    @property
    def training_error(self) -> float:
        """Relative RMS error of ``model`` on the training data."""
        return float(self.history.training_error[self.chosen])

    @property
    def validation_error(self) -> float:
        """Relative RMS error of ``model`` on the validation data; NaN without."""
        return float(self.history.validation_error[self.chosen])

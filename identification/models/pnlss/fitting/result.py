"""Settings of a fit, its progress, and its result: the chosen model, the last iterate, and the history of errors."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from identification.errors import IdentificationError
from identification.fitting.result import FitResult, upgrade_fit
from identification.models.pnlss.model import PnlssModel
from identification.storage import stored
from identification.validation import convert_fields, read_only
from vibrolock.arrays import Float

OutputWeighting = Literal["rms", "none"]


@dataclass(frozen=True, kw_only=True)
class FitSettings:
    """Settings of `fit_pnlss`.

    Raises `IdentificationError` if a value is out of its range.

    Parameters
    ----------
    iterations
        Largest number of iterations, including those of a fit that is resumed. A fit that reaches it was stopped, and says
        what its last iterations still gained.
    patience
        Stop once this many iterations have not lowered the error by ``least_gain``; 0 for never. The error is that of the
        validation data, or of the training data if there is no validation data.
    least_gain
        Share of the error; 0 for any gain.
    tolerance
        Stop once the training error has fallen by less than this share in each of five successive iterations.
    outputs
        ``rms``: squared errors of each output are relative to its mean square over the training data, so that outputs in any
        unit have equal weight. ``none``: errors are in the units of the channels, as in the toolbox of the paper.
    ridge
        Factor of the sum of squares of E and F that is added to the squared relative error, in variables whose RMS in the
        start is one. Off by default. It keeps coefficients small that the data do not determine. A large ridge also changes
        the state coordinates, because larger states make the same coefficients smaller.
    band_hz
        Only frequencies from the first to the second count. Needs periodic experiments.
    line_weights
        Rows of a frequency in Hz and the weights of errors there, one for all outputs or one for each. Weights are linear in
        between and 0 beyond. Needs periodic experiments.
    damping
        Damping of the first step, relative to the largest eigenvalue of the scaled normal equations.
    truncation
        Parameters do not move in directions whose eigenvalue is below this share of the largest. Among these directions are
        the changes of state coordinates, which change no output.
    """

    iterations: int = 1000
    patience: int = 40
    least_gain: float = 1e-3
    tolerance: float = 1e-6
    outputs: OutputWeighting = "rms"
    ridge: float = 0.0
    band_hz: tuple[float, float] | None = None
    line_weights: tuple[tuple[float, ...], ...] = ()
    damping: float = 1e-3
    truncation: float = 1e-13

    def __post_init__(self) -> None:
        object.__setattr__(self, "line_weights", tuple(tuple(map(float, row)) for row in self.line_weights))
        for name, allowed, fine in (
            ("iterations", "0 and above", self.iterations >= 0),
            ("patience", "0 and above", self.patience >= 0),
            ("least_gain", "0 and above, below 1", 0.0 <= self.least_gain < 1.0),
            ("tolerance", "0 and above, below 1", 0.0 <= self.tolerance < 1.0),
            ("outputs", ", ".join(get_args(OutputWeighting)), self.outputs in get_args(OutputWeighting)),
            ("ridge", "0 and above, finite", 0.0 <= self.ridge < float("inf")),
            ("damping", "above 0, finite", 0.0 < self.damping < float("inf")),
            ("truncation", "0 and above, below 1", 0.0 <= self.truncation < 1.0),
        ):
            if not fine:
                raise IdentificationError(field=name, value=getattr(self, name), allowed=allowed)
        if self.band_hz is not None:
            low, high = (float(value) for value in self.band_hz)
            object.__setattr__(self, "band_hz", (low, high))
            if not 0.0 <= low < high:
                raise IdentificationError(
                    f"is {low:g} to {high:g} Hz", field="band_hz", allowed="0 or above, the second the larger"
                )
        rows = self.line_weights
        rising = all(later[0] > row[0] for row, later in pairwise(rows))
        alike = all(len(row) == len(rows[0]) >= 2 and min(row) >= 0.0 and max(row) < float("inf") for row in rows)
        if not (alike and rising):
            raise IdentificationError(
                "need rows of a frequency and weights, all finite and not below 0, frequencies rising",
                field="line_weights",
            )

    @property
    def by_frequency(self) -> bool:
        """Whether errors are weighted over frequency."""
        return self.band_hz is not None or bool(self.line_weights)


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
        convert_fields(self, read_only, "training_error", "validation_error", "damping", "seconds")

    def with_iterate(self, training: float, validation: float, damping: float, seconds: float) -> "FitHistory":
        """Return the history with one more iterate."""
        more = {"training_error": training, "validation_error": validation, "damping": damping, "seconds": seconds}
        return FitHistory(**{name: np.append(getattr(self, name), value) for name, value in more.items()})

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
        convert_fields(self, read_only, "initial_states", "last_initial_states", "state_scale")

    @property
    def training_error(self) -> float:
        """Relative RMS error of ``model`` on the training data."""
        return float(self.history.training_error[self.chosen])

    @property
    def validation_error(self) -> float:
        """Relative RMS error of ``model`` on the validation data; NaN without."""
        return float(self.history.validation_error[self.chosen])

"""Settings of a fit, and its progress reports."""

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal, get_args

from identification.errors import IdentificationError

OutputWeighting = Literal["rms", "none"]


@dataclass(frozen=True, kw_only=True)
class FitSettings:
    """Settings of `fit_pnlss`.

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

    Raises
    ------
    IdentificationError
        If a value is out of its range.
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
        Damping of the step to this iterate.
    seconds
        Time since the fit began.
    stage
        ``start 3 of 8`` while starts are compared; empty in the fit itself.
    """

    iteration: int
    iterations: int
    training_error: float
    validation_error: float
    damping: float
    seconds: float
    stage: str = ""

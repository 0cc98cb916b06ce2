"""Predictions of one model together with their references."""

from dataclasses import dataclass

from identification.errors import IdentificationError
from identification.frequency_responses import FrequencyResponse
from identification.models.modal.sweep_prediction import SweepPrediction
from identification.prediction.comparison import PredictionError
from identification.prediction.simulated_runs import SimulatedRun
from identification.prediction.steady_prediction import ResponseBand, SteadyPrediction
from identification.signals.transients import Transient
from vibrolock.results import Result


@dataclass(frozen=True, eq=False, kw_only=True)
class Predictions(Result):
    """Predicted steady responses and sweeps; references and errors are None where there is no reference.

    Raises `IdentificationError` if there are not as many references or errors as predictions.

    Parameters
    ----------
    steady, steady_references, steady_errors
        Predicted frequency responses, with the measured one and the errors for each.
    steady_bands
        Uncertainty bands of the frequency responses, None if unknown; empty if all are unknown.
    sweeps, sweep_references, sweep_errors
        Predicted sweeps, with the recorded one and the errors for each.
    runs
        Simulations of recorded experiments by a nonlinear state-space model.
    specimen
        Name of what was tested.
    notes
        Remarks on the predictions, one line each.
    """

    steady: tuple[SteadyPrediction, ...] = ()
    steady_references: tuple[FrequencyResponse | None, ...] = ()
    steady_errors: tuple[PredictionError | None, ...] = ()
    steady_bands: tuple[ResponseBand | None, ...] = ()
    sweeps: tuple[SweepPrediction, ...] = ()
    sweep_references: tuple[Transient | None, ...] = ()
    sweep_errors: tuple[PredictionError | None, ...] = ()
    runs: tuple[SimulatedRun, ...] = ()
    specimen: str = ""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not self.steady_bands:
            object.__setattr__(self, "steady_bands", (None,) * len(self.steady))
        if len(self.steady_bands) != len(self.steady):
            raise IdentificationError(f"{len(self.steady)} predictions, {len(self.steady_bands)} bands", field="steady")
        for kind, counts in (
            ("steady", (len(self.steady), len(self.steady_references), len(self.steady_errors))),
            ("sweeps", (len(self.sweeps), len(self.sweep_references), len(self.sweep_errors))),
        ):
            if len(set(counts)) > 1:
                raise IdentificationError(
                    f"{counts[0]} predictions, {counts[1]} references, {counts[2]} errors", field=kind
                )

    @property
    def errors(self) -> tuple[PredictionError, ...]:
        """Errors of all comparisons, steady responses first."""
        return tuple(error for error in (*self.steady_errors, *self.sweep_errors) if error is not None)

"""Predictions by a nonlinear mode, compared with recordings."""

from pathlib import Path

from identification import (
    Exciter,
    FrequencyResponse,
    IdentificationError,
    LinearModes,
    NonlinearMode,
    Predictions,
    ResponseBand,
    SteadyPrediction,
    compare,
    frequency_response,
    recorded_force_response,
    response_band,
)
from identification.prediction import FLAGGED_BEYOND
from rig.results.files import load_as
from rig.results.measured import modes_in
from rig.results.nonlinear_mode.options import NonlinearModePrediction
from rig.results.predictions.references import Compared, Swept, other_specimens, over_of, predictions_of, stepped_sines
from rig.results.predictions.sweeps import SweepModels, planned_sweeps, recorded_sweeps

_DRAWS = 40
"""Modes drawn from the standard errors for a band; chosen."""
_POINTS = 401
"""Points of a branch of a response. Chosen."""


def predict(model: Path, request: NonlinearModePrediction) -> Predictions:
    """Predict with a nonlinear mode, with errors where there is a reference.

    Raises `RecordingError` for files with other contents, `ConfigurationError` for plans that cannot be predicted,
    `identification.IdentificationError` beyond twice the largest amplitude with which the mode was identified.
    """
    mode = load_as(NonlinearMode, model)
    modes = None if request.modes is None else modes_in(request.modes)
    exciter = None if request.exciter is None else load_as(Exciter, request.exciter)
    references = [measured for path in request.references for measured in stepped_sines(path)]
    wanted = request.model_copy(update={"held": request.held or "fundamental"})
    alone = request.forces_without_reference(references, "fundamental")
    steady = [Compared(_steady(mode, force, modes, wanted), band=_band(mode, force, wanted)) for force in alone]
    steady += [_compared(mode, measured, modes, request) for measured in references]
    models = SweepModels(mode, modes, exciter, request.zero_crossings, request.largest_range_use)
    swept: list[Swept] = [found for path in request.sweeps for found in recorded_sweeps(path, models)]
    swept += [found for plan in request.planned for found in planned_sweeps(plan, models)]
    return predictions_of(mode.specimen, steady, swept, notes=other_specimens(mode.specimen, references))


def _steady(
    mode: NonlinearMode, force_n: float, modes: LinearModes | None, request: NonlinearModePrediction
) -> SteadyPrediction:
    return frequency_response(
        mode,
        force_n,
        force=request.held,
        linear_modes=modes,
        points=_POINTS,
        largest_range_use=request.largest_range_use,
    )


def _band(mode: NonlinearMode, force_n: float, request: NonlinearModePrediction) -> ResponseBand | None:
    """Return the uncertainty band of a response; None if standard errors are unknown or a draw leaves the range."""
    try:
        if _steady(mode, force_n, None, request).range_use.max() > FLAGGED_BEYOND:
            return None  # the standard errors do not include the error of extrapolation
        return response_band(
            mode, force_n, force=request.held, draws=_DRAWS, largest_range_use=request.largest_range_use
        )
    except IdentificationError:
        return None


def _compared(
    mode: NonlinearMode, measured: FrequencyResponse, modes: LinearModes | None, request: NonlinearModePrediction
) -> Compared:
    """Predict a reference at constant force if its force was controlled, otherwise at the force of each point, and compare."""
    band = None
    if measured.controlled == "force":
        wanted = request.model_copy(update={"held": "fundamental"})
        predicted, band = _steady(mode, measured.level, modes, wanted), _band(mode, measured.level, wanted)
    else:
        largest = request.largest_range_use
        predicted = recorded_force_response(mode, measured, linear_modes=modes, largest_range_use=largest)
    error = compare(predicted, measured, over=over_of(measured, request.over)).error
    return Compared(predicted, measured, error, band)

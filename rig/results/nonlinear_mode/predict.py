"""Predictions by a nonlinear mode, compared with recordings."""

from collections.abc import Sequence
from pathlib import Path

from identification import (
    Exciter,
    FrequencyResponse,
    IdentificationError,
    LinearModes,
    NonlinearMode,
    PredictionError,
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
from rig.results.predictions.references import over_of, stepped_sines
from rig.results.predictions.sweeps import SweepModels, Swept, planned_sweeps, recorded_sweeps

_Compared = tuple[SteadyPrediction, FrequencyResponse | None, PredictionError | None, ResponseBand | None]


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
    alone = request.forces_without_reference(references, "fundamental")
    steady: list[_Compared] = [_alone(mode, force, modes, request) for force in alone]
    steady += [_compared(mode, measured, modes, request) for measured in references]
    models = SweepModels(mode, modes, exciter, request.zero_crossings, request.largest_range_use)
    swept: list[Swept] = [found for path in request.sweeps for found in recorded_sweeps(path, models)]
    swept += [found for plan in request.planned for found in planned_sweeps(plan, models)]
    return Predictions(
        steady=tuple(item[0] for item in steady),
        steady_references=tuple(item[1] for item in steady),
        steady_errors=tuple(item[2] for item in steady),
        steady_bands=tuple(item[3] for item in steady),
        sweeps=tuple(item.prediction for item in swept),
        sweep_references=tuple(item.recorded for item in swept),
        sweep_errors=tuple(item.error for item in swept),
        specimen=mode.specimen,
        notes=tuple(dict.fromkeys([*_strangers(mode, steady), *(note for item in swept for note in item.notes)])),
    )


def _strangers(mode: NonlinearMode, steady: Sequence[_Compared]) -> list[str]:
    """Return a note on each specimen of the references other than the model's."""
    others = {item[1].specimen for item in steady if item[1] is not None} - {"", mode.specimen}
    return [
        f"the model is of {mode.specimen}, a reference of {other}: not the same specimen" for other in sorted(others)
    ]


def _alone(
    mode: NonlinearMode, force_n: float, modes: LinearModes | None, request: NonlinearModePrediction
) -> _Compared:
    return _steady(mode, force_n, modes, request), None, None, _band(mode, force_n, request)


def _steady(
    mode: NonlinearMode, force_n: float, modes: LinearModes | None, request: NonlinearModePrediction
) -> SteadyPrediction:
    held = request.held or "fundamental"
    return frequency_response(
        mode, force_n, force=held, linear_modes=modes, points=_POINTS, largest_range_use=request.largest_range_use
    )


def _band(mode: NonlinearMode, force_n: float, request: NonlinearModePrediction) -> ResponseBand | None:
    """Return the uncertainty band of a response; None if standard errors are unknown or a draw leaves the range."""
    held = request.held or "fundamental"
    try:
        if _steady(mode, force_n, None, request).range_use.max() > FLAGGED_BEYOND:
            return None  # the standard errors do not include the error of extrapolation
        return response_band(mode, force_n, force=held, draws=_DRAWS, largest_range_use=request.largest_range_use)
    except IdentificationError:
        return None


def _compared(
    mode: NonlinearMode, measured: FrequencyResponse, modes: LinearModes | None, request: NonlinearModePrediction
) -> _Compared:
    """Predict a reference at constant force if its force was controlled, otherwise at the force of each point, and compare."""
    if measured.controlled == "force":
        wanted = request.model_copy(update={"held": "fundamental"})
        predicted, band = _steady(mode, measured.level, modes, wanted), _band(mode, measured.level, wanted)
    else:
        predicted, band = (
            recorded_force_response(mode, measured, linear_modes=modes, largest_range_use=request.largest_range_use),
            None,
        )
    return predicted, measured, compare(predicted, measured, over=over_of(measured, request.over)).error, band

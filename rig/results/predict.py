"""Predictions by models, compared with recordings."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np

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
from identification.models import HeldForce
from identification.prediction import FLAGGED_BEYOND, Over
from rig.campaigns.evaluation.point import spectrum_of, vibration_of
from rig.campaigns.evaluation.recorded import points_of
from rig.errors import ConfigurationError, RecordingError
from rig.measurements import STEPPED, frequency_responses
from rig.recording.arrays import kind_of
from rig.recording.reader import Recording
from rig.results.exciter.kind import EXCITER
from rig.results.files import load_as
from rig.results.force_surface.kind import FORCE_SURFACE
from rig.results.force_surface.predict import surface_predictions
from rig.results.frequency_responses.kind import FREQUENCY_RESPONSES
from rig.results.identify import modes_in
from rig.results.nonlinear_mode.kind import NONLINEAR_MODE
from rig.results.pnlss.kind import PNLSS
from rig.results.predictions.request import PredictionRequest
from rig.results.predictions.sweeps import SweepModels, Swept, planned_sweeps, recorded_sweeps
from rig.results.simulated.steady import Reference
from rig.results.simulated_predict import simulated_predictions
from rig.results.structured.kind import STRUCTURED

_Compared = tuple[SteadyPrediction, FrequencyResponse | None, PredictionError | None, ResponseBand | None]

_DRAWS = 40


def predict_vibrations(model: Path, request: PredictionRequest) -> Predictions:
    """Predict with a nonlinear mode, a PNLSS or structured model or a force surface, with errors where there is a reference.

    Raises `RecordingError` for files with other contents, `ConfigurationError` for plans that cannot be predicted,
    `identification.IdentificationError` if the model cannot answer, in particular beyond twice the largest amplitude with which
    it was identified.
    """
    kind = kind_of(model)
    if kind not in (known := (NONLINEAR_MODE.name, PNLSS.name, STRUCTURED.name, FORCE_SURFACE.name)):
        raise RecordingError(f"{model}: is a file of kind {kind}; predictions are made with a {', '.join(known)}")
    if request.trust_code and kind not in (STRUCTURED.name, PNLSS.name):
        raise ConfigurationError(f"`trust_code`: means nothing to a {kind}, which names no code; leave it out")
    if request.bands and kind != STRUCTURED.name:
        raise ConfigurationError(
            f"`bands`: are asked of structured models, and {model} is a {kind}; a nonlinear mode has them anyway"
        )
    for simulated in (PNLSS, STRUCTURED):
        if kind == simulated.name:
            measured_ones = [one for path in request.references for one in _references(path, request)]
            return simulated_predictions(model, simulated, request, measured_ones)
    if request.voltages_v:
        raise ConfigurationError(f"`voltages_v`: means nothing to a {kind}; a PNLSS or structured model answers it")
    if kind == FORCE_SURFACE.name:
        references = [measured for path in request.references for measured in _stepped_sines(path)]
        return surface_predictions(load_as(FORCE_SURFACE, model), request, references)
    _check_mode(request)
    mode = cast(NonlinearMode, load_as(NONLINEAR_MODE, model))
    modes = None if request.modes is None else modes_in(request.modes)
    exciter = None if request.exciter is None else cast(Exciter, load_as(EXCITER, request.exciter))
    references = [measured for path in request.references for measured in _stepped_sines(path)]
    alone = request.forces_without_reference(references, "fundamental")
    steady: list[_Compared] = [_alone(mode, force, modes, request) for force in alone]
    steady += [_compared(mode, measured, modes, request) for measured in references]
    models = SweepModels(mode, modes, exciter, request.zero_crossings, request.allow_extrapolation)
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


def _check_mode(request: PredictionRequest) -> None:
    """Refuse requests that a nonlinear mode cannot answer."""
    if request.exciter is None and request.planned:
        raise ConfigurationError("`planned`: gives a voltage, which needs an exciter; add `exciter`")
    if request.exciter is not None and not (request.sweeps or request.planned):
        raise ConfigurationError(
            "`exciter`: is for sweeps, and none is given; add `sweeps` or `planned`, or leave it out"
        )
    for name, given in (("multisines", request.multisines), ("planned_multisines", request.planned_multisines)):
        if given:
            raise ConfigurationError(
                f"`{name}`: means nothing to a nonlinear mode; a PNLSS or structured model simulates multisines"
            )
    if request.constants:
        raise ConfigurationError("`constants`: means nothing to a nonlinear mode, which has one input; leave it out")


def _strangers(mode: NonlinearMode, steady: Sequence[_Compared]) -> list[str]:
    """Return a note on each specimen of the references other than the model's."""
    others = {item[1].specimen for item in steady if item[1] is not None} - {"", mode.specimen}
    return [
        f"the model is of {mode.specimen}, a reference of {other}: not the same specimen" for other in sorted(others)
    ]


def _alone(mode: NonlinearMode, force_n: float, modes: LinearModes | None, request: PredictionRequest) -> _Compared:
    return _steady(mode, force_n, modes, request), None, None, _band(mode, force_n, request)


def _steady(
    mode: NonlinearMode, force_n: float, modes: LinearModes | None, request: PredictionRequest
) -> SteadyPrediction:
    held = cast(HeldForce, request.held or "fundamental")
    return frequency_response(mode, force_n, force=held, modes=modes, allow_extrapolation=request.allow_extrapolation)


def _band(mode: NonlinearMode, force_n: float, request: PredictionRequest) -> ResponseBand | None:
    """Return the uncertainty band of a response; None if standard errors are unknown or a draw leaves the range."""
    held = cast(HeldForce, request.held or "fundamental")
    try:
        if _steady(mode, force_n, None, request).range_use.max() > FLAGGED_BEYOND:
            return None  # the standard errors do not include the error of extrapolation
        return response_band(mode, force_n, force=held, draws=_DRAWS, allow_extrapolation=request.allow_extrapolation)
    except IdentificationError:
        return None


def _compared(
    mode: NonlinearMode, measured: FrequencyResponse, modes: LinearModes | None, request: PredictionRequest
) -> _Compared:
    """Predict a reference at constant force if its force was controlled, otherwise at the force of each point, and compare."""
    if measured.controlled == "force":
        wanted = replace(request, held="fundamental")
        predicted, band = _steady(mode, measured.level, modes, wanted), _band(mode, measured.level, wanted)
    else:
        predicted, band = (
            recorded_force_response(mode, measured, modes=modes, allow_extrapolation=request.allow_extrapolation),
            None,
        )
    return predicted, measured, compare(predicted, measured, over=_over(measured, request)).error, band


def _over(measured: FrequencyResponse, request: PredictionRequest) -> Over:
    """Return the quantity over which a reference is compared."""
    return cast(Over, request.over or ("phase" if _turns_back(measured.frequency_hz) else "frequency"))


def _turns_back(frequency_hz: np.ndarray) -> bool:
    """Whether the frequency turns back along a branch. Then only the phase distinguishes vibrations at the same frequency."""
    steps = np.diff(frequency_hz)
    return bool((steps > 0.0).any() and (steps < 0.0).any())


def _references(path: Path, request: PredictionRequest) -> list[Reference]:
    """Return stepped sines with the second harmonic of their force, if it was recorded."""
    ratios: dict[tuple[float, float], float] = {}
    if kind_of(path) in STEPPED:
        with Recording(path) as recording:
            row = [channel["role"] for channel in recording.channels].index("force")
            for point in (point for point in points_of(recording) if point.accepted):
                force = np.abs(spectrum_of(point).harmonics[row])
                if force.size > 2 and force[1] > 0.0:
                    ratios[point.level, vibration_of(point).frequency_hz] = float(force[2] / force[1])
    found = []
    for measured in _stepped_sines(path):
        top = float(measured.frequency_hz[int(np.argmax(measured.amplitude_m))])
        over = _over(measured, request)
        found.append(Reference(measured, over, request.over is not None, ratios.get((measured.level, top))))
    return found


def _stepped_sines(path: Path) -> Sequence[FrequencyResponse]:
    kind = kind_of(path)
    if kind == FREQUENCY_RESPONSES.name:
        return cast(tuple[FrequencyResponse, ...], load_as(FREQUENCY_RESPONSES, path))
    if kind not in STEPPED:
        raise RecordingError(
            f"{path}: is a file of kind {kind}; a reference is a stepped-sine recording or imported stepped sines"
        )
    with Recording(path) as recording:
        return frequency_responses(recording)

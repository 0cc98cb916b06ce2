"""Predictions by PNLSS and structured models: steady vibrations, recorded sweeps, recorded multisines."""

import math
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import cast

import numpy as np

from identification import (
    Exciter,
    FrequencyResponse,
    IdentificationError,
    Predictions,
    ResponseBand,
    SteadyPrediction,
    frequency_response,
)
from identification.harmonic_balance import Held
from identification.models import check_input, check_response
from identification.prediction import band_of_responses
from rig.errors import ConfigurationError
from rig.results.files import load, load_as
from rig.results.predictions.references import Compared, other_specimens, predictions_of, references_in
from rig.results.simulated.driven_models import LARGEST_RANGE_USE, DrivenModel, Fixed, Level, constants_of, level_of
from rig.results.simulated.model import SimulatedModel
from rig.results.simulated.multisines import planned_multisines, simulated_multisines
from rig.results.simulated.open_bands import OpenBands
from rig.results.simulated.options import SimulatedPrediction
from rig.results.simulated.steady import compared, default_held
from rig.results.simulated.sweep_models import SimulatedSweepModels
from rig.results.simulated.sweeps import planned_simulated_sweeps, recorded_simulated_sweeps
from vibrolock.one_thread import one_thread

_DRAWS = 40
"""Models of a band."""
_FEW = 10
"""Models of a band that is not asked for, beyond the training data: what these leave open is the larger part. Chosen."""
_ANYWHERE = 1e3
"""Use of the trained range up to which responses of the ends of what the data leave open are followed."""


@one_thread()
def predict(path: Path, request: SimulatedPrediction) -> Predictions:
    """Return the requested predictions, with errors where there is a reference. Unbounded runs are also results.

    Raises `ConfigurationError` for requests that such a model cannot answer and for code that is not trusted,
    `identification.IdentificationError` if it has no periodic vibration or its channels do not fit.
    """
    found: SimulatedModel = load(path)
    references = [one for file in request.references for one in references_in(file, request.over)]
    model = cast(DrivenModel, found.model)
    found.check_trusted(path, request.trust_code)
    _check(request, model, path)
    bands_asked = getattr(request, "bands", False)
    open_ = found.open_bands(bands_asked, getattr(request, "allow_extrapolation", False))
    exciter = None if request.exciter is None else load_as(Exciter, request.exciter)
    constants = constants_of(model, request.constants, path)
    fixed: Fixed = {"exciter": exciter, "largest_range_use": LARGEST_RANGE_USE}
    if constants:
        fixed["held_inputs"] = constants
    held: Held = request.held or default_held(model, exciter)
    references_held = default_held(model, exciter)
    alone = request.forces_without_reference([one.measured for one in references], references_held)
    levels = [*(level_of(force, held) for force in alone), *(level_of(one, "voltage") for one in request.voltages_v)]
    if bands_asked and found.fit_is_missing:
        raise ConfigurationError(
            f"`bands`: {path} has a model without its fit, whose covariance they need; leave it out"
        )
    responses = [frequency_response(model, **level, **fixed) for level in levels]
    wanted = [_wanted(open_, one) for one in responses]
    others = (
        _others(found, _DRAWS if bands_asked else _FEW) if any(wanted) or (levels and found.scatter is not None) else []
    )
    bands = [
        _band(found, others, level, fixed, response) if more or found.scatter is not None else None
        for level, response, more in zip(levels, responses, wanted, strict=True)
    ]
    steady = [Compared(one, band=band) for one, band in zip(responses, bands, strict=True)]
    steady += [compared(model, fixed, one, whole=_asked(request, alone, one.measured)) for one in references]
    models = SimulatedSweepModels(model, exciter, constants, open_)
    swept = [one for recording in request.sweeps for one in recorded_simulated_sweeps(recording, models)]
    swept += [one for plan in request.planned for one in planned_simulated_sweeps(plan, models)]
    runs, said = simulated_multisines(request.multisines, found, model.specimen, constants, open_)
    for plan in request.planned_multisines:
        more, remarks = planned_multisines(plan, model, exciter, constants, open_)
        runs, said = (*runs, *more), (*said, *remarks)
    if any(one is None and more for one, more in zip(bands, wanted, strict=True)):
        said = (*said, "a response has no band where most of the models that the fit allows have no such response")
    if any(bands):
        of = (
            "the model that was fitted, by the covariance of the fit, the error that it left, and laws that fit as well"
            if found.scatter is None
            else "new runs, by the model's scatter from run to run alone"
        )
        said = (*said, f"bands and +- of responses: of {of}")
    elif found.scatter is not None:
        said = (
            *said,
            "the model describes an average run; these predictions do not include its scatter from run to run",
        )
    notes = [*(_default(request, held) if request.forces_n else ()), *said]
    notes += other_specimens(model.specimen, [reference.measured for reference in references])
    return predictions_of(model.specimen, steady, swept, runs, notes)


def _wanted(open_: OpenBands | None, response: SteadyPrediction) -> bool:
    """Return whether a response gets a band; raise `ExtrapolationError` if it is beyond what a model without its fit says."""
    use = float(np.nanmax(response.range_use, initial=0.0))
    if open_ is None or not open_.wanted(use):
        return False
    if open_.fit is not None:
        check_response(open_.fit.model, response)
    check_input(response.name, use)
    return open_.fit is not None


def _others(found: SimulatedModel, count: int) -> Sequence[DrivenModel]:
    if found.scatter is not None:
        return list(found.scatter.fresh(cast(DrivenModel, found.model), _DRAWS))
    return cast(Sequence[DrivenModel], found.allowed_by_fit(count) or [])


def _band(
    found: SimulatedModel, others: Sequence[DrivenModel], level: Level, fixed: Fixed, response: SteadyPrediction
) -> ResponseBand | None:
    """Return the band of a response over other models; None if there are none, or if most have no such response."""
    responses: list[SteadyPrediction] = []
    without: Fixed = {**fixed, "stability": False}  # which a band has no use for
    for model in others:
        with suppress(IdentificationError):
            responses.append(frequency_response(model, **level, **without))
    if len(responses) <= len(others) // 2:
        return None
    band = band_of_responses(responses)
    if found.scatter is not None:
        return band
    anywhere: Fixed = {**without, "largest_range_use": _ANYWHERE}
    return found.with_what_is_open(band, response, lambda model: frequency_response(model, **level, **anywhere))


def _check(request: SimulatedPrediction, model: DrivenModel, path: Path) -> None:
    steady = bool(request.forces_n or request.voltages_v or request.references)
    swept = bool(request.sweeps or request.planned)
    inputs, outputs = ([channel.role for channel in channels] for channels in (model.inputs, model.outputs))
    named = ", ".join(channel.name for channel in (*model.inputs, *model.outputs))
    if (steady or swept) and "force" not in (*inputs, *outputs):
        raise ConfigurationError(
            f"{path}: has no force among its channels ({named}), without which it answers `multisines` alone; identify it with "
            "the force among `outputs`"
        )
    if swept and "drive" not in outputs:
        raise ConfigurationError(
            f"{path}: has no drive point among its channels ({named}), which sweeps are compared at; identify it with the "
            "drive point among `outputs`"
        )
    if request.exciter is None and "force" in inputs:
        for name, asked in (
            ("voltages_v", request.voltages_v),
            ("planned", request.planned),
            ("planned_multisines", request.planned_multisines),
        ):
            if asked:
                raise ConfigurationError(f"`{name}`: gives a voltage, and {path} is driven by a force; add `exciter`")
    if request.exciter is not None and "force" not in inputs:
        raise ConfigurationError(f"`exciter`: is inside {path}, whose input is the voltage; leave it out")
    if request.exciter is not None and not (steady or swept or request.planned_multisines):
        raise ConfigurationError(
            "`exciter`: does not apply to `multisines`, which takes the recorded force; leave it out"
        )


def _asked(request: SimulatedPrediction, alone: Sequence[float], measured: FrequencyResponse) -> bool:
    """Return whether the response to the force of a reference was asked for too, and so is wanted over the whole band."""
    others = set(request.forces_n) - set(alone)
    return measured.controlled == "force" and any(math.isclose(force, measured.level, rel_tol=1e-6) for force in others)


def _default(request: SimulatedPrediction, held: Held) -> tuple[str, ...]:
    if request.held is not None or held != "pure-sine":
        return ()
    return (
        "the force held constant has no harmonics, because nothing in the model makes any; with an exciter model, the "
        "fundamental or the RMS of the shaker's force is held",
    )

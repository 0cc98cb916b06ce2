"""Predictions of nonlinear state-space models: steady vibrations, recorded sweeps, recorded multisines."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal, cast

import numpy as np

from identification import (
    Exciter,
    FrequencyResponse,
    IdentificationError,
    PnlssModel,
    PredictionError,
    Predictions,
    SimulatedRun,
    SteadyPrediction,
    SteadyStates,
    compare,
    pnlss_frequency_response,
    pnlss_steady_state,
    simulated_run,
)
from identification.prediction.comparison import Over
from rig.errors import ConfigurationError, RecordingError
from rig.experiments import experiments
from rig.models.exciter import EXCITER
from rig.models.files import load_as
from rig.models.pnlss import PNLSS, IdentifiedPnlss
from rig.models.predict_pnlss_sweeps import pnlss_sweeps
from rig.recording.reader import Recording

if TYPE_CHECKING:
    from rig.models.predict import PredictionRequest

__all__ = ["pnlss_predictions"]

Held = Literal["fundamental", "rms", "pure-sine", "voltage"]
_MARGIN = 0.02
"""How far beyond a reference's frequencies a response is followed."""


def pnlss_predictions(
    path: Path, request: "PredictionRequest", references: Sequence[tuple[FrequencyResponse, Over]]
) -> Predictions:
    """What is asked for, with errors where there is something to compare with; unbounded runs are results like others.

    Raises `ConfigurationError` for what a nonlinear state-space model does not answer, `identification.IdentificationError`
    where it has no periodic vibration, or channels that do not fit.
    """
    _check(request)
    found: IdentifiedPnlss = load_as(PNLSS, path)
    model = found.model
    exciter = None if request.exciter is None else cast(Exciter, load_as(EXCITER, request.exciter))
    held = _held(model, exciter, request.held)
    steady: list[tuple[SteadyPrediction, FrequencyResponse | None, PredictionError | None]] = [
        (pnlss_frequency_response(model, force_n, force=held, exciter=exciter), None, None)
        for force_n in request.forces_n
    ]
    steady += [_compared(model, exciter, *reference) for reference in references]
    swept = [one for sweep in request.sweeps for one in pnlss_sweeps(sweep, model)]
    runs = [run for recording in request.multisines for run in _multisine(recording, found)]
    return Predictions(
        steady=tuple(one for one, _, _ in steady),
        steady_references=tuple(reference for _, reference, _ in steady),
        steady_errors=tuple(error for _, _, error in steady),
        sweeps=tuple(one.prediction for one in swept),
        sweep_references=tuple(one.recorded for one in swept),
        sweep_errors=tuple(one.error for one in swept),
        runs=tuple(runs),
        specimen=model.specimen,
        notes=tuple(
            dict.fromkeys(
                [
                    *(_default(request, held) if request.forces_n else ()),
                    *_strangers(model, [reference for reference, _ in references]),
                    *(note for one in swept for note in one.notes),
                ]
            )
        ),
    )


def _check(request: "PredictionRequest") -> None:
    """Refuse what is asked of a nonlinear mode alone."""
    given = {
        "--planned-sweep": bool(request.planned),
        "--zero-crossings": request.zero_crossings is not None,
        "--modes": request.modes is not None,
        "--allow-extrapolation": request.allow_extrapolation,
    }
    for name in (name for name, is_given in given.items() if is_given):
        raise ConfigurationError(
            f"{name}: means nothing to a PNLSS model, which answers --frequency-response, --reference, --sweep and --multisine"
        )
    if request.exciter is not None and not (request.forces_n or request.references):
        raise ConfigurationError(
            "--exciter: is for frequency responses of a PNLSS model, and none is asked for; a sweep is predicted from the "
            "model's own input"
        )


def _held(model: PnlssModel, exciter: Exciter | None, asked: str | None) -> Held:
    """What is constant: as asked, else what the model can hold."""
    if asked is not None:
        return cast(Held, asked)
    force_driven = any(channel.role == "force" for channel in model.inputs)
    return "pure-sine" if force_driven and exciter is None else "fundamental"


def _default(request: "PredictionRequest", held: Held) -> tuple[str, ...]:
    """What was chosen where nothing was said."""
    if request.held is not None or held != "pure-sine":
        return ()
    return (
        "constant is a force without harmonics, for nothing in the model makes any: add --exciter for the fundamental or "
        "the RMS of a force that a shaker makes",
    )


def _compared(
    model: PnlssModel, exciter: Exciter | None, measured: FrequencyResponse, over: Over
) -> tuple[SteadyPrediction, FrequencyResponse | None, PredictionError | None]:
    """At the level that was held, where the model can hold it, else at the force that each point had."""
    held = _held(model, exciter, None)
    low, high = (
        (1.0 - _MARGIN) * float(measured.frequency_hz.min()),
        (1.0 + _MARGIN) * float(measured.frequency_hz.max()),
    )
    if measured.controlled == "force":
        predicted = pnlss_frequency_response(
            model, measured.level, force=held, exciter=exciter, lowest_hz=low, highest_hz=high
        )
    elif measured.controlled == "voltage" and held == "fundamental":
        predicted = pnlss_frequency_response(
            model, measured.level, force="voltage", exciter=exciter, lowest_hz=low, highest_hz=high
        )
    else:
        predicted = _point_by_point(model, exciter, held, measured)
        over = "frequency"
    return predicted, measured, compare(predicted, measured, over=over).error


def _point_by_point(
    model: PnlssModel, exciter: Exciter | None, held: Held, measured: FrequencyResponse
) -> SteadyPrediction:
    """The vibration at each point's own force; where several are found, the one whose amplitude is nearest to the measured.

    Tried are the one that rest leads to, and the one next to that of the point before. Points without any are left out.
    """
    states: list[SteadyStates] = []
    near: SteadyStates | None = None
    for frequency, force, amplitude in zip(
        measured.frequency_hz.tolist(), np.abs(measured.force).tolist(), measured.amplitude_m.tolist(), strict=True
    ):
        tried: list[SteadyStates] = []
        for start in (near, None) if near is not None else (None,):
            try:
                tried.append(pnlss_steady_state(model, force, frequency, force=held, exciter=exciter, near=start))
            except IdentificationError:
                continue
        if tried:
            near = min(tried, key=lambda one: abs(abs(complex(one.displacement_m[0, 1, 0])) - amplitude))
            states.append(near)
    if not states:
        raise IdentificationError(
            f"reference '{measured.label}': the model has no periodic vibration at any of its points"
        )
    missing = measured.frequency_hz.size - len(states)
    notes = (f"at {missing} of {measured.frequency_hz.size} points no vibration was found",) if missing else ()
    none = np.zeros(0)
    return SteadyPrediction(
        force_n=float(np.median(np.abs(measured.force))),
        force="recorded",
        channels=states[0].channels,
        frequency_hz=np.concatenate([one.frequency_hz for one in states]),
        modal_amplitude=np.full(len(states), np.nan),
        fundamental_n=np.concatenate([np.abs(one.force_n[:, 1]) for one in states]),
        displacement_m=np.concatenate([one.displacement_m[:, 1] for one in states]),
        stable=np.concatenate([one.stable for one in states]),
        branch=np.zeros(len(states), dtype=np.int64),
        range_use=np.concatenate([np.asarray(one.range_use) for one in states]),
        fold_frequency_hz=none,
        fold_amplitude_m=none,
        fold_modal_amplitude=none,
        notes=notes,
    )


def _multisine(path: Path, identified: IdentifiedPnlss) -> Iterator[SimulatedRun]:
    """Every realisation of a recording, simulated, and what it was to the model, as far as its name says."""
    model = identified.model
    with Recording(path) as recording:
        if recording.kind != "multisine":
            raise RecordingError(f"{path}: holds a {recording.kind}, wanted is a multisine recording")
        found = experiments(
            recording,
            inputs=[channel.name for channel in model.inputs],
            outputs=[channel.name for channel in model.outputs],
            rate_hz=model.sample_rate_hz,
        )
    uses = {run.name: run.use for run in identified.runs}
    for one in found:
        yield replace(simulated_run(model, one), use=uses.get(one.name, "test"))


def _strangers(model: PnlssModel, references: Sequence[FrequencyResponse]) -> list[str]:
    """References of another specimen."""
    others = {one.specimen for one in references} - {"", model.specimen}
    return [f"the model is of {model.specimen}, a reference of {one}: not the same specimen" for one in sorted(others)]

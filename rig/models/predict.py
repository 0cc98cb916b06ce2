"""From models to predictions, beside the recordings they are compared with."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast, get_args

from identification import (
    Exciter,
    FrequencyResponse,
    HalfPeriods,
    LinearModes,
    NonlinearMode,
    PredictionError,
    Predictions,
    SteadyPrediction,
    SweepPrediction,
    Transient,
    compare,
    compare_sweep,
    frequency_response,
    predict_sweep,
    recorded_force_response,
    zero_crossings,
)
from identification.prediction.frequency_response import HeldForce
from rig.errors import ConfigurationError, RecordingError
from rig.measurements import bench_of_recording, frequency_responses, point_rows, sweeps
from rig.models.exciter import EXCITER
from rig.models.files import load_as
from rig.models.frequency_responses import FREQUENCY_RESPONSES
from rig.models.identify import modes_in
from rig.models.nonlinear_mode import NONLINEAR_MODE
from rig.recording.arrays import kind_of
from rig.recording.reader import Recording

__all__ = ["PredictionRequest", "predict_vibrations"]


_Compared = tuple[SteadyPrediction, FrequencyResponse | None, PredictionError | None]


@dataclass(frozen=True, kw_only=True)
class PredictionRequest:
    """What is to be predicted, with what."""

    forces_n: tuple[float, ...] = ()
    """Constant forces of frequency responses."""
    held: str = "fundamental"
    """What of the force is constant: ``fundamental``, ``rms`` or ``pure-sine``."""
    sweeps: tuple[Path, ...] = ()
    """Recordings whose sweeps are predicted."""
    zero_crossings: bool = False
    """Whether an imposed force is read from its zero crossings, the founding paper's way, or demodulated."""
    exciter: Path | None = None
    """Exciter model: sweeps are predicted from the recorded voltage, else from the recorded force."""
    modes: Path | None = None
    """Linear model: the other modes take part, responses of the other sensors are predicted."""
    references: tuple[Path, ...] = ()
    """Stepped sines that are predicted at their own force and compared."""
    allow_extrapolation: bool = False
    """Whether to answer beyond twice the largest modal amplitude identified."""

    def __post_init__(self) -> None:
        if not (self.forces_n or self.sweeps or self.references):
            raise ConfigurationError("nothing to predict: give --frequency-response, --sweep or --reference")
        if self.held not in get_args(HeldForce):
            raise ConfigurationError(f"--force = {self.held!r}: allowed are {', '.join(get_args(HeldForce))}")
        if self.exciter is not None and self.zero_crossings:
            raise ConfigurationError(
                "--zero-crossings: are those of an imposed force; with --exciter the voltage is imposed"
            )
        if self.exciter is not None and not self.sweeps:
            raise ConfigurationError("--exciter: is for sweeps, and none is given; add --sweep, or leave it out")


def predict_vibrations(model: Path, request: PredictionRequest) -> Predictions:
    """Predictions of a nonlinear-mode model, and their errors where there is something to compare with.

    Raises `RecordingError` for files that hold something else, `identification.IdentificationError` where the model cannot
    answer, in particular beyond twice the largest amplitude that it was identified with.
    """
    mode = cast(NonlinearMode, load_as(NONLINEAR_MODE, model))
    modes = None if request.modes is None else modes_in(request.modes)
    exciter = None if request.exciter is None else cast(Exciter, load_as(EXCITER, request.exciter))
    steady: list[_Compared] = [(_steady(mode, force, modes, request), None, None) for force in request.forces_n]
    for path in request.references:
        steady += [_compared(mode, measured, modes, request) for measured in _stepped_sines(path)]
    swept = [found for path in request.sweeps for found in _sweeps(path, mode, modes, exciter, request)]
    return Predictions(
        steady=tuple(item[0] for item in steady),
        steady_references=tuple(item[1] for item in steady),
        steady_errors=tuple(item[2] for item in steady),
        sweeps=tuple(item[0] for item in swept),
        sweep_references=tuple(item[1] for item in swept),
        sweep_errors=tuple(item[2] for item in swept),
        specimen=mode.specimen,
    )


def _steady(
    mode: NonlinearMode, force_n: float, modes: LinearModes | None, request: PredictionRequest
) -> SteadyPrediction:
    held = cast(HeldForce, request.held)
    return frequency_response(mode, force_n, force=held, modes=modes, allow_extrapolation=request.allow_extrapolation)


def _compared(
    mode: NonlinearMode, measured: FrequencyResponse, modes: LinearModes | None, request: PredictionRequest
) -> _Compared:
    """At constant force where the force was controlled, else at the force that each point had."""
    if measured.controlled == "force":
        predicted = _steady(mode, measured.level, modes, replace(request, held="fundamental"))
    else:
        predicted = recorded_force_response(
            mode, measured, modes=modes, allow_extrapolation=request.allow_extrapolation
        )
    return predicted, measured, compare(predicted, measured).error


def _stepped_sines(path: Path) -> Sequence[FrequencyResponse]:
    kind = kind_of(path)
    if kind == FREQUENCY_RESPONSES.name:
        return cast(tuple[FrequencyResponse, ...], load_as(FREQUENCY_RESPONSES, path))
    if kind != "stepped-sine":
        raise RecordingError(
            f"{path}: holds a {kind}; a reference is a stepped-sine recording or imported stepped sines"
        )
    with Recording(path) as recording:
        return frequency_responses(recording)


def _sweeps(
    path: Path, mode: NonlinearMode, modes: LinearModes | None, exciter: Exciter | None, request: PredictionRequest
) -> list[tuple[SweepPrediction, Transient, PredictionError]]:
    out = []
    with Recording(path) as recording:
        if recording.kind != "sweep":
            raise RecordingError(f"{path}: holds a {recording.kind}, wanted is a sweep recording")
        recorded = sweeps(recording)
        for number, sweep in recorded.items():
            name = path.stem if len(recorded) == 1 else f"{path.stem} [{number}]"
            given = _half_periods(recording, number) if request.zero_crossings else sweep
            predicted = predict_sweep(
                mode, given, exciter=exciter, modes=modes, allow_extrapolation=request.allow_extrapolation
            )
            out.append((predicted, _force_and_drive(sweep), compare_sweep(predicted, sweep, name=name)))
    return out


def _half_periods(recording: Recording, number: int) -> HalfPeriods:
    """The force of a recorded sweep between its zero crossings."""
    bench = bench_of_recording(recording)
    column = next(index for index, channel in enumerate(bench.channels) if channel.role == "force")
    force = point_rows(recording, number)["inputs"][:, column].astype(float)
    return zero_crossings(force, sample_rate_hz=bench.sample_rate_hz)


def _force_and_drive(sweep: Transient) -> Transient:
    """What a comparison shows of a sweep."""
    rows = [row for row, channel in enumerate(sweep.channels) if channel.role in ("force", "drive")]
    return replace(sweep, channels=tuple(sweep.channels[row] for row in rows), fundamentals=sweep.fundamentals[rows])

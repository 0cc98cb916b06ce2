"""Measured responses with which predictions are compared."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from identification import (
    FrequencyResponse,
    PredictionError,
    Predictions,
    ResponseBand,
    SimulatedRun,
    SteadyPrediction,
    SweepPrediction,
    Transient,
)
from identification.prediction import Over
from rig.campaigns.evaluation.point import spectrum_of, vibration_of
from rig.campaigns.evaluation.recorded import points_of
from rig.errors import RecordingError
from rig.measurements import STEPPED, frequency_responses
from rig.recording.arrays import kind_of
from rig.recording.reader import Recording
from rig.results.files import load_as


class Compared(NamedTuple):
    """A steady prediction, with its reference, error and band as far as there are some."""

    prediction: SteadyPrediction
    reference: FrequencyResponse | None = None
    error: PredictionError | None = None
    band: ResponseBand | None = None


class Swept(NamedTuple):
    """A predicted sweep, with force and drive-point motion as recorded and the error where it was, and remarks on both."""

    prediction: SweepPrediction
    recorded: Transient | None = None
    error: PredictionError | None = None
    notes: tuple[str, ...] = ()


def predictions_of(
    specimen: str,
    steady: Sequence[Compared],
    swept: Sequence[Swept] = (),
    runs: tuple[SimulatedRun, ...] = (),
    notes: Iterable[str] = (),
) -> Predictions:
    """Return all predictions of one model; notes are given once each."""
    return Predictions(
        steady=tuple(one.prediction for one in steady),
        steady_references=tuple(one.reference for one in steady),
        steady_errors=tuple(one.error for one in steady),
        steady_bands=tuple(one.band for one in steady),
        sweeps=tuple(one.prediction for one in swept),
        sweep_references=tuple(one.recorded for one in swept),
        sweep_errors=tuple(one.error for one in swept),
        runs=runs,
        specimen=specimen,
        notes=tuple(dict.fromkeys([*notes, *(note for one in swept for note in one.notes)])),
    )


def other_specimens(specimen: str, references: Iterable[FrequencyResponse]) -> list[str]:
    """Return a note on each specimen of the references other than the model's."""
    others = {one.specimen for one in references} - {"", specimen}
    return [f"the model is of {specimen}, a reference of {other}: not the same specimen" for other in sorted(others)]


@dataclass(frozen=True, eq=False)
class Reference:
    """A measured response and how it is compared."""

    measured: FrequencyResponse
    """The measured response."""
    over: Over
    """Quantity over which it is compared."""
    over_asked: bool = False
    """Whether the user asked for that quantity."""
    second_harmonic: float | None = None
    """Second harmonic of the force over its fundamental at the largest response; None if unknown."""


def over_of(measured: FrequencyResponse, asked: Over | None) -> Over:
    """Return the quantity over which a reference is compared."""
    steps = np.diff(measured.frequency_hz)  # where these change sign, the phase alone tells vibrations apart
    return asked or ("phase" if (steps > 0.0).any() and (steps < 0.0).any() else "frequency")


def references_in(path: Path, asked: Over | None) -> list[Reference]:
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
    for measured in stepped_sines(path):
        top = float(measured.frequency_hz[int(np.argmax(measured.amplitude_m))])
        over = over_of(measured, asked)
        found.append(Reference(measured, over, asked is not None, ratios.get((measured.level, top))))
    return found


def stepped_sines(path: Path) -> Sequence[FrequencyResponse]:
    """Return the levels of a stepped-sine recording, or of imported stepped sines."""
    kind = kind_of(path)
    if kind == "frequency-responses":
        return load_as(tuple, path)
    if kind not in STEPPED:
        raise RecordingError(
            f"{path}: is a file of kind {kind}; a reference is a stepped-sine recording or imported stepped sines"
        )
    with Recording(path) as recording:
        return frequency_responses(recording)

"""Recordings as measurements in memory, the form that `identification` takes."""

from pathlib import Path
from typing import Any, cast

from identification import (
    Backbone,
    ContinuousBackbone,
    ForceSurface,
    FrequencyResponse,
    FrequencyResponseMatrix,
    PeriodicSpectra,
    Transient,
)
from identification import force_surface as surface_of
from identification.multisine.best_linear_approximation import Estimator
from rig.campaigns.dwell.points import DwellCourse
from rig.campaigns.evaluation.recorded import bench_of_recording, point_rows
from rig.campaigns.kinds import KINDS, kinds_that_yield
from rig.errors import RecordingError
from rig.recording.reader import Recording

__all__ = [
    "STEPPED",
    "Estimator",
    "backbone",
    "bench_of_recording",
    "continuous_backbones",
    "dwell_course",
    "force_surface",
    "frequency_responses",
    "load_backbone",
    "point_rows",
    "response_matrices",
    "spectra",
    "sweeps",
]

STEPPED = kinds_that_yield(FrequencyResponse)
"""Kinds of recordings that hold frequency responses, one per level."""


def backbone(recording: Recording) -> Backbone:
    """The accepted points of a backbone recording that its plan asks for, in the order of the plan.

    Of a continuous backbone the means of up and down, which know nothing of what lay between the two (`continuous_backbones`).

    Raises `RecordingError` for a recording of another kind, `identification.IdentificationError` without any point.
    """
    return cast(Backbone, _measured(recording, Backbone))


def continuous_backbones(recording: Recording) -> tuple[ContinuousBackbone, ...]:
    """The accepted points of a continuous backbone, one per repeat, with what was found on the way up and on the way down.

    Raises `RecordingError` for a recording of another kind, `identification.IdentificationError` without any point.
    """
    return cast(tuple[ContinuousBackbone, ...], _measured(recording, ContinuousBackbone))


def frequency_responses(recording: Recording) -> tuple[FrequencyResponse, ...]:
    """The accepted points of a stepped-sine, stepped-phase or response-controlled recording: fundamentals of force and drive.

    One response per level and pass, in the order of measurement, which for stepped phase is that along the branch. Raises
    `RecordingError` for a recording of another kind, `identification.IdentificationError` without any point.
    """
    return cast(tuple[FrequencyResponse, ...], _measured(recording, FrequencyResponse))


def dwell_course(recording: Recording) -> DwellCourse:
    """Frequency, damping, amplitude and force of every accepted mean of a dwell, over cycles and time.

    Raises `RecordingError` for a recording of another kind, `identification.IdentificationError` without any mean.
    """
    return cast(DwellCourse, _measured(recording, DwellCourse))


def force_surface(recording: Recording) -> ForceSurface:
    """The force over frequency and displacement, from the levels of a response-controlled or stepped-sine recording.

    Raises `RecordingError` for a recording of another kind, `identification.IdentificationError` for levels other
    than held displacements, and for fewer than three.
    """
    return surface_of(frequency_responses(recording))


def sweeps(recording: Recording) -> dict[int, Transient]:
    """Fundamentals over time of every accepted sweep, by the stored number of its point, which counts from 0.

    The output is channel ``voltage``.

    Raises `RecordingError` for a recording of another kind, `identification.IdentificationError` without any sweep.
    """
    return cast(dict[int, Transient], _measured(recording, Transient))


def spectra(recording: Recording) -> dict[float, PeriodicSpectra]:
    """Spectra of every accepted realisation, by level (V RMS); the output is channel ``voltage``.

    Raises `RecordingError` for a recording of another kind, `identification.IdentificationError` without any realisation.
    """
    return cast(dict[float, PeriodicSpectra], _measured(recording, PeriodicSpectra))


def response_matrices(
    recording: Recording, *, estimator: Estimator = "instrument"
) -> dict[float, FrequencyResponseMatrix]:
    """Frequency responses from the force to every motion, by level (V RMS), with their covariance.

    Raises `RecordingError` for a recording of another kind, `identification.IdentificationError` without any realisation.
    """
    found = _measured(recording, FrequencyResponseMatrix, estimator=estimator)
    return cast(dict[float, FrequencyResponseMatrix], found)


def load_backbone(path: Path) -> Backbone:
    """`backbone` of a file."""
    with Recording(path) as recording:
        return backbone(recording)


def _measured(recording: Recording, measurement: type, **options: Any) -> Any:
    campaign = KINDS.get(recording.kind)
    if campaign is None or measurement not in campaign.measurements:
        wanted = " or a ".join(kinds_that_yield(measurement))
        raise RecordingError(f"the recording is a {recording.kind}, wanted is a {wanted}")
    return campaign.measurements[measurement](recording, **options)

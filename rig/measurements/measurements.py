"""Recordings as measurements in memory, the form that `identification` takes."""

from pathlib import Path
from typing import Any

import numpy as np

from identification import (
    Backbone,
    ContinuousBackbone,
    ForceSurface,
    FrequencyResponse,
    FrequencyResponseMatrix,
    IdentificationError,
    PeriodicSpectra,
    Transient,
    best_linear_approximation,
)
from identification import force_surface as surface_of
from identification.multisine.best_linear_approximation import Estimator
from rig.bench import Bench
from rig.bench.configuration import validated
from rig.campaigns.backbone.plan import BackbonePlan
from rig.campaigns.backbone.points import backbone_of
from rig.campaigns.continuous_backbone.points import continuous_backbones_of
from rig.campaigns.multisine.plan import MultisinePlan
from rig.campaigns.multisine.points import spectra_of
from rig.campaigns.stepped_sine.points import frequency_responses_of
from rig.campaigns.sweep.points import transient_of
from rig.errors import RecordingError
from rig.recording.reader import Recording

__all__ = [
    "STEPPED",
    "Estimator",
    "backbone",
    "bench_of_recording",
    "continuous_backbones",
    "force_surface",
    "frequency_responses",
    "load_backbone",
    "point_rows",
    "response_matrices",
    "spectra",
    "sweeps",
]

STEPPED = ("stepped-sine", "stepped-phase", "response-controlled")
"""Kinds of recordings that hold frequency responses, one per level."""


def backbone(recording: Recording) -> Backbone:
    """The accepted points of a backbone recording that its plan asks for, in the order of the plan.

    Of a continuous backbone the means of up and down, which know nothing of what lay between the two (`continuous_backbones`).

    Raises `RecordingError` for a recording of another kind, `identification.IdentificationError` without any point.
    """
    if recording.kind == "continuous-backbone":
        passes = continuous_backbones(recording)
        points = [point for one in passes for point in one.backbone.points]
        repeats = [number for number, one in enumerate(passes, 1) for _ in one.backbone.points]
        first = passes[0].backbone
        return Backbone(tuple(points), first.specimen, first.drive_mode_shape, repeats=tuple(repeats))
    _expect(recording, "backbone")
    bench = bench_of_recording(recording)
    plan = validated(BackbonePlan, recording.configuration["plan"], "plan of the recording")
    return backbone_of(
        recording.latest.values(),
        recording.channels,
        bench.specimen.name,
        bench.specimen.drive_mode_shape,
        plan.controller.phase_lag_deg + 180.0,
    )


def continuous_backbones(recording: Recording) -> tuple[ContinuousBackbone, ...]:
    """The accepted points of a continuous backbone, one per repeat, with what was found on the way up and on the way down.

    Raises `RecordingError` for a recording of another kind, `identification.IdentificationError` without any point.
    """
    _expect(recording, "continuous-backbone")
    specimen = bench_of_recording(recording).specimen
    return continuous_backbones_of(
        recording.latest.values(), recording.channels, specimen.name, specimen.drive_mode_shape
    )


def frequency_responses(recording: Recording) -> tuple[FrequencyResponse, ...]:
    """The accepted points of a stepped-sine, stepped-phase or response-controlled recording: fundamentals of force and drive.

    One response per level and pass, in the order of measurement, which for stepped phase is that along the branch. Raises
    `RecordingError` for a recording of another kind, `identification.IdentificationError` without any point.
    """
    _expect(recording, *STEPPED)
    return frequency_responses_of(
        recording.latest.values(), recording.channels, bench_of_recording(recording).specimen.name
    )


def force_surface(recording: Recording) -> ForceSurface:
    """The force over frequency and displacement, from the levels of a response-controlled or stepped-sine recording.

    Raises `RecordingError` for a recording of another kind, `identification.IdentificationError` for levels other
    than held displacements, and for fewer than three.
    """
    return surface_of(frequency_responses(recording))


def sweeps(recording: Recording) -> dict[int, Transient]:
    """Fundamentals over time of every accepted sweep, by the number of its point; the output is channel ``voltage``.

    Raises `RecordingError` for a recording of another kind, `identification.IdentificationError` without any sweep.
    """
    _expect(recording, "sweep")
    bench = bench_of_recording(recording)
    return {number: transient_of(bench, point_rows(recording, number)) for number in _accepted(recording)}


def spectra(recording: Recording) -> dict[float, PeriodicSpectra]:
    """Spectra of every accepted realisation, by level (V RMS); the output is channel ``voltage``.

    Raises `RecordingError` for a recording of another kind, `identification.IdentificationError` without any realisation.
    """
    _expect(recording, "multisine")
    bench = bench_of_recording(recording)
    plan = validated(MultisinePlan, recording.configuration["plan"], "plan of the recording")
    levels: dict[float, dict[int, np.ndarray]] = {}
    periods: dict[float, int] = {}
    for number, point in _accepted(recording).items():
        level = point["level"]
        levels.setdefault(level, {})[point["realisation"]] = point_rows(recording, number)
        periods[level] = min(periods.get(level, point["periods"]), point["periods"])  # a change of plan may change them
    return {
        level: spectra_of(bench, plan.model_copy(update={"periods": periods[level]}), records)
        for level, records in levels.items()
    }


def response_matrices(
    recording: Recording, *, estimator: Estimator = "instrument"
) -> dict[float, FrequencyResponseMatrix]:
    """Frequency responses from the force to every motion, by level (V RMS), with their covariance.

    Raises `RecordingError` for a recording of another kind, `identification.IdentificationError` without any realisation.
    """
    specimen = bench_of_recording(recording).specimen.name
    return {
        level: best_linear_approximation(measured, estimator=estimator, specimen=specimen)
        for level, measured in spectra(recording).items()
    }


def point_rows(recording: Recording, number: int) -> np.ndarray:
    """All recorded rows of a point: structured array, inputs in SI units (`rig.tick.layout.recorded_row`).

    Raises `RecordingError` where there is no such point or nothing was recorded of it.
    """
    for part in reversed(recording.parts):
        for point in part.points:
            if point["number"] == number and "end_sample" in point:
                return part.read(point["first_sample"], point["end_sample"])
    known = {**recording.latest, **recording.former}
    raise RecordingError(f"point {number}: nothing was recorded of it; points {sorted(known)} are known")


def load_backbone(path: Path) -> Backbone:
    """`backbone` of a file."""
    with Recording(path) as recording:
        return backbone(recording)


def _expect(recording: Recording, *kinds: str) -> None:
    if recording.kind not in kinds:
        raise RecordingError(f"the recording is a {recording.kind}, wanted is a {' or a '.join(kinds)}")


def bench_of_recording(recording: Recording) -> Bench:
    """The bench as it was."""
    return validated(Bench, recording.configuration["bench"], "bench of the recording")


def _accepted(recording: Recording) -> dict[int, dict[str, Any]]:
    """The accepted points that the plan in force asks for, by number, in its order."""
    accepted = {number: point for number, point in recording.latest.items() if point["accepted"]}
    if not accepted:
        raise IdentificationError("points: none of the recording was accepted")
    return accepted

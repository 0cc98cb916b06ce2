"""Recordings as measurements in memory, the form that `identification` takes."""

from pathlib import Path
from typing import Any

from identification import Backbone, FrequencyResponse
from rig.bench import Bench
from rig.campaigns.backbone import BackbonePlan
from rig.campaigns.backbone_points import backbone_of
from rig.campaigns.stepped_sine_points import frequency_responses_of
from rig.configuration import validated
from rig.errors import RecordingError
from rig.recording.reader import Recording

__all__ = ["backbone", "frequency_responses", "load_backbone"]


def backbone(recording: Recording) -> Backbone:
    """The accepted points of a backbone recording, in the order of the plan.

    Raises `RecordingError` for a recording of another kind, `identification.IdentificationError` without any point.
    """
    _expect(recording, "backbone")
    bench = _bench(recording)
    plan = validated(BackbonePlan, recording.configuration["plan"], "plan of the recording")
    return backbone_of(
        _latest_points(recording),
        recording.channels,
        bench.specimen.name,
        bench.specimen.drive_mode_shape,
        plan.controller.phase_lag_deg + 180.0,
    )


def frequency_responses(recording: Recording) -> tuple[FrequencyResponse, ...]:
    """The accepted points of a stepped-sine recording: the fundamentals of force and drive, one response per level.

    Raises `RecordingError` for a recording of another kind, `identification.IdentificationError` without any point.
    """
    _expect(recording, "stepped-sine")
    return frequency_responses_of(_latest_points(recording), recording.channels, _bench(recording).specimen.name)


def load_backbone(path: Path) -> Backbone:
    """`backbone` of a file."""
    with Recording(path) as recording:
        return backbone(recording)


def _expect(recording: Recording, kind: str) -> None:
    if recording.kind != kind:
        raise RecordingError(f"the recording is a {recording.kind}, wanted is a {kind}")


def _bench(recording: Recording) -> Bench:
    return validated(Bench, recording.configuration["bench"], "bench of the recording")


def _latest_points(recording: Recording) -> list[dict[str, Any]]:
    """The last result of each point, by number."""
    latest = {point["number"]: point for point in recording.points}
    return [latest[number] for number in sorted(latest)]

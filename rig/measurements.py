"""Recordings as measurements in memory, the form that `identification` takes."""

from pathlib import Path

from identification import Backbone
from rig.bench import Bench
from rig.campaigns.backbone import BackbonePlan
from rig.campaigns.backbone_points import backbone_of
from rig.configuration import validated
from rig.errors import RecordingError
from rig.recording.reader import Recording

__all__ = ["backbone", "load_backbone"]


def backbone(recording: Recording) -> Backbone:
    """The accepted points of a backbone recording, in the order of the plan.

    Raises `RecordingError` for a recording of another kind, `identification.IdentificationError` without any point.
    """
    if recording.kind != "backbone":
        raise RecordingError(f"the recording is a {recording.kind}, wanted is a backbone")
    bench = validated(Bench, recording.configuration["bench"], "bench of the recording")
    plan = validated(BackbonePlan, recording.configuration["plan"], "plan of the recording")
    latest = {point["number"]: point for point in recording.points}
    return backbone_of(
        [latest[number] for number in sorted(latest)],
        recording.channels,
        bench.specimen.name,
        bench.specimen.drive_mode_shape,
        plan.controller.phase_lag_deg + 180.0,
    )


def load_backbone(path: Path) -> Backbone:
    """`backbone` of a file."""
    with Recording(path) as recording:
        return backbone(recording)

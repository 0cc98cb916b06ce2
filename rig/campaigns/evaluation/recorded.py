"""Read a recording as objects: its bench, its points, and the rows of a point."""

from collections.abc import Sequence
from typing import Any, TypeVar, overload

import numpy as np

from identification import Backbone, IdentificationError
from rig.bench import Bench
from rig.bench.configuration import validated
from rig.campaigns.evaluation.drift import without_repetition
from rig.campaigns.evaluation.point import Point, point_name
from rig.campaigns.evaluation.stored_point import point_from
from rig.campaigns.evaluation.vibrations import channels_from, vibration_from
from rig.campaigns.planning.drive_shape import DriveShape, drive_shape
from rig.campaigns.planning.plant import PlantFacts
from rig.errors import RecordingError
from rig.recording.reader import Recording

Result = TypeVar("Result")


def bench_of_recording(recording: Recording) -> Bench:
    """Return the bench as it was recorded."""
    return validated(Bench, recording.configuration["bench"], "bench of the recording")


def specimen_of(recording: Recording) -> str:
    """Return the name of the specimen."""
    return str(recording.configuration["bench"]["specimen"]["name"])


def recorded_drive_shape(recording: Recording, points: Sequence[Point[object]]) -> DriveShape:
    """Return the mode shape that a model of these points takes: that of the current plan's ``[plant]``, else the bench's.

    Points of a resumed recording may have been evaluated with that of an earlier plan. Their vibrations do not depend on it, so
    that a model takes the current one for all. In files of versions that evaluated with the bench's fact alone no point names
    another mode shape; the bench's is used for them, as it was then.
    """
    table = recording.configuration["plan"].get("plant")
    named = any(point.modal is not None and point.modal.drive_mode_shape is not None for point in points)
    plant = validated(PlantFacts, table, "plant of the recording") if table and named else None
    return drive_shape(bench_of_recording(recording), plant)


@overload
def points_of(recording: Recording) -> list[Point[object]]: ...
@overload
def points_of(recording: Recording, result: type[Result]) -> list[Point[Result]]: ...


def points_of(recording: Recording, result: type[object] | None = None) -> list[Any]:
    """Return the last result of each point of the current plan, in the order of the plan.

    ``result`` is the class of the results that only this kind of campaign has. Without it, the points hold only what all kinds
    have.
    """
    return [point_from(table) if result is None else point_from(table, result) for table in recording.latest.values()]


def accepted_points(recording: Recording, result: type[Result]) -> list[Point[Result]]:
    """Return the accepted points among those of `points_of`; raise `IdentificationError` if there are none."""
    accepted = [point for point in points_of(recording, result) if point.accepted]
    IdentificationError.raise_if(not accepted, "none of the recording was accepted", field="points")
    return accepted


def settled_backbone(recording: Recording, phase_lag_target_deg: float) -> Backbone:
    """Return the accepted points of the current plan as a backbone, in the order of the plan.

    Raises `IdentificationError` if no point was accepted.
    """
    accepted = [point for point in without_repetition(points_of(recording)) if point.accepted]
    IdentificationError.raise_if(not accepted, "none of the recording was accepted", field="points")
    return backbone_of(recording, accepted, phase_lag_target_deg)


def backbone_of(recording: Recording, points: Sequence[Point[object]], phase_lag_target_deg: float = 90.0) -> Backbone:
    """Return some points of a recording as a backbone, in their order."""
    channels, shape = channels_from(recording.channels), recorded_drive_shape(recording, points_of(recording))
    vibrations = tuple(vibration_from(point, channels, phase_lag_target_deg) for point in points)
    return shape.backbone(vibrations, [point.direction for point in points], [point.repeat for point in points])


def point_rows(recording: Recording, number: int) -> np.ndarray:
    """Return all recorded rows of a point.

    The rows are a structured array with the inputs in SI units (`rig.tick.layout.recorded_row`). Raises `RecordingError` if
    there is no such point or nothing was recorded of it; the message counts points from 1.

    Parameters
    ----------
    recording
        The recording.
    number
        Stored number of the point, which counts from 0.
    """
    for part in reversed(recording.parts):
        for table in part.points:
            if table["number"] == number and "end_sample" in table:
                return part.read(table["first_sample"], table["end_sample"])
    known = ", ".join(str(n + 1) for n in sorted({**recording.latest, **recording.former}))
    raise RecordingError(f"{point_name(number)}: nothing was recorded of it; points {known} are known")

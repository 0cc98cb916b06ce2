"""What a recording holds, as the program knows it: its bench, its plan, the rows of a point, the accepted points."""

from typing import Any

import numpy as np

from identification import IdentificationError
from rig.bench import Bench
from rig.bench.configuration import validated
from rig.errors import RecordingError
from rig.recording.reader import Recording

__all__ = ["accepted_points", "bench_of_recording", "point_rows", "specimen_of"]


def bench_of_recording(recording: Recording) -> Bench:
    """The bench as it was."""
    return validated(Bench, recording.configuration["bench"], "bench of the recording")


def specimen_of(recording: Recording) -> str:
    """Name of the specimen."""
    return str(recording.configuration["bench"]["specimen"]["name"])


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


def accepted_points(recording: Recording) -> dict[int, dict[str, Any]]:
    """The accepted points that the plan in force asks for, by number, in its order; `IdentificationError` without any."""
    accepted = {number: point for number, point in recording.latest.items() if point["accepted"]}
    if not accepted:
        raise IdentificationError("points: none of the recording was accepted")
    return accepted

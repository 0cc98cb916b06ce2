"""Measurements in files, recorded or imported, that several kinds of models are identified from."""

from collections.abc import Sequence
from pathlib import Path

from identification import FrequencyResponse, LinearModes, ModalAnalysis
from rig.errors import RecordingError
from rig.measurements import STEPPED, frequency_responses
from rig.measurements.points_left_out import points_left_out
from rig.recording.arrays import kind_of
from rig.recording.reader import Recording
from rig.results.files import load_as


def modes_in(path: Path) -> LinearModes:
    """Load the linear modes from the file of a modal analysis."""
    return load_as(ModalAnalysis, path).modes


def stepped_sines(paths: Sequence[Path]) -> tuple[list[FrequencyResponse], tuple[str, ...]]:
    """Return stepped sines, recorded or imported, and notes on planned points that are missing."""
    measured: list[FrequencyResponse] = []
    notes: tuple[str, ...] = ()
    for path in paths:
        kind = kind_of(path)
        if kind == "frequency-responses":
            measured += load_as(tuple, path)
        elif kind in STEPPED:
            with Recording(path) as recording:
                measured += frequency_responses(recording)
                notes += points_left_out(recording)
        else:
            raise RecordingError(
                f"{path}: holds a {kind}; a force surface comes from response-controlled or stepped sines"
            )
    return measured, notes

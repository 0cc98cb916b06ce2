"""From recordings to models."""

from pathlib import Path

from identification import NonlinearMode, nonlinear_mode, stepped_sine_mode
from rig.errors import RecordingError
from rig.measurements import load_backbone
from rig.models.files import load
from rig.models.frequency_responses import FREQUENCY_RESPONSES
from rig.recording.arrays import kind_of

__all__ = ["identify_nonlinear_mode"]


def identify_nonlinear_mode(path: Path) -> NonlinearMode:
    """The nonlinear mode in a backbone recording or in imported stepped-sine responses.

    Raises `RecordingError` for any other file, `identification.IdentificationError` where the data does not allow it.
    """
    kind = kind_of(path)
    if kind == "backbone":
        return nonlinear_mode(load_backbone(path))
    if kind == FREQUENCY_RESPONSES.name:
        return stepped_sine_mode(load(path))
    raise RecordingError(f"{path}: holds a {kind}; a nonlinear mode comes from a backbone or frequency-responses file")

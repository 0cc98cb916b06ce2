"""Models and imported measurements in files: written whole, read back as what they were."""

from collections.abc import Sequence
from pathlib import Path

from identification import (
    FrequencyResponse,
    NonlinearMode,
    nonlinear_mode,
    pack_frequency_responses,
    stepped_sine_mode,
    unpack_frequency_responses,
)
from rig.errors import RecordingError
from rig.measurements import load_backbone
from rig.recording.arrays import kind_of, read_arrays, write_arrays

__all__ = [
    "FREQUENCY_RESPONSES",
    "NONLINEAR_MODE",
    "identify_nonlinear_mode",
    "load_frequency_responses",
    "load_model",
    "save_frequency_responses",
    "save_model",
]

NONLINEAR_MODE = "nonlinear-mode"
FREQUENCY_RESPONSES = "frequency-responses"


def save_model(model: NonlinearMode, path: Path) -> None:
    """Write a nonlinear-mode model."""
    arrays, attributes = model.to_arrays()
    write_arrays(path, NONLINEAR_MODE, arrays, attributes)


def load_model(path: Path) -> NonlinearMode:
    """Read a nonlinear-mode model; `RecordingError` where the file holds something else."""
    _, arrays, attributes = read_arrays(_of_kind(path, NONLINEAR_MODE))
    return NonlinearMode.from_arrays(arrays, attributes)


def save_frequency_responses(responses: Sequence[FrequencyResponse], path: Path) -> None:
    """Write stepped-sine measurements."""
    arrays, attributes = pack_frequency_responses(responses)
    write_arrays(path, FREQUENCY_RESPONSES, arrays, attributes)


def load_frequency_responses(path: Path) -> tuple[FrequencyResponse, ...]:
    """Read stepped-sine measurements; `RecordingError` where the file holds something else."""
    _, arrays, attributes = read_arrays(_of_kind(path, FREQUENCY_RESPONSES))
    return unpack_frequency_responses(arrays, attributes)


def identify_nonlinear_mode(path: Path) -> NonlinearMode:
    """The nonlinear mode in a backbone recording or in imported stepped-sine responses.

    Raises `RecordingError` for any other file, `identification.IdentificationError` where the data does not allow it.
    """
    kind = kind_of(path)
    if kind == "backbone":
        return nonlinear_mode(load_backbone(path))
    if kind == FREQUENCY_RESPONSES:
        return stepped_sine_mode(load_frequency_responses(path))
    raise RecordingError(f"{path}: holds a {kind}; a nonlinear mode comes from a backbone or frequency-responses file")


def _of_kind(path: Path, wanted: str) -> Path:
    kind = kind_of(path)
    if kind != wanted:
        raise RecordingError(f"{path}: holds a {kind}, wanted is a {wanted} file")
    return path

"""Imported objects in files of ours."""

from pathlib import Path
from typing import Any

from identification import Backbone, LinearModes, ModalAnalysis
from rig.errors import RecordingError
from rig.exchange.measured_backbone import MEASURED_BACKBONE
from rig.models import files
from rig.recording.arrays import kind_of, read_arrays, write_arrays

__all__ = ["load", "save"]


def save(thing: Any, path: Path) -> None:
    """Write an imported object, whole or not at all; raises `RecordingError` where there is no file of its kind."""
    if isinstance(thing, Backbone):
        write_arrays(path, MEASURED_BACKBONE.name, *MEASURED_BACKBONE.pack(thing))
        return
    thing = ModalAnalysis(thing) if isinstance(thing, LinearModes) else thing
    if not any(isinstance(thing, kind.holds) for kind in files.KINDS.values()):
        raise RecordingError(f"{path}: {type(thing).__name__} has no file of its own; give a mapping that evaluates it")
    files.save(thing, path)


def load(path: Path) -> Any:
    """What a file that is no recording holds; raises `RecordingError` where it cannot be read."""
    if kind_of(path) == MEASURED_BACKBONE.name:
        _, arrays, attributes = read_arrays(path)
        return MEASURED_BACKBONE.unpack(arrays, attributes)
    return files.load(path)

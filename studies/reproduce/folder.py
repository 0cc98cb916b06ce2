"""Folder of a study. Existing results are reused, and results of other settings are refused."""

import json
from pathlib import Path
from typing import Any

from rig.errors import RecordingError
from rig.system.text_files import read_text
from rig.system.whole_file import whole_file
from studies.reproduce.options import Options


def prepare(options: Options) -> None:
    """Create the folders; raise `RecordingError` if one contains a study with other settings, or cannot be created."""
    begin(options.folder, "study.json", options.recordings, options.models_folder)
    _same(options.folder / "study.json", options.of_the_recordings)
    _same(options.result("models.json"), options.of_the_models)


def begin(folder: Path, first: str, *needed: Path) -> None:
    """Make the ``needed`` folders in a folder that is empty or new, or holds ``first``, which every study has at once.

    Raises `RecordingError`.
    """
    try:
        if folder.is_dir() and not (folder / first).exists() and any(folder.iterdir()):
            raise RecordingError(f"{folder}: holds files that are of no such study; choose an empty or a new folder")
    except OSError as error:
        raise RecordingError(f"{folder}: cannot be read: {error.strerror}") from None
    try:
        for path in needed:
            path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"{folder}: cannot be made: {error.strerror}") from None


def write_json(path: Path, value: Any) -> None:
    """Write a document completely or not at all; raise `RecordingError` if it cannot be written."""
    with whole_file(path) as part:
        part.write_text(json.dumps(value, indent=1), encoding="utf-8")


def _same(path: Path, settings: dict[str, Any]) -> None:
    """Store the settings, or refuse them if other settings are stored already."""
    settings = json.loads(json.dumps(settings))
    if not path.exists():
        write_json(path, settings)
        return
    try:
        kept = json.loads(read_text(path, 10_000_000, RecordingError))
        differing = [name for name in settings if kept.get(name) != settings[name]]
    except (RecordingError, RecursionError, ValueError, AttributeError) as error:
        raise RecordingError(f"{path}: cannot be read: {error}; choose another folder") from None
    if differing:
        name = differing[0]
        was = "" if name == "bench" else f" {kept.get(name)}, asked for is {settings[name]}"
        raise RecordingError(f"{path}: the folder holds a study with another {name}{was or ''}; choose another folder")

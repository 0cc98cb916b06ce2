"""Files of the reference studies: where to get them, and whether a file is the right one."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

from rig.errors import ConfigurationError, RecordingError


@dataclass(frozen=True, kw_only=True)
class DataFile:
    """A file of a data set."""

    name: str
    """Name in the folder."""
    sha256: str
    """Checksum of its contents."""
    aliases: tuple[str, ...] = ()
    """Other names under which it is handed on."""


@dataclass(frozen=True, kw_only=True)
class DataSet:
    """Data of others. Nothing of it is part of this project."""

    name: str
    """Name of the study."""
    files: tuple[DataFile, ...]
    """Its files."""
    source: str
    """Where to get them."""
    citation: str
    """Who asks to be cited for them."""

    @property
    def needs(self) -> str:
        """What the folder must hold, and where to get it."""
        return f"{' and '.join(file.name for file in self.files)} from {self.source}"


def found(data: DataSet, folder: Path | None) -> tuple[Path, ...]:
    """Return the paths of all files, in their order.

    Raises `ConfigurationError` if there is no folder or a file is missing, `RecordingError` if one is unreadable or another.
    """
    if folder is None:
        raise ConfigurationError(f"{data.name} needs a folder with {data.needs}", field="data", hint="give it")
    if not folder.is_dir():
        raise ConfigurationError(f"`data` {folder}: is no folder; {data.name} needs one with {data.needs}")
    return tuple(_checked(data, file, folder) for file in data.files)


def _checked(data: DataSet, file: DataFile, folder: Path) -> Path:
    names = (file.name, *file.aliases)
    there = [folder / name for name in names if (folder / name).is_file()]
    if not there:
        raise ConfigurationError(f"`data` {folder}: has no {' or '.join(names)}; get it from {data.source}")
    for path in there:
        try:
            with path.open("rb") as stream:
                digest = hashlib.file_digest(stream, "sha256").hexdigest()
        except OSError as error:
            raise RecordingError(f"{path}: cannot be read: {error.strerror}") from None
        if digest == file.sha256:
            return path
    raise RecordingError(
        f"is another file or another version: its SHA-256 is {digest}, that of the study {file.sha256}",
        where=there[0],
        hint=f"get it from {data.source}",
    )

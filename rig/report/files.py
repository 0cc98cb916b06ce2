"""Facts about the files themselves: size and digest."""

import hashlib
from collections.abc import Sequence
from pathlib import Path

from rig.errors import RecordingError
from rig.recording.journal import journal_path
from rig.report.document import Table

_CHUNK_BYTES = 2**20  # bytes that are read at once; chosen


def files_of(path: Path) -> list[Path]:
    """Return the files of a recording or model that exist: the HDF5 file, and the journal of a run without an end."""
    return [one for one in (path, journal_path(path)) if one.is_file()]


def digest_of(path: Path) -> str:
    """Return the SHA-256 of a file as hexadecimal digits; raise `RecordingError` if it cannot be read."""
    digest = hashlib.sha256()
    try:
        with path.open("rb") as stream:
            while data := stream.read(_CHUNK_BYTES):
                digest.update(data)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror})") from None
    return digest.hexdigest()


def table_of_files(paths: Sequence[Path]) -> Table:
    """Return names, sizes and digests of files."""
    rows = [(path.name, f"{path.stat().st_size}", digest_of(path)) for path in paths]
    return Table("Files", ("file", "size\nbytes", "SHA-256"), rows)

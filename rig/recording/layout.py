"""Common to all HDF5 files of the bench: how they are recognised, opened, and replaced in one step."""

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

from rig.errors import RecordingError
from rig.recording.examination import check_attributes, examine_once
from rig.recording.hdf5_sink import Sink
from rig.recording.header import FORMAT, SCHEMA, check_schema
from rig.recording.integrity import append_trailer, integrity_of
from rig.system.locking import synchronise_folder
from rig.system.whole_file import beginning
from vibrolock.printable import error_text

if TYPE_CHECKING:
    import h5py

_HDF5_SIGNATURE = b"\x89HDF\r\n\x1a\n"
_CACHE_BYTES = 2**20  # of each dataset: chunks are written whole and once
_FOREIGN = {
    b"MATLAB 5.0": "a MATLAB 5 file; `rig import` reads those",
    b"VLJB": "a journal; give the name of its recording, without .journal",
    b"PK\x03\x04": "a ZIP archive",
    b"\x89PNG": "a picture",
    b"CDF": "a NetCDF file",
    b"    -1": "a UFF file",
}


def _foreign(path: Path) -> str:
    with path.open("rb") as stream:
        start = stream.read(64)
    if not start:
        return "an empty file"
    for signature, name in _FOREIGN.items():
        if start.startswith(signature):
            return name
    text = all(32 <= byte < 127 or byte in b"\t\r\n" for byte in start)
    if text and path.suffix == ".toml" and path.with_suffix(".h5").is_file():
        return f"a text file; {path.with_suffix('.h5').name} beside it may be what is meant"
    return "a text file" if text else "no HDF5 file"


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Turn whatever h5py raises on a damaged or vanished file into one ``RecordingError`` that names ``path``."""
    try:
        yield
    except RecordingError as error:
        if str(error).startswith(f"{path}: "):
            raise
        raise RecordingError.of(error, where=f"{path}: damaged") from error
    except (OSError, LookupError, RuntimeError, ValueError, TypeError, AttributeError, MemoryError) as error:
        raise RecordingError(f"{path}: damaged: cannot be read ({error_text(error)})") from error


def open_file(path: Path) -> "h5py.File":
    """Open one of our HDF5 files for reading, after its digest, or else a child process, has found it whole.

    Returns:
        The open ``h5py.File``, to be closed by the caller.

    Raises:
        RecordingError: missing, not permitted, no HDF5 file, truncated, with a changed byte, of another program, of a
            later schema, or holding what no file of ours holds (`rig.recording.examination`).
    """
    file_integrity(path)
    return open_unchecked(path)


def file_integrity(path: Path) -> str:
    """``"verified"`` or ``"unverified: WHY"`` (`rig.recording.integrity`); raises as `open_file`."""
    try:
        with path.open("rb") as stream:
            ours = stream.read(len(_HDF5_SIGNATURE)) == _HDF5_SIGNATURE
        if not ours:
            raise RecordingError(f"{path}: not a file of vibrolock, but {_foreign(path)}")
        return integrity_of(path)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror})") from error


def open_unchecked(path: Path) -> "h5py.File":
    """Open one of our HDF5 files whatever its digest: a changed byte in it may crash the HDF5 library. As `open_file`."""
    import h5py

    try:
        file = h5py.File(path, "r")
    except (OSError, RuntimeError, ValueError) as error:
        why = "truncated" if "truncated" in str(error) else f"damaged ({error_text(error)})"
        raise RecordingError(f"{path}: cannot be opened: {why}") from error
    try:
        with reading(path):
            check_attributes(file.id)
            if file.attrs.get("format") != FORMAT:
                raise RecordingError(f"{path}: not a file of vibrolock, but an HDF5 file of another program")
            check_schema(file.attrs.get("schema"), path)
            examine_once(file)
    except BaseException:
        file.close()
        raise
    return file


def identify(file: "h5py.File", kind: str) -> None:
    """Mark an open new file as one of ours, of the present schema and of ``kind``."""
    file.attrs["format"], file.attrs["schema"], file.attrs["kind"] = FORMAT, SCHEMA, kind


def kind_in(file: "h5py.File") -> str:
    """Return the kind of the open file, for example ``"backbone"`` or ``"nonlinear-mode"``."""
    return str(file.attrs["kind"])


@contextmanager
def new_file(path: Path, *, kept: str) -> "Iterator[tuple[h5py.File, Callable[[], None]]]":
    """Write an HDF5 file that appears under ``path`` whole or not at all, in place of what was there before.

    It is written as ``PATH.vibrolock-part`` in the same folder, given its digest, forced to the disk and renamed. ``kept``
    ends the error's line. Yields the open ``h5py.File`` and a function to call after each large write: it raises once the disk
    is full.

    Raises:
        RecordingError: it cannot be written; ``path`` is then as it was.
    """
    import h5py

    part = None
    try:
        part = beginning(path)
        with Sink(part) as sink:
            with h5py.File(sink, "w", rdcc_nbytes=_CACHE_BYTES) as file:
                yield file, sink.check
            sink.check()
            append_trailer(sink)
            sink.check()
            os.fsync(sink.fileno())
        part.replace(path)
        synchronise_folder(path)
    except (OSError, RuntimeError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) and error.strerror else error_text(error)
        raise RecordingError(f"{path}: cannot be written ({why}); {kept}") from error
    finally:
        if part is not None:
            with suppress(OSError):
                part.unlink(missing_ok=True)

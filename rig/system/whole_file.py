"""Writing of export files so that they appear complete or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rig.errors import RecordingError, RigError
from rig.system.locking import synchronise_folder
from vibrolock.printable import error_text


def beginning(path: Path) -> Path:
    """Return the path beside ``path`` under which a file is begun. None but this program uses it; nothing is there now.

    Raises:
        OSError: what a killed process has left there cannot be removed.
    """
    part = path.with_name(f"{path.name}.vibrolock-part")
    part.unlink(missing_ok=True)
    return part


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Yield the path of an empty file to write to; it replaces ``path`` once all data are on the disk.

    Raises `RecordingError` with the system's reason if that fails; ``path`` is then unchanged.
    """
    part = None
    try:
        part = beginning(path)
        part.touch(exist_ok=False)
        yield part
        with part.open("rb+") as stream:
            os.fsync(stream.fileno())
        part.replace(path)
        synchronise_folder(path)
    except RigError:
        raise
    except Exception as error:  # the libraries of the formats hide the system's error in one of their own
        raise RecordingError(f"{path}: cannot be written ({_reason(error)}); nothing was changed") from error
    finally:
        if part is not None:
            with suppress(OSError):
                part.unlink(missing_ok=True)


def _reason(error: BaseException) -> str:
    """Return the operating system's message behind an error, or else the error's own text."""
    cause: BaseException | None = error
    while cause is not None:
        if isinstance(cause, OSError) and cause.strerror:
            return cause.strerror
        cause = cause.__cause__ or cause.__context__
    return error_text(error)

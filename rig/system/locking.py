"""File locks for one writer at a time, and names that survive a power cut."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from rig.errors import RecordingError

if sys.platform != "win32":
    import fcntl


def lock(descriptor: int, path: Path) -> None:
    """Make this process the only writer of an open file until it is closed, or refuse.

    The lock is advisory and ends with the process. No lock is taken on Windows, or on network file systems without locks.

    Raises:
        RecordingError: another process writes the file, or has just removed it.
    """
    if sys.platform != "win32":
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise RecordingError(f"{path}: is being written by another process; wait until it has ended") from error
        except OSError:
            return
        if os.fstat(descriptor).st_nlink == 0:
            raise RecordingError(f"{path}: has just been finished by another process; try again")


def is_locked(path: Path) -> bool:
    """Return whether a process holds the lock of the file at ``path``; False where there is no file, and always on Windows."""
    if sys.platform == "win32":
        return False
    try:
        descriptor = os.open(path, os.O_RDONLY)
    except OSError:
        return False
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    finally:
        os.close(descriptor)
    return False


@contextmanager
def exclusive(path: Path) -> Iterator[None]:
    """Keep other writers off the file at ``path`` for a while.

    Raises:
        RecordingError: as ``lock``, or the file cannot be opened.
    """
    if sys.platform == "win32":
        yield
        return
    try:
        descriptor = os.open(path, os.O_RDONLY)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read ({error.strerror})") from error
    try:
        lock(descriptor, path)
        yield
    finally:
        os.close(descriptor)


def synchronise_folder(path: Path) -> None:
    """Make a name just created or changed survive a power cut, where the system supports it."""
    if sys.platform != "win32":
        with suppress(OSError):
            descriptor = os.open(path.parent, os.O_RDONLY)
            try:
                os.fsync(descriptor)
            finally:
                os.close(descriptor)

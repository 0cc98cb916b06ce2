"""Where the runs under way of a user are found: one folder for each run, in memory where the system has such files.

Nobody but the user may read or write there. A run holds a lock on its folder for as long as its process lives, so that what a
killed process has left is known as such, whatever has become of its number.
"""

import os
import secrets
import shutil
import stat
import sys
import tempfile
import time
from pathlib import Path

from rig.errors import RecordingError
from rig.system.locking import is_locked, lock

__all__ = ["FACTS", "FRAME_FILE", "LINES", "LOCK", "STOP", "TRACES", "base_folder", "lives", "new_folder", "runs"]

FACTS, FRAME_FILE, TRACES, LINES = "facts.json", "frame", "traces", "lines.jsonl"
STOP, LOCK = "stop", "lock"
WHERE = "VIBROLOCK_LIVE"
ABANDONED_S = 60.0  # a folder that has not got its name by then never will


def base_folder() -> Path:
    """Return the folder of the user's runs: ``$VIBROLOCK_LIVE`` if set, else in ``/dev/shm`` or the system's temporary folder.

    It is the same in every terminal of the user, whatever the session's variables are.

    Raises:
        RecordingError: it is not the user's own, or others may write to it.
    """
    given = os.environ.get(WHERE, "")
    memory = Path("/dev/shm")
    folder = memory if memory.is_dir() and os.access(memory, os.W_OK) else Path(tempfile.gettempdir())
    user = str(os.getuid()) if sys.platform != "win32" else os.environ.get("USERNAME", "user")
    path = Path(given) if given else folder / f"vibrolock-{user}"
    try:
        path.mkdir(mode=0o700, parents=bool(given), exist_ok=True)
        found = path.lstat()
    except OSError as error:
        raise RecordingError(f"{path}: cannot be made ({error.strerror})") from error
    if sys.platform != "win32":
        if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid():
            raise RecordingError(f"{path}: belongs to somebody else; set {WHERE} to a folder of your own")
        if found.st_mode & 0o077:
            path.chmod(0o700)
    return path


def new_folder() -> tuple[Path, int]:
    """Make the folder of a new run; return it with the descriptor that holds its lock. Folders of dead runs are removed.

    Raises:
        RecordingError: it cannot be made.
    """
    base = base_folder()
    for left in base.iterdir():
        if not _is_being_made(left) and not is_locked(left / LOCK):
            shutil.rmtree(left, ignore_errors=True)
    path = base / f"{os.getpid()}-{secrets.token_hex(8)}"
    made = path.with_name(f".{path.name}")
    try:
        made.mkdir(mode=0o700)
        descriptor = os.open(made / LOCK, os.O_RDWR | os.O_CREAT, 0o600)
        lock(descriptor, made / LOCK)
        return made.rename(path), descriptor
    except OSError as error:
        raise RecordingError(f"{path}: cannot be made ({error.strerror})") from error


def _is_being_made(folder: Path) -> bool:
    """Return whether a folder has no name yet. Its lock is left alone: to look at it might be to hold it."""
    try:
        return folder.name.startswith(".") and time.time() - folder.stat().st_mtime < ABANDONED_S
    except OSError:
        return True  # gone, or just named


def runs() -> list[Path]:
    """Return the folders of the runs under way, the youngest first."""
    try:
        found = [path for path in base_folder().iterdir() if not path.name.startswith(".") and lives(path)]
        return sorted(found, key=lambda path: (path / LOCK).stat().st_mtime_ns, reverse=True)
    except (OSError, RecordingError):
        return []


def lives(folder: Path) -> bool:
    """Return whether the process of a run lives. Windows has no such locks: there, whether its folder is left."""
    return folder.is_dir() if sys.platform == "win32" else is_locked(folder / LOCK)

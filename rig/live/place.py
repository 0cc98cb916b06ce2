"""Where the runs under way of a user are found: one folder for each run, in memory where the system has such files.

Nobody but the user may read or write there. A run holds a lock on its folder for as long as its process lives, so that what a
killed process has left is known as such, whatever has become of its number. Only what this program has made, as its name and
its content say, is removed, file by file; no folder's mode is changed.
"""

import json
import os
import re
import secrets
import stat
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path

from rig.errors import RecordingError
from rig.system.locking import is_locked, lock

FACTS, FRAME_FILE, TRACES, LINES = "facts.json", "frame", "traces", "lines.jsonl"
STOP, LOCK = "stop", "lock"
WHERE = "VIBROLOCK_LIVE"
ABANDONED_S = 60.0  # a folder that has not got its name by then never will
_FOLDER = re.compile(r"\d{1,10}-[0-9a-f]{16}")  # hidden, with a dot before, while it is made and while it is removed
_FILES = "|".join(map(re.escape, (FACTS, FRAME_FILE, TRACES, LINES, STOP, LOCK)))
_FILE = re.compile(rf"{_FILES}|\.{STOP}-[0-9a-f]{{16}}")


def base_folder() -> Path:
    """Return the folder of the user's runs: ``vibrolock-UID`` in ``$VIBROLOCK_LIVE`` if set, else in memory.

    Without the variable it lies in ``/dev/shm`` or the system's temporary folder. It is the same in every terminal of the user,
    whatever the session's variables are.

    Raises:
        RecordingError: it cannot be made, is not the user's own, or others may use it.
    """
    given = os.environ.get(WHERE, "")
    memory = Path("/dev/shm")
    folder = memory if memory.is_dir() and os.access(memory, os.W_OK) else Path(tempfile.gettempdir())
    user = str(os.getuid()) if sys.platform != "win32" else os.environ.get("USERNAME", "user")
    path = (Path(given) if given else folder) / f"vibrolock-{user}"
    try:
        path.mkdir(mode=0o700, parents=bool(given), exist_ok=True)
        found = path.lstat()
    except OSError as error:
        raise RecordingError(f"{path}: cannot be made ({error.strerror})") from error
    if sys.platform != "win32":
        if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid():
            raise RecordingError(f"{path}: belongs to somebody else; set {WHERE} to a folder of your own")
        if found.st_mode & 0o077:
            raise RecordingError(f"{path}: others may use it; set {WHERE} to another folder, or `chmod 700 {path}`")
    return path


def new_folder(facts: bytes) -> tuple[Path, int]:
    """Make the folder of a new run with its facts; return it with the descriptor that holds its lock.

    Folders of dead runs are removed.

    Raises:
        RecordingError: it cannot be made.
    """
    base = base_folder()
    with suppress(OSError):
        for left in base.iterdir():
            _remove_dead(left)
    path = base / f"{os.getpid()}-{secrets.token_hex(8)}"
    made = _hidden(path)
    try:
        made.mkdir(mode=0o700)
        (made / FACTS).write_bytes(facts)
        descriptor = os.open(made / LOCK, os.O_RDWR | os.O_CREAT, 0o600)
        lock(descriptor, made / LOCK)
        return made.rename(path), descriptor
    except OSError as error:
        _empty(made)
        raise RecordingError(f"{path}: cannot be made ({error.strerror})") from error


def remove(folder: Path) -> None:
    """Remove the folder of a run, which nobody finds from now on. Files in it that are of no run stay, and so does it then."""
    with suppress(OSError):
        folder = folder.rename(_hidden(folder))
    _empty(folder)


def _hidden(folder: Path) -> Path:
    return folder.with_name(f".{folder.name}")


def _remove_dead(folder: Path) -> None:
    """Remove a folder if this program has made it for a run that is dead, or is half made or half removed."""
    if _FOLDER.fullmatch(folder.name):
        if _is_of_a_run(folder) and not is_locked(folder / LOCK):
            remove(folder)
    elif _FOLDER.fullmatch(folder.name.removeprefix(".")) and _only_of_a_run(folder):
        with suppress(OSError):  # gone, or just named
            if time.time() - folder.stat().st_mtime >= ABANDONED_S and not is_locked(folder / LOCK):
                _empty(folder)


def _only_of_a_run(folder: Path) -> bool:
    """Return whether a folder, not a link to one, holds nothing but files as a run has them."""
    try:
        return not folder.is_symlink() and all(
            _FILE.fullmatch(path.name) and stat.S_ISREG(path.lstat().st_mode) for path in folder.iterdir()
        )
    except OSError:
        return False


def _is_of_a_run(folder: Path) -> bool:
    """Return whether a folder with the name of a run's has its lock, which is empty, and its facts."""
    try:
        return (
            _only_of_a_run(folder)
            and (folder / LOCK).stat().st_size == 0
            and "channels" in dict(json.loads((folder / FACTS).read_bytes()))
        )
    except (OSError, ValueError, TypeError, RecursionError):
        return False


def _empty(folder: Path) -> None:
    """Remove a run's files from a folder, and the folder if nothing else is in it."""
    with suppress(OSError):
        for path in folder.iterdir():
            if _FILE.fullmatch(path.name):
                path.unlink(missing_ok=True)
        folder.rmdir()


def runs() -> list[Path]:
    """Return the folders of the runs under way, the youngest first."""
    try:
        found = [path for path in base_folder().iterdir() if _FOLDER.fullmatch(path.name) and lives(path)]
        return sorted(found, key=lambda path: (path / LOCK).stat().st_mtime_ns, reverse=True)
    except (OSError, RecordingError):
        return []


def lives(folder: Path) -> bool:
    """Return whether the process of a run lives. Windows has no such locks: there, whether its folder is left."""
    return folder.is_dir() if sys.platform == "win32" else is_locked(folder / LOCK)

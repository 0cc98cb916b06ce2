"""What several workers need is made by the first that asks, once for all of them; the others wait for it."""

import atexit
import contextlib
import functools
import os
import shutil
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

if sys.platform != "win32":
    import fcntl


@functools.cache
def shared_folder() -> Path:
    """A folder of this run of the tests, the same in all its workers; it goes with the process that has started them."""
    if given := os.environ.get("VIBROLOCK_TESTS_SHARE"):
        return Path(given)
    folder = Path(tempfile.mkdtemp(prefix="shared-by-tests-"))
    os.environ["VIBROLOCK_TESTS_SHARE"] = str(folder)
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    return folder


def made_once(folder: Path, make: Callable[[Path], None]) -> Path:
    """The folder, which ``make`` fills if it is not there yet. It is made beside its place: it is there whole or not at all."""
    if not folder.exists():
        folder.parent.mkdir(parents=True, exist_ok=True)
        with _alone(folder.with_name(f"{folder.name}.lock")):
            if not folder.exists():
                unfinished = folder.with_name(f"{folder.name}.unfinished")
                shutil.rmtree(unfinished, ignore_errors=True)  # of tests that were killed
                unfinished.mkdir()
                make(unfinished)
                unfinished.rename(folder)
    return folder


def copy_of(folder: Path, to: Path) -> Path:
    """Copy what was made once into a folder, in which a test may do what it likes."""
    return shutil.copytree(folder, to, dirs_exist_ok=True)


@contextlib.contextmanager
def _alone(path: Path) -> Iterator[None]:
    """Hold a lock among processes; it ends with the process. There is none on Windows: run the tests in one process there."""
    with path.open("w") as file:
        if sys.platform != "win32":
            fcntl.flock(file, fcntl.LOCK_EX)
        yield

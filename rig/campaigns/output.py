"""The file that a run is recorded in: nothing is overwritten unasked, nothing is lost while it is."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rig.errors import RecordingError
from rig.recording.arrays import kind_of
from rig.recording.journal import journal_path
from rig.recording.locking import exclusive

__all__ = ["make_way", "set_aside"]


def make_way(output: Path, overwrite: bool) -> None:
    """Refuse an output that cannot or should not be written: no folder, a folder, a file that exists."""
    if not output.parent.is_dir():
        raise RecordingError(f"{output.parent}: there is no such folder")
    if output.is_dir():
        raise RecordingError(f"{output}: is a folder, the name of a file is wanted")
    for path in (output, journal_path(output)):
        if path.exists() and not overwrite:
            raise RecordingError(f"{path}: exists already; choose another name, or --overwrite")
    if output.exists():
        kind_of(output)  # only what is ours is overwritten


@contextmanager
def set_aside(output: Path) -> Iterator[None]:
    """Keep an earlier recording, and its journal, under other names until the new one is written; put back if it never is."""
    journal = journal_path(output)
    moved: list[tuple[Path, Path]] = []
    try:
        if journal.exists():
            with exclusive(journal):  # refuses while another run is writing it
                moved.append(_moved(journal))
        if output.exists():
            moved.append(_moved(output))
        yield
    finally:
        begun = journal.exists()
        for path, aside in moved:
            if begun:
                aside.unlink()
            else:
                aside.replace(path)


def _moved(path: Path) -> tuple[Path, Path]:
    """A file, moved, and where it is now."""
    return path, path.replace(path.with_name(path.name + ".before"))

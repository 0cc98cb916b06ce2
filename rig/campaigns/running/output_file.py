"""The file that a run is recorded in: nothing is overwritten unasked, nothing is lost while it is."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rig.errors import RecordingError
from rig.recording.arrays import kind_of
from rig.recording.journal import journal_path
from rig.recording.journal_contents import JournalContents
from rig.system.locking import exclusive

__all__ = ["forget_before", "make_way", "put_back", "set_aside"]


def make_way(output: Path, overwrite: bool) -> None:
    """Refuse an output that cannot or should not be written: no folder, a folder, a file that exists."""
    try:
        if not output.parent.is_dir():
            raise RecordingError(f"{output.parent}: there is no such folder")
        if output.is_dir():
            raise RecordingError(f"{output}: is a folder, the name of a file is wanted")
        for path in (output, journal_path(output)):
            if path.exists() and not overwrite:
                raise RecordingError(f"{path}: exists already; choose another name, or `overwrite`")
        if output.exists():
            kind_of(output)  # only what is ours is overwritten
    except OSError as error:
        raise RecordingError(f"{output}: cannot be used ({error.strerror})") from None


@contextmanager
def set_aside(output: Path) -> Iterator[None]:
    """Keep an earlier recording, and its journal, under other names until the new one is written; put back if it never is."""
    journal = journal_path(output)
    moved: list[Path] = []
    try:
        if journal.exists():
            with exclusive(journal):  # refuses while another run is writing it
                moved.append(_moved(journal))
        if output.exists():
            moved.append(_moved(output))
        yield
    finally:
        begun = journal.exists()
        for path in moved:
            if begun:
                _before(path).unlink()
            else:
                _before(path).replace(path)


def put_back(output: Path) -> str:
    """Undo what a run into ``output`` has left that was killed before it had recorded anything.

    Its journal, which holds no part, is removed. A recording that it was to overwrite comes back under its name. Where rows
    were recorded, their journal is the recording now, and the old one is removed once that has become a file
    (`forget_before`).

    Returns:
        One line that says what was put back; empty where nothing was.
    """
    journal = journal_path(output)
    if journal.exists():
        with exclusive(journal):  # refuses while that run is still writing
            if _holds_a_part(journal):
                return ""
            journal.unlink()
    left = [path for path in (output, journal) if _before(path).exists()]
    if not left or output.exists():
        return ""
    for path in left:
        _before(path).replace(path)
    return f"{output}: a run that was to overwrite it was killed before it began; the recording is back under its name"


def forget_before(output: Path) -> None:
    """Remove what was overwritten, once the new recording is whole."""
    for path in (output, journal_path(output)):
        _before(path).unlink(missing_ok=True)


def _holds_a_part(journal: Path) -> bool:
    try:
        with JournalContents(journal) as contents:
            return bool(contents.parts)
    except RecordingError:
        return journal.stat().st_size > 0  # unreadable, and perhaps all that is left of a run


def _before(path: Path) -> Path:
    return path.with_name(path.name + ".before")


def _moved(path: Path) -> Path:
    """The path of a file that was moved out of the way."""
    path.replace(_before(path))
    return path

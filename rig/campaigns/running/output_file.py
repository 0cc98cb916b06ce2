"""Output file of a run: nothing is overwritten without permission, and nothing is lost while the file is written."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from rig.errors import RecordingError
from rig.recording.arrays import kind_of
from rig.recording.journal import check_journal, journal_path
from rig.recording.journal_contents import JournalContents
from rig.system.locking import exclusive


def prepare_output(output: Path, overwrite: bool) -> None:
    """Refuse an output that cannot or must not be written: a missing folder, a name of a folder, an existing file."""
    try:
        if not output.parent.is_dir():
            raise RecordingError(f"{output.parent}: there is no such folder")
        if output.is_dir():
            raise RecordingError(f"{output}: is a folder, the name of a file is expected")
        for path in (output, journal_path(output)):
            if path.exists() and not overwrite:
                raise RecordingError(f"{path}: exists already; choose another name, or `overwrite`")
        if output.exists():
            kind_of(output)  # only files of this program are overwritten
        if journal_path(output).exists():
            check_journal(journal_path(output))
    except OSError as error:
        raise RecordingError(f"{output}: cannot be used ({error.strerror})") from None


@contextmanager
def back_up(output: Path) -> Iterator[None]:
    """Keep an earlier recording and its journal under other names; put them back if the new one is never begun."""
    journal = journal_path(output)
    moved: list[Path] = []
    try:
        if journal.exists():
            with exclusive(journal):  # refuses if another run is writing it
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


def restore_backup(output: Path) -> str:
    """Undo what a run into ``output`` has left if it was killed before it recorded anything.

    A journal without any part is removed. A recording that the run was to overwrite gets its name back. If rows were recorded,
    their journal is the recording now; the old one is removed once this journal has become a file (`forget_before`).

    Returns:
        One line that says what was put back or removed; empty if nothing was.
    """
    journal, told = journal_path(output), ""
    if journal.exists():
        with exclusive(journal):  # refuses if that run is still writing
            if _holds_a_part(journal):
                return ""
            journal.unlink()
            told = f"{output}: a run into it was killed before it began; nothing was recorded"
    left = [path for path in (output, journal) if _before(path).exists()]
    if not left or output.exists():
        return told
    for path in left:
        _before(path).replace(path)
    return f"{output}: a run that was to overwrite it was killed before it began; the recording is back under its name"


def forget_before(output: Path) -> None:
    """Remove the overwritten recording once the new one is complete."""
    for path in (output, journal_path(output)):
        _before(path).unlink(missing_ok=True)


def _holds_a_part(journal: Path) -> bool:
    try:
        with JournalContents(journal) as contents:
            return bool(contents.parts)
    except RecordingError:
        return journal.stat().st_size > 0  # unreadable, but perhaps all that is left of a run


def _before(path: Path) -> Path:
    return path.with_name(f"{path.name}.vibrolock-before")  # a name that none but this program uses


def _moved(path: Path) -> Path:
    """Move a file out of the way; return its original path."""
    path.replace(_before(path))
    return path

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
    """Keep an earlier recording under another name until the new one has begun to be written, and put it back if it has not."""
    journal = journal_path(output)
    if journal.exists():
        with exclusive(journal):  # refuses while another run is writing it
            journal.unlink()
    aside = output.with_name(output.name + ".before")
    if output.exists():
        output.replace(aside)
    try:
        yield
    finally:
        if aside.exists():
            if journal.exists():
                aside.unlink()
            else:
                aside.replace(output)

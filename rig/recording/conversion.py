"""From a journal to an HDF5 file, whole or not at all, and a new journal that continues a finished file."""

from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import numpy as np

from rig.errors import RecordingError
from rig.recording.hdf5_recording import opened_recording, read_recording, taken_over, write_recording
from rig.recording.header import SCHEMA, Column, Header, packed
from rig.recording.journal import JournalWriter, damaged_path, journal_path
from rig.recording.journal_contents import JournalContents
from rig.recording.layout import new_file, open_file
from rig.recording.parts import Part
from rig.system.locking import exclusive


def finalise(journal: str | Path, output: str | Path, check: Callable[[], None] = lambda: None) -> Path | None:
    """Turn a journal into the HDF5 file ``output`` and remove the journal.

    Where ``output`` holds the earlier parts of the same recording, the new file holds them and the journal's. It is
    written beside ``output`` and renamed when it is whole and on the disk: until then ``output`` and journal stay as
    they are, and doing it again after an interruption does no harm. ``check`` is called between chunks of rows; what it raises
    ends the conversion.

    Returns:
        ``JOURNAL.damaged``, to which a journal with damage amid whole blocks is renamed; ``None`` where it was removed.

    Raises:
        RecordingError: the journal is unreadable, empty or being written, ``output`` is another recording or not ours,
            or it cannot be written (full disk); the line says what is kept.
    """
    journal, output = Path(journal), Path(output)
    with exclusive(journal):
        with ExitStack() as stack:
            contents = stack.enter_context(JournalContents(journal))
            header, parts, unverified = contents.header, list[Part](contents.parts), ""
            if output.exists():
                old, integrity = opened_recording(output)
                stack.enter_context(old)
                earlier, stored = read_recording(old, output)
                check_continuation(header, earlier, output)
                unverified = taken_over(integrity, header.first_part)
                parts = [*stored[: header.first_part], *parts]
                if header.first_part:
                    header = replace(earlier, row_dtype=header.row_dtype, columns=header.columns)
            else:
                check_continuation(header, None, output)
            if not parts:
                raise RecordingError(f"{journal}: nothing was recorded; remove it")
            with new_file(output, kept=f"the journal {journal} is kept") as (file, fits):

                def fits_and_check() -> None:
                    fits()
                    check()

                write_recording(file, header, parts, fits_and_check, unverified)
        if contents.damaged:
            return journal.rename(damaged_path(journal))
        journal.unlink()
        return None


def continue_recording(
    output: str | Path, *, row_dtype: np.dtype | None = None, columns: Sequence[Column] | None = None
) -> JournalWriter:
    """Open the journal of ``output`` for further parts: an interrupted run's, or a new one behind a finished file.

    ``row_dtype`` and ``columns`` together say what the rows to come hold, if that differs from those recorded. The journal
    of an interrupted run with other rows, or of an earlier schema, is turned into its HDF5 file first.

    Raises:
        RecordingError: there is neither file nor journal, the two do not belong together, or one cannot be read.
    """
    output, journal = Path(output), journal_path(output)
    earlier = _header_of(output)
    if journal.exists() and (earlier is None or journal.stat().st_size):
        writer = JournalWriter.reopen(journal)
        try:
            check_continuation(writer.header, earlier, output)
        except RecordingError:
            writer.close()
            raise
        same_rows = row_dtype is None or packed(row_dtype) == writer.header.row_dtype
        if same_rows and writer.header.schema == SCHEMA:
            return writer
        writer.close()
        finalise(journal, output)
        earlier = _header_of(output)
    if earlier is None:
        raise RecordingError(f"{output}: nothing to resume; there is neither the file nor its journal")
    if row_dtype is not None:
        earlier = replace(earlier, row_dtype=row_dtype, columns=earlier.columns if columns is None else columns)
    return JournalWriter.create(journal, earlier)


def _header_of(output: Path) -> Header | None:
    if not output.exists():
        return None
    with open_file(output) as file:
        return read_recording(file, output)[0]


def check_continuation(journal: Header, file: Header | None, output: Path) -> None:
    """Raise ``RecordingError`` for a journal that does not belong to the file ``output`` beside it (``None``: no file)."""
    if file is None:
        if journal.first_part:
            raise RecordingError(f"{output}: missing, but its journal continues it; put the file back")
    elif journal.identity != file.identity:
        raise RecordingError(f"{output}: is another recording than the journal beside it; move one of the two away")
    elif file.first_part < journal.first_part:
        raise RecordingError(
            f"{output}: holds {file.first_part} parts, but its journal continues it behind part {journal.first_part}; "
            "it is an older copy"
        )

"""The writer of the journal: append-only, one write per block, readable up to its last whole block at any moment.

When a method returns, the operating system has the data, so that killing the process loses nothing. The data are forced to the
disk at most every half second and at every end, so that a power cut loses at most half a second.
"""

import shutil
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Self

import numpy as np

from rig.errors import RecordingError
from rig.recording import jsontext
from rig.recording.appending import BlockFile, NameLost
from rig.recording.blocks import LARGEST_PAYLOAD, MAGIC, TWICE, BlockKind
from rig.recording.header import Header, packed
from rig.recording.journal_blocks import Tail
from rig.recording.journal_contents import JournalContents
from rig.system.closing import Closing
from rig.system.locking import synchronise_folder

_ROWS_BLOCK_BYTES = 2**20  # of rows in a block; chosen: little is lost with a damaged one


def journal_path(output: str | Path) -> Path:
    """Path of the journal of the recording ``output``: ``OUT.h5`` -> ``OUT.h5.journal``."""
    return Path(f"{output}.journal")


def check_journal(path: Path) -> None:
    """Raise ``RecordingError`` for a file with the name of a journal that is none, not even a damaged one."""
    with path.open("rb") as stream:
        start = stream.read(_ROWS_BLOCK_BYTES)
    if start and MAGIC not in start:
        raise RecordingError(f"{path}: not a journal of this program; move it away, or choose another name")


def damaged_path(path: Path) -> Path:
    """Return a free path beside ``path`` under which the damaged journal can be kept."""
    candidates = (path.with_name(f"{path.name}.damaged{n}") for n in ("", *(f"-{k}" for k in range(2, 1000))))
    return next(candidate for candidate in candidates if not candidate.exists())


class JournalWriter(Closing):
    """Appends to one journal; a context manager. Made by ``create`` or ``reopen``, and alone on its file until closed.

    Rows, points and events belong to a part: ``part`` comes first, ``end`` closes it. All methods raise
    ``RecordingError`` on a full disk or an I/O error; the journal then ends with its last whole block, and further
    writes are welcome once the cause is gone.
    """

    def __init__(self, path: Path, blocks: BlockFile, header: Header) -> None:
        self.path, self.header = path, header
        self.n_rows = 0
        """Rows in the journal, all parts together."""
        self.n_points = 0
        """Points in the journal, all parts together."""
        self.n_parts = 0
        """Parts in the journal."""
        self.dropped = Tail(0, "", torn=True)
        """What ``reopen`` has cut off."""
        self._blocks = blocks
        self._in_part = False
        self._part_number = self._rows_in_part = 0

    @classmethod
    def create(cls, path: str | Path, header: Header) -> Self:
        """Begin a new journal at ``path`` with ``header``.

        Raises:
            RecordingError: there is one already (of an interrupted run; never overwritten), or it cannot be written.
        """
        path = Path(path)
        try:
            blocks = BlockFile.open(path, new=True)
        except OSError as error:
            raise RecordingError(f"{path}: cannot be created ({error.strerror})") from error
        if blocks.size:
            blocks.close()
            raise RecordingError(
                f"{path}: exists already, from an interrupted run; resume that run, or remove the file"
            )
        writer = cls(path, blocks, header)
        try:
            writer._append(BlockKind.HEADER, header.encoded(), 0)
            writer._synchronise()
            synchronise_folder(path)
        except BaseException:
            blocks.close()
            path.unlink(missing_ok=True)
            raise
        return writer

    @classmethod
    def reopen(cls, path: str | Path) -> Self:
        """Go on with the journal of an interrupted run: cut off what is torn behind its last whole block, then append.

        What was cut off is told in ``dropped``; damage before it stays in the file. A journal of version 1, of which nothing
        can be read behind a damaged block, is first copied to ``PATH.damaged``.

        Raises:
            RecordingError: missing, foreign, of a later schema, being written by another process, or not writable.
        """
        path = Path(path)
        with ExitStack() as stack:
            try:
                blocks = BlockFile.open(path)
                stack.callback(blocks.close)
                with JournalContents(path) as contents:
                    writer = cls(path, blocks, contents.header)
                    writer._continue(contents)
            except OSError as error:
                raise RecordingError(f"{path}: cannot be resumed ({error.strerror})") from error
            stack.pop_all()
        return writer

    def _continue(self, contents: JournalContents) -> None:
        self.n_parts, self.dropped = len(contents.parts), contents.tail
        self.n_rows = sum(part.n_rows for part in contents.parts)
        self.n_points = sum(len(part.points) for part in contents.parts)
        if not contents.tail.torn:
            shutil.copyfile(self.path, damaged_path(self.path))
        self._part_number = contents.last_part
        self._blocks.cut(contents.size, contents.n_blocks)
        self._synchronise()

    def part(self, information: Mapping[str, object]) -> None:
        """Begin a part; ``information`` is the caller's (``first_sample``: number of its first row's sample)."""
        text = jsontext.encode(information, what="part")
        self._append(BlockKind.PART, text, self._part_number + 1)
        self._in_part = True
        self._part_number, self._rows_in_part = self._part_number + 1, 0
        self.n_parts += 1

    def rows(self, rows: np.ndarray) -> None:
        """Append rows, a one-dimensional structured array with the fields of the header's ``row_dtype``.

        Large arrays become several blocks: after an error, ``n_rows`` says how many rows are in the journal.
        """
        wanted = self.header.row_dtype
        if rows.ndim != 1 or (rows.dtype != wanted and packed(rows.dtype) != wanted):
            raise RecordingError(f"rows: {rows.dtype} in {rows.ndim} dimensions given, {wanted} in one wanted")
        stored = np.ascontiguousarray(rows, wanted)
        step = max(_ROWS_BLOCK_BYTES // wanted.itemsize, 1)
        for first in range(0, len(stored), step):
            block = stored[first : first + step]
            self._append_to_part(BlockKind.ROWS, block.tobytes())
            self.n_rows += len(block)
            self._rows_in_part += len(block)
        self._synchronise(if_due=True)

    def event(self, event: Mapping[str, object]) -> None:
        """Append an event."""
        self._append_to_part(BlockKind.EVENT, jsontext.encode(event, what="event"))
        self._synchronise(if_due=True)

    def point(self, point: Mapping[str, object]) -> None:
        """Append the result of a completed point."""
        self._append_to_part(BlockKind.POINT, jsontext.encode(point, what="point"))
        self.n_points += 1
        self._synchronise(if_due=True)

    def end(self, end: Mapping[str, object]) -> None:
        """End the part and force all to the disk; ``completed: True`` in ``end`` says that the run is finished."""
        self._append_to_part(BlockKind.END, jsontext.encode(end, what="end"))
        self._in_part = False
        self._synchronise()

    def close(self) -> None:
        """Force everything to the disk and close the file; may be called twice."""
        try:
            if not self._blocks.closed:
                self._synchronise()
        finally:
            self._blocks.close()

    def _append_to_part(self, kind: BlockKind, payload: bytes) -> None:
        if not self._in_part:
            raise RecordingError(f"{self.path}: {kind.name.lower()} outside any part; call part() first")
        self._append(kind, payload, self._part_number)

    def _append(self, kind: BlockKind, payload: bytes, part: int) -> None:
        if len(payload) > LARGEST_PAYLOAD:
            raise RecordingError(
                f"{kind.name.lower()}: {len(payload)} bytes of JSON, at most {LARGEST_PAYLOAD} are allowed"
            )
        row = 0 if kind is BlockKind.PART else self._rows_in_part
        with self._telling("written"):
            self._blocks.append(kind, part, row, payload, twice=kind in TWICE)

    def _synchronise(self, *, if_due: bool = False) -> None:
        with self._telling("forced to the disk"):
            self._blocks.synchronise(if_due=if_due)

    @contextmanager
    def _telling(self, done: str) -> Iterator[None]:
        recorded = f"{self.n_rows} rows and {self.n_points} points"
        try:
            yield
        except NameLost as error:
            raise RecordingError(f"{self.path}: {error.strerror}; its {recorded} are {self._rescued()}") from error
        except OSError as error:
            raise RecordingError(
                f"{self.path}: cannot be {done} ({error.strerror}); the {recorded} before are kept"
            ) from error

    def _rescued(self) -> str:
        """Save what was recorded, and write no more."""
        try:
            return self._blocks.rescue()
        except OSError as error:
            return f"lost: they cannot be written again ({error.strerror})"
        finally:
            self._blocks.close()

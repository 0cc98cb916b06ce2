"""A recording is opened by the name of its HDF5 file, whether it is finished, interrupted or still running."""

from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import NamedTuple

from rig.errors import RecordingError
from rig.recording.conversion import check_continuation
from rig.recording.hdf5_recording import opened_recording, read_recording
from rig.recording.header import Header
from rig.recording.integrity import VERIFIED
from rig.recording.journal import journal_path
from rig.recording.journal_blocks import EMPTY
from rig.recording.journal_contents import JournalContents
from rig.recording.parts import Part
from rig.recording.stored import Configuration, StoredTable
from rig.recording.stored_value_checks import check_stored_values
from rig.system.closing import Closing
from vibrolock.results import Result


class RecordedPlan(NamedTuple):
    """A plan of a recording, from the part on with which it came into force."""

    part: int
    """Number of that part."""
    plan: StoredTable
    """The plan as it was."""
    numbers: Sequence[int] | None
    """Numbers in this recording of the points that it asks for, in its order; ``None``: 0, 1, 2 and so on."""


class Recording(Result, Closing):
    """The recording ``OUT.h5``: from the HDF5 file, from the journal beside it, or from both; nothing is written.

    A context manager that holds the files open; rows are read when asked for, all else at once.

    Raises:
        RecordingError: on construction: missing, not permitted, not ours, truncated, damaged, of a later schema, or of
            another kind (a model); one line that names the file.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        journal = journal_path(self.path)
        self.integrity = VERIFIED
        with ExitStack() as stack:
            self._header, self.parts = self._open(stack, journal if _holds_anything(journal) else None)
            for number, part in enumerate(self.parts, 1):
                check_stored_values(part, f"{self.path}: part {number}")
            self._stack = stack.pop_all()
        header = self._header
        self.kind, self.channels, self.seed = header.kind, header.channels, header.seed
        self.software_version, self.started = header.software_version, header.started

    def _open(self, stack: ExitStack, journal: Path | None) -> tuple[Header, Sequence[Part]]:
        if journal is None and not self.path.exists() and journal_path(self.path).exists():
            raise RecordingError(f"{journal_path(self.path)}: {EMPTY}")
        if journal is None or self.path.exists():
            file, self.integrity = opened_recording(self.path)
            stack.enter_context(file)
            header, stored = read_recording(file, self.path)
            if journal is None:
                return header, stored
            contents = stack.enter_context(JournalContents(journal))
            check_continuation(contents.header, header, self.path)
            return header, [*stored[: contents.header.first_part], *contents.parts]
        contents = stack.enter_context(JournalContents(journal))
        check_continuation(contents.header, None, self.path)
        return contents.header, contents.parts

    integrity: str
    """``"verified"``, or ``"unverified: WHY"`` where the HDF5 file has no digest; the blocks of a journal have check sums."""
    parts: Sequence[Part]
    """The parts in the order in which they were recorded."""
    kind: str
    """Kind of recording, for example ``"backbone"``."""
    channels: Sequence[StoredTable]
    """Channel table, one mapping per input channel."""
    seed: int | None
    """Seed of the noise of a virtual rig."""
    software_version: str
    """Version that began the recording."""
    started: str
    """Start time as it was given."""

    @property
    def configuration(self) -> Configuration:
        """The whole configuration as it was; its ``plan`` is the one in force, which the last change brought."""
        changes = self.plans[1:]
        return {**self._header.configuration, "plan": changes[-1].plan} if changes else self._header.configuration

    @property
    def plans(self) -> list[RecordedPlan]:
        """The first plan of the recording, and those that replaced it."""
        first = RecordedPlan(0, self._header.configuration.get("plan", {}), None)
        told = ((number, part.information) for number, part in enumerate(self.parts))
        return [first, *(RecordedPlan(n, said["plan"], said["numbers"]) for n, said in told if "plan" in said)]

    @property
    def n_rows(self) -> int:
        """Rows of all parts together."""
        return sum(part.n_rows for part in self.parts)

    @property
    def points(self) -> list[StoredTable]:
        """Results of all points, in the order in which they were completed, each with the number of its ``part``."""
        return [{**point, "part": number} for number, part in enumerate(self.parts) for point in part.points]

    @property
    def latest(self) -> dict[int, StoredTable]:
        """The last result of each point of the current plan, keyed by the number of the point, in the order of the plan."""
        results = self._by_number()
        numbers = self.plans[-1].numbers
        return {n: results[n] for n in (sorted(results) if numbers is None else numbers) if n in results}

    @property
    def former(self) -> dict[int, StoredTable]:
        """The last result of each point that an earlier plan asked for and the plan in force does not, by number."""
        asked = self.latest
        results = self._by_number()
        return {n: results[n] for n in sorted(results) if n not in asked}

    def _by_number(self) -> dict[int, StoredTable]:
        for point in self.points:
            if point.get("number") is None:
                raise RecordingError(f"{self.path}: part {point['part'] + 1}: a point's number: is missing")
        return {point["number"]: point for point in self.points}

    @property
    def complete(self) -> bool:
        """Whether the last part ended and said ``"completed": true``."""
        return bool(self.parts) and self.parts[-1].complete

    def close(self) -> None:
        """Close the files; may be called twice. Rows can no longer be read."""
        self._stack.close()


def _holds_anything(journal: Path) -> bool:
    try:
        return journal.stat().st_size > 0
    except FileNotFoundError:
        return False
    except OSError as error:
        raise RecordingError(f"{journal}: cannot be read ({error.strerror})") from error

"""Which run the page shows: the one that is given, the youngest under way, the one into a file, those into a folder."""

import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from rig.errors import RecordingError
from rig.live.facts import RunFacts
from rig.live.place import runs
from rig.live.reader import LiveRun, run_into
from rig.monitor.feed import Earlier
from rig.monitor.shown import shown_line

if TYPE_CHECKING:
    from rig.monitor.replay import Replay, View

POLL_S = 0.2
"""Shortest time between two looks for a run, s; chosen."""
Wanted = Callable[[RunFacts], bool]


def always(view: "View") -> "Callable[[View | None], View]":
    """Return the choice of one view for good."""
    return lambda shown: view


class Latest:
    """Chooses the youngest run whose facts say that it is ``wanted``. One that has ended is shown until another begins.

    ``instead`` is shown until a run begins; ``on_found`` is called with each that does. ``close`` it when nobody reads any
    more: it closes what it has shown.
    """

    def __init__(
        self,
        wanted: Wanted = lambda facts: True,
        instead: "View | None" = None,
        on_found: "Callable[[View], None]" = lambda view: None,
    ) -> None:
        self._wanted, self._instead, self._on_found = wanted, instead, on_found
        self._looked_s = float("-inf")
        self._shown = instead

    def __call__(self, shown: "View | None") -> "View | None":
        """Return the view to show, given the one that is shown."""
        shown = shown or self._instead
        under_way = isinstance(shown, LiveRun) and shown.connected
        if under_way or time.monotonic() - self._looked_s < POLL_S:
            return shown
        self._looked_s = time.monotonic()
        found = self._found(shown)
        if found is not None:
            self.close()
            self._shown = found
            self._on_found(found)
        return found or shown

    def close(self) -> None:
        """Close what is shown."""
        if self._shown is not None:
            self._shown.close()
            self._shown = None

    def _found(self, shown: "View | None") -> LiveRun | None:
        for folder in runs():
            if isinstance(shown, LiveRun) and folder == shown.folder:
                continue
            with suppress(RecordingError):  # it has just ended, or was started by another version
                run = LiveRun(folder)
                if self._wanted(run.facts):
                    return run
                run.close()
        return None


def chosen(what: Path | None) -> Latest:
    """Return what to show for a recording (of a run that may still be to come), for a folder, or for the youngest run.

    Raises:
        RecordingError: the file is no recording that can be shown, or lies in no folder.
    """
    if what is None:
        return Latest()
    path = what.resolve()
    if path.is_dir():
        return Latest(lambda facts: Path(facts.recording).resolve().parent == path)
    if not path.parent.is_dir():
        raise RecordingError(f"{what}: there is no folder {what.parent}")

    def into(facts: RunFacts) -> bool:
        return Path(facts.recording).resolve() == path

    under_way = run_into(path)
    if under_way is not None:
        under_way.close()
    return Latest(into, recorded(path) if path.exists() and under_way is None else None)


def recorded(path: Path) -> "Replay":
    """Return a recording as it stood at its end.

    Raises:
        RecordingError, ConfigurationError: it cannot be read, or is none.
    """
    from rig.monitor.replay import Replay

    return Replay(path, at_end=True)


def earlier_run(path: Path) -> Earlier:
    """Return facts and points of a recording, to be drawn under those of the run that is shown."""
    with recorded(path) as view:
        return Earlier(view.facts, [shown_line(line, view.facts) for line in view.lines(0) if line["is"] == "point"])

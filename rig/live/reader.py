"""The other side: reads a run that is under way, from its beginning, without the run taking note of it."""

import json
import mmap
import os
import time
import zlib
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from rig.errors import RecordingError
from rig.live.facts import Line, facts_from
from rig.live.layout import BINS, FRAME, HEAD, bin_dtype
from rig.live.place import FACTS, FRAME_FILE, LINES, TRACES, base_folder, lives, runs
from rig.live.stopping import request_stop
from rig.system.closing import Closing
from rig.tick.layout import recorded_row

TRIES = 20
"""Attempts to read a whole frame while the run writes; chosen: 2 ms in all, a write takes microseconds."""


class Frame(NamedTuple):
    """The present state of a run."""

    state: np.void
    """Record of `rig.live.layout.FRAME`."""
    window: NDArray[np.void]
    """The last rows, as they are recorded."""
    age_s: float
    """Time since it was written, s."""


class LiveRun(Closing):
    """A run that is under way, or was when it was opened: what was published last can still be read.

    Raises:
        RecordingError: the run has ended before, or was started by another version.
    """

    generation = 0
    """Number of jumps of a replay so far; none here."""
    player = None
    """Controls of a replay; none here."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        try:
            self.facts = facts_from((folder / FACTS).read_bytes())
            self._rows = recorded_row(len(self.facts.channels))
            self._bin = bin_dtype(len(self.facts.channels))
            self._frames, self._traces = _mapped(folder / FRAME_FILE), _mapped(folder / TRACES)
            self._file = (folder / LINES).open("rb")
        except (OSError, ValueError) as error:
            raise RecordingError(f"{folder}: is not a run under way ({error})") from error
        if len(self._traces) != HEAD + BINS * self._bin.itemsize:
            self.close()
            raise RecordingError(f"{folder}: was published by another version of this program")
        self._lines: list[Line] = []
        self._rest = b""

    @property
    def connected(self) -> bool:
        """Whether the run's process lives."""
        return lives(self.folder)

    def frame(self) -> Frame | None:
        """Return the state that was published last; None before the first of a run, and between two of its parts."""
        for _ in range(TRIES):
            checksum = int.from_bytes(self._frames[:HEAD], "little")
            if not checksum:
                return None
            state = np.frombuffer(self._frames[HEAD : HEAD + FRAME.itemsize], FRAME)[0]
            size = FRAME.itemsize + int(state["window"]) * self._rows.itemsize
            if 0 < size <= len(self._frames) - HEAD:
                content = self._frames[HEAD : HEAD + size]
                if zlib.crc32(content) == checksum:
                    state = np.frombuffer(content[: FRAME.itemsize], FRAME)[0]
                    window = np.frombuffer(content[FRAME.itemsize :], self._rows)
                    return Frame(state, window, 1e-9 * (time.monotonic_ns() - int(state["written_ns"])))
            time.sleep(1e-4)
        return None

    def bins(self, first: int) -> tuple[int, NDArray[np.void]]:
        """Return the bins from number ``first`` on, as far as they are kept, and the number of the first of them."""
        count = self._n_bins()
        ring = np.frombuffer(self._traces[HEAD:], self._bin)
        first = max(first, self._n_bins() - BINS + 1, 0)  # what was overwritten while it was read is left out
        return first, ring[np.arange(first, max(count, first)) % BINS]

    def lines(self, first: int) -> list[Line]:
        """Return what was told so far, from number ``first`` on."""
        *whole, self._rest = (self._rest + self._file.read()).split(b"\n")
        for text in whole:
            with suppress(ValueError):
                self._lines.append(json.loads(text))
        return self._lines[first:]

    def request_stop(self, cause: str) -> None:
        """Ask the run to ramp down."""
        request_stop(self.folder, cause)

    def close(self) -> None:
        """Close what is open."""
        self._frames.close()
        self._traces.close()
        self._file.close()

    def _n_bins(self) -> int:
        return int.from_bytes(self._traces[:HEAD], "little")


def _mapped(path: Path) -> mmap.mmap:
    descriptor = os.open(path, os.O_RDONLY)
    try:
        return mmap.mmap(descriptor, 0, access=mmap.ACCESS_READ)
    finally:
        os.close(descriptor)


def run_into(recording: Path | None = None) -> LiveRun | None:
    """Return the run under way into a file, or the youngest of all; None if there is none."""
    for folder in runs():
        with suppress(RecordingError):
            run = LiveRun(folder)
            if recording is None or Path(run.facts.recording).resolve() == recording.resolve():
                return run
            run.close()
    return None


def left_behind(recording: Path | None = None) -> list[Path]:
    """Return the folders of runs whose process has ended without a word: of those into a file, or of all."""
    found = []
    for folder in base_folder().iterdir():
        if folder.name.startswith(".") or lives(folder):
            continue
        with suppress(RecordingError), LiveRun(folder) as run:
            if recording is None or Path(run.facts.recording).resolve() == recording.resolve():
                found.append(folder)
    return found

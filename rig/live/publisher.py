"""Publish a run in shared memory without blocking it; errors never reach the run.

Facts and lines are files that only grow. Frame and traces are memory of a fixed size, reserved at the start, so that writing to
it cannot fail: the frame carries a checksum by which a reader knows that it has read a whole one; a bin counts once the number
of bins has been raised.
"""

import mmap
import os
import time
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from pathlib import Path

import numpy as np

from rig.live.facts import RunFacts
from rig.live.layout import BIN_S, BINS, FRAME, HEAD, bin_dtype, put_bin, window_rows
from rig.live.place import FRAME_FILE, LINES, STOP, TRACES, new_folder, remove
from rig.live.stopping import stopping_on_request
from rig.live.time_left import time_left_s
from rig.loop.session import RunningLoop
from rig.recording.jsontext import encode
from rig.system.closing import Closing
from rig.tick.layout import recorded_row
from vibrolock.printable import error_text

FRAMES_PER_S = 30.0  # frames per second, at most; chosen: twice as often as the page looks
LATENESS_S = 1.0  # s between two statistics of the lateness; chosen


class Live:
    """Consumer of the state of a run. This one ignores everything: the run is not published."""

    def take(self, rows: np.ndarray, loop: RunningLoop, finished: int, total: int) -> None:
        """Take telemetry rows, with the loop as it is after them and the number of points that are over."""

    def line(self, what: str, told: Mapping[str, object]) -> None:
        """Take a point, an event, a remark or how the part began or ended: ``what`` is to be told of it."""

    @property
    def stop_requested(self) -> bool:
        """Whether a stop was requested."""
        return False

    def another_part(self) -> bool:
        """Say that one more part is going to be started; return whether it may be: not once a stop was requested."""
        return True

    def stopping_on_request(self, stop: Callable[[str], None]) -> AbstractContextManager[None]:
        """Let requests to stop reach ``stop`` while the rig is driven."""
        return nullcontext()


class Publisher(Live, Closing):
    """Publishes a run in a folder of its own, which is removed at the end.

    An error while the run goes on is told by a ``remark``, once; nothing more is published then.

    Raises:
        OSError, RecordingError: on construction: the folder or its memory cannot be had.
    """

    def __init__(self, facts: RunFacts, n_channels: int, remark: Callable[[str], None] = lambda text: None) -> None:
        self._remark = remark
        self._failed = False
        self.folder, self._lock = new_folder(encode(facts.to_json(), what="facts of the run"))
        try:
            rows = recorded_row(n_channels)
            self._recent: list[np.ndarray] = []  # chunks that hold the last rows, for the frame's window
            self._most_rows = window_rows(rows)
            self._frame = np.zeros(1, FRAME)
            self._frame["late_us"] = np.nan
            self._bins = np.zeros(1, bin_dtype(n_channels))
            self._rows: list[np.ndarray] = []  # of the bin that is not over
            self._n_bins = 0
            self._torn = False  # the last line, because the memory was full
            self._written = self._lateness = -np.inf
            self._lines = os.open(self.folder / LINES, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)
            self._frames = _reserved(self.folder / FRAME_FILE, HEAD + FRAME.itemsize + self._most_rows * rows.itemsize)
            self._traces = _reserved(self.folder / TRACES, HEAD + BINS * self._bins.itemsize)
        except BaseException:
            os.close(self._lock)
            remove(self.folder)
            raise

    def take(self, rows: np.ndarray, loop: RunningLoop, finished: int, total: int) -> None:
        """Add rows to the traces, and publish a frame if one is due."""
        if rows.size:
            self._carefully(lambda: self._take(rows, loop, finished, total))

    def _take(self, rows: np.ndarray, loop: RunningLoop, finished: int, total: int) -> None:
        self._recent.append(rows)
        while sum(chunk.size for chunk in self._recent[1:]) >= self._most_rows:
            del self._recent[0]
        self._add_to_traces(rows, loop)
        now = time.monotonic()
        state = int(rows["guard"][-1]), int(rows["lock"][-1])
        changed = state != (int(self._frame["guard"][0]), int(self._frame["lock"][0]))
        if changed or loop.tick.over or now - self._written >= 1.0 / FRAMES_PER_S:
            self._written = now
            self._publish(rows, loop, finished, total)

    def line(self, what: str, told: Mapping[str, object]) -> None:
        """Append a line. Where the memory is full, it is left out."""
        self._carefully(lambda: self._line(what, told))

    def _line(self, what: str, told: Mapping[str, object]) -> None:
        if what == "part":
            self._frame["part"] += 1
            self._rows.clear()
            self._recent.clear()
        text = encode({**told, "is": what}, what=what) + b"\n"
        with suppress(OSError):
            self._torn = os.write(self._lines, b"\n" + text if self._torn else text) < len(text)

    def another_part(self) -> bool:
        """Take back the frame, which says that the output is at 0 V; then look whether a stop was requested.

        In this order: whoever requests a stop and then still reads that frame has been heeded.
        """
        checksum, self._frames[:HEAD] = self._frames[:HEAD], bytes(HEAD)
        if self.stop_requested:
            self._frames[:HEAD] = checksum
            return False
        return True

    @property
    def begun(self) -> bool:
        """Whether a part has begun; before that nothing is driven."""
        return int(self._frame["part"][0]) > 0

    @property
    def stop_requested(self) -> bool:
        """Whether a request was left."""
        return (self.folder / STOP).exists()

    def stopping_on_request(self, stop: Callable[[str], None]) -> AbstractContextManager[None]:
        """Look for requests to stop, in a thread of its own."""
        return stopping_on_request(self.folder, stop)

    def close(self) -> None:
        """Remove the folder. Readers keep what they have open."""
        self._frames.close()
        self._traces.close()
        os.close(self._lines)
        remove(self.folder)
        os.close(self._lock)

    def _carefully(self, step: Callable[[], None]) -> None:
        """Run a step of publishing; whatever goes wrong with it, the test is more important than its picture."""
        if self._failed:
            return
        try:
            step()
        except Exception as error:
            self._failed = True
            self._remark(f"the run can no longer be watched ({error_text(error)}); requests to stop are still heeded")

    def _add_to_traces(self, rows: np.ndarray, loop: RunningLoop) -> None:
        self._rows.append(rows)
        rate = loop.tick.bench.sample_rate_hz
        if sum(part.size for part in self._rows) < BIN_S * rate:
            return
        taken = _joined(self._rows)
        self._rows.clear()
        level = float(loop.tick.arrays.progress["level"][0])
        part = int(self._frame["part"][0])
        put_bin(self._bins[0], taken, end_s=loop.tick.sample / rate, part=part, level=level)
        at = HEAD + (self._n_bins % BINS) * self._bins.itemsize
        self._traces[at : at + self._bins.itemsize] = self._bins.tobytes()
        self._n_bins += 1
        self._traces[:HEAD] = self._n_bins.to_bytes(HEAD, "little")

    def _publish(self, rows: np.ndarray, loop: RunningLoop, finished: int, total: int) -> None:
        frame, t = self._frame[0], loop.tick.arrays
        progress, guard, vibration = t.progress[0], t.guard[0], t.control["vibration"][0]
        frame["sample"], frame["lock"] = loop.tick.sample, rows["lock"][-1]
        # From the last row, not from the guard: where the driver has failed, nobody knows more of the output.
        frame["guard"] = rows["guard"][-1]
        for name in ("reason", "channel", "value"):
            frame[name] = guard[name]
        at = int(progress["segment"])
        segment = t.segments[at] if 0 <= at < t.segments.size else None
        frame["segment"] = at if segment is not None else -1
        for name in ("kind", "drive", "point"):
            frame[name] = -1 if segment is None else segment[name]
        frame["target"] = 0.0 if segment is None else segment["level"]
        frame["finished"], frame["total"] = finished, total
        frame["level"], frame["voltage_v"] = progress["level"], abs(rows["command_v"][-1])
        frame["frequency_hz"] = loop.tick.frequency_hz
        errors = rows["phase_error_rad"]
        known = errors[np.isfinite(errors)]
        frame["phase_error_rad"] = known.mean() if known.size else np.nan
        for name in ("force_n", "drive_m_s2", "displacement_m"):
            frame[name] = vibration[name]
        frame["good_periods"] = t.settling["good_periods"][0]
        frame["settled_periods"] = t.rule["settled_periods"][0]
        frame["left_s"] = time_left_s(t)
        frame["lost"], frame["overruns"] = t.loop["lost"][0], loop.statistics.overruns
        if self._written - self._lateness >= LATENESS_S:
            self._lateness = self._written
            frame["late_us"] = loop.lateness_us
        window = _joined(self._recent)[-self._most_rows :]
        frame["window"] = window.size
        frame["written_ns"] = time.monotonic_ns()
        content = self._frame.tobytes() + window.tobytes()
        self._frames[HEAD : HEAD + len(content)] = content
        self._frames[:HEAD] = zlib.crc32(content).to_bytes(HEAD, "little")


def _joined(chunks: list[np.ndarray]) -> np.ndarray:
    """Chunks of rows one after another. `numpy.concatenate` compares the fields of every two, which takes far longer."""
    return (
        np.frombuffer(b"".join(chunk.tobytes() for chunk in chunks), chunks[0].dtype) if len(chunks) > 1 else chunks[0]
    )


def _reserved(path: Path, size: int) -> mmap.mmap:
    """Return memory behind a file whose space is reserved: writing to it later must not find the memory full."""
    descriptor = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
    try:
        if hasattr(os, "posix_fallocate"):
            os.posix_fallocate(descriptor, 0, size)
        else:
            os.write(descriptor, bytes(size))
        return mmap.mmap(descriptor, size)
    finally:
        os.close(descriptor)


@contextmanager
def published(facts: RunFacts, n_channels: int, remark: Callable[[str], None]) -> Iterator[Live]:
    """Publish a run; where that cannot be done, say so in a ``remark`` and go on without.

    ``facts``: what does not change while it goes on.
    """
    try:
        publisher = Publisher(facts, n_channels, remark)
    except Exception as error:  # the same holds here
        remark(f"the run cannot be watched or stopped from another terminal: {error}")
        yield Live()
        return
    with publisher:
        try:
            yield publisher
        except BaseException as error:
            if not publisher.begun:  # a part that has begun says itself how it ended
                publisher.line("end", {"text": error_text(error), "tripped": False})
            raise

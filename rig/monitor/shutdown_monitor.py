"""Request a ramp-down of a run and poll until 0 V is confirmed or a timeout expires."""

import math
import time
from pathlib import Path
from typing import NamedTuple

from rig.errors import RecordingError
from rig.live.facts import text_in
from rig.live.place import lives
from rig.live.reader import LiveRun
from rig.live.stopping import request_stop
from rig.tick.safety.layout import GuardMode

HARDWARE = "USE THE HARDWARE STOP"
REST_S = 10.0
"""Time beyond the ramp for what a run may be doing: kernels that are compiled, a device that is opened, a block on its way."""


class Outcome(NamedTuple):
    """What has become of a run."""

    at_0_v: bool
    """Whether its output is known to be at 0 V."""
    text: str
    """In one line."""


class ShutdownMonitor:
    """Requests the ramp-down of the run in this folder and polls its outcome. Holds files open until `close`.

    ``timeout_s``: how long the output may take to be at 0 V; by default the run's own ramp and ten seconds.
    """

    def __init__(self, folder: Path, cause: str, timeout_s: float | None = None) -> None:
        self._folder, self._timeout_s = folder, timeout_s
        self._run: LiveRun | None = None
        self._began_s = time.monotonic()
        self._refused = ""
        try:
            request_stop(folder, cause)
        except RecordingError as error:
            self._refused = str(error)
        self._open()

    @property
    def name(self) -> str:
        """The recording of the run and its process."""
        if self._run is None:
            return f"process {self._folder.name.partition('-')[0]}"
        return f"{self._run.facts.recording} (process {self._run.facts.process})"

    def outcome(self) -> Outcome | None:
        """Return what has become of the run; None while that is not known."""
        alive = lives(self._folder)  # asked first: what was told last is read afterwards
        if self._run is None:
            self._open()
        frame = None if self._run is None else self._run.frame()
        guard = None if frame is None else GuardMode(int(frame.state["guard"]))
        lines = [] if self._run is None else self._run.lines(0)
        end = text_in(lines[-1], "text") if lines and lines[-1]["is"] == "end" else None
        if guard is GuardMode.OFF:
            return Outcome(True, "output at 0 V" if alive else "output at 0 V, the run is over")
        if not alive:
            if end is None:
                return Outcome(False, f"its process ended unexpectedly: {HARDWARE}")
            return Outcome(frame is None, f"the run is over: {end}" + ("" if frame is None else f": {HARDWARE}"))
        if self._refused:
            return Outcome(False, f"{self._refused}: {HARDWARE}")
        ramp_s = math.nan if self._run is None else self._run.facts.limits.ramp_down_s
        longest_s = REST_S + (ramp_s if math.isfinite(ramp_s) else 0.0) if self._timeout_s is None else self._timeout_s
        if (waited_s := time.monotonic() - self._began_s) < longest_s:
            return None
        last = "it has not begun; the request stays, and the state of its output is not known"
        if frame is not None and guard is not None:
            last = f"guard {guard.name.lower()}, {float(frame.state['voltage_v']):.3f} V, {frame.age_s:.1f} s ago"
        return Outcome(False, f"not at 0 V within {waited_s:.1f} s ({last}): {HARDWARE}")

    def close(self) -> None:
        """Close what is open."""
        if self._run is not None:
            self._run.close()

    def _open(self) -> None:
        try:
            self._run = LiveRun(self._folder)
        except RecordingError:  # about to begin, over, or of another version
            self._run = None

"""A run that a test writes: what its publisher would have told, line by line, without a loop."""

import threading
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from rig.bench import load_bench
from rig.campaigns.plans import load_plan
from rig.campaigns.running.watched import watched_facts
from rig.errors import RecordingError
from rig.live.facts import RunFacts
from rig.live.layout import FRAME, bin_dtype
from rig.live.reader import Frame
from rig.tick.layout import recorded_row
from rig.tick.safety.layout import EndReason, GuardMode

BENCH = "magnet-beam"


def facts(**changes: Any) -> RunFacts:
    """Facts of a backbone test of the magnet beam."""
    told = watched_facts(load_plan(f"{BENCH}/backbone"), load_bench(BENCH), Path("scripted.h5"), {})
    return replace(told, **changes)


def point(number: int) -> dict[str, Any]:
    """A point's line."""
    return {"is": "point", "number": number, "force_n": 0.1 * number, "harmonics": [[1.0, 2.0]] * 50}


class Scripted:
    """A `rig.live.reader.View` of which a test says what it shows."""

    generation = 0
    player = None

    def __init__(self, **changes: Any) -> None:
        self.facts = facts(**changes)
        self.told: list[dict[str, Any]] = []
        self.connected = True
        self.stops: list[str] = []
        self.refuses = False
        self.readings = 0
        self._state = np.zeros((), FRAME)
        self._bins = np.zeros(0, bin_dtype(len(self.facts.channels)))
        self._lock = threading.Lock()
        self.step()

    def step(self, mode: GuardMode = GuardMode.ARMED, reason: EndReason = EndReason.NONE, **values: float) -> None:
        """Publish another frame, and a bin of the traces."""
        with self._lock:
            state = self._state.copy()
            state["guard"], state["reason"], state["channel"] = mode, reason, -1
            state["sample"] += 500
            state["written_ns"] = time.monotonic_ns()
            for name, value in values.items():
                state[name] = value
            one = np.zeros(1, self._bins.dtype)
            one["end_s"] = 1e-4 * state["sample"]
            self._state, self._bins = state, np.concatenate([self._bins, one])

    def tell(self, *lines: dict[str, Any]) -> None:
        """Append lines."""
        self.told.extend(lines)

    def frame(self) -> Frame:
        """The last frame."""
        self.readings += 1
        with self._lock:
            age_s = 1e-9 * (time.monotonic_ns() - int(self._state["written_ns"]))
            window = np.zeros(0, recorded_row(len(self.facts.channels)))
            return Frame(self._state[()], window, age_s)

    def bins(self, first: int) -> tuple[int, np.ndarray]:
        """The bins from a number on."""
        with self._lock:
            return min(first, self._bins.size), self._bins[first:]

    def lines(self, first: int) -> list[dict[str, Any]]:
        """The lines from a number on."""
        return self.told[first:]

    def close(self) -> None:
        """Do nothing."""

    def request_stop(self, cause: str) -> None:
        """Keep the request."""
        if self.refuses:
            raise RecordingError("stop: cannot be written (No space left on device); use the hardware stop")
        self.stops.append(cause)

"""Times of a loop's blocks: how late each block began, how long it took, and what delayed it."""

import gc
import importlib.util
import sys
import time

from rig.loop.worker.memory import SharedMemory
from rig.loop.worker.pace import Pace


def disturbances() -> dict[str, int]:
    """Return counts of events so far that may delay a thread: modules imported, runs of the garbage collector.

    If the system counts them, involuntary context switches and major and minor page faults of this thread are included.
    """
    system: dict[str, int] = {}
    if importlib.util.find_spec("resource") is not None:
        import resource  # before modules are counted

        if hasattr(resource, "RUSAGE_THREAD"):
            used = resource.getrusage(resource.RUSAGE_THREAD)
            system = {"involuntary_switches": used.ru_nivcsw, "major_faults": used.ru_majflt}
            system["minor_faults"] = used.ru_minflt
    collections = sum(int(generation["collections"]) for generation in gc.get_stats())
    return {"imports": len(sys.modules), "collections": collections, **system}


def since(before: dict[str, int]) -> dict[str, int]:
    """Return the increase of the counts since ``before``."""
    now = disturbances()
    return {name: now[name] - count for name, count in before.items()}


STALL_NS = 1_000_000
"""Time from the release of a block to the sending of its outputs, above which the block counts as a stall."""

_now = time.monotonic_ns
_computed = time.thread_time_ns


class BlockTimes:
    """Counts the times of blocks into the histograms of the shared memory, and how many blocks were late.

    A *stall* is a block whose outputs are sent more than 1 ms after the block's release. In ``own_stalls`` the thread's own
    computing time since the previous block explains the delay; in the other stalls the thread was not running. Without a clock
    (`rig.loop.worker.pace.Pace`) no block can be late, and only the duration of a block is counted.
    """

    def __init__(self, pace: Pace, memory: SharedMemory, deadline_ns: int) -> None:
        self._pace, self._deadline_ns = pace, deadline_ns
        histograms = memory.histograms
        self._counts = histograms["wake_up"].add, histograms["execution"].add, histograms["response"].add
        self._begun_ns = 0
        self._computed_ns = _computed()
        self.late = self.stalls = self.own_stalls = self.busy_ns = 0

    def report(self) -> dict[str, int]:
        """Skipped periods and stalls, for the record."""
        return {"skipped_periods": self._pace.skipped, "stalls": self.stalls, "own_stalls": self.own_stalls}

    @property
    def overruns(self) -> int:
        """Number of late blocks and skipped periods."""
        return self.late + self._pace.skipped

    def begun(self, begun_ns: int) -> None:
        """Record that work on a block began at this time (monotonic clock, ns)."""
        self._begun_ns = begun_ns

    def done(self) -> int:
        """Record that the outputs of the block are sent now; return the time since the block's release, ns."""
        done = _now()
        begun = self._begun_ns
        if not begun:
            return 0
        release = self._pace.release(begun)
        self._begun_ns = 0
        self.busy_ns += done - begun
        count_wake_up, count_execution, count_response = self._counts
        count_execution(done - begun)
        if not self._pace.has_clock:
            return 0
        count_wake_up(begun - release)
        response = done - release
        count_response(response)
        computed = _computed()
        if response > STALL_NS:
            self.stalls += 1
            self.own_stalls += computed - self._computed_ns > STALL_NS
        self._computed_ns = computed
        self.late += response > self._deadline_ns
        return response

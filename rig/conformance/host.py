"""When this machine was too busy to judge a device by the clock."""

import threading
import time
from types import TracebackType
from typing import Self

__all__ = ["HostWatch"]

NAP_S = 0.002
LATE_S = 0.004  # beyond a nap: more than a quiet machine is, and far below what a device is judged by
AROUND_S = 0.1  # before and after: who was not run then may not have been run in between


class HostWatch:
    """Naps beside a test, and notes when it was woken late: then this machine was busy, and a late block proves nothing.

    A context manager. Times are those of `time.perf_counter`. A driver that keeps Python's lock for long makes it late too.
    """

    def __init__(self) -> None:
        self._late: list[tuple[float, float]] = []
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._nap, name="conformance-host-watch", daemon=True)

    def late_s(self, began_s: float, ended_s: float) -> float:
        """Longest time by which the host was late between two times, or shortly before or after, s; 0 if it was punctual."""
        first_s, last_s = began_s - AROUND_S, ended_s + AROUND_S
        near_s = [ended - began - NAP_S for began, ended in tuple(self._late) if began < last_s and ended > first_s]
        return max(near_s, default=0.0)

    def _nap(self) -> None:
        while not self._over.is_set():
            began = time.perf_counter()
            time.sleep(NAP_S)
            ended = time.perf_counter()
            if ended - began > NAP_S + LATE_S:
                self._late.append((began, ended))

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._over.set()
        self._thread.join()

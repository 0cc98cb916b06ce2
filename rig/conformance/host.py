"""When this machine was too busy to judge a device by the clock."""

import threading
import time
from pathlib import Path
from typing import Self

NAP_S = 0.002  # s between two looks at the clock; chosen: far below the lateness that is judged
LATE_S = 0.004  # beyond a nap: more than a quiet machine is, and far below what a device is judged by
AROUND_S = 0.1  # before and after: who was not run then may not have been run in between
FACTOR = 3.0  # a device in another process of this machine may be late by so much more than this one
PRESSURE = Path("/proc/pressure/cpu")


class HostWatch:
    """Naps beside a test, and notes when it was woken late: then this machine was busy, and a late block proves nothing.

    Where the system tells it (Linux), it also notes for how long any process had to wait for a processor, which may have been
    an emulated device. A context manager. Times are those of `time.perf_counter`. A driver that keeps Python's lock for long
    makes it late too.
    """

    def __init__(self) -> None:
        self._late: list[tuple[float, float]] = []
        self._waited: list[tuple[float, float]] = [(time.perf_counter(), _waited_s())]
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._nap, name="conformance-host-watch", daemon=True)

    def late_s(self, began_s: float, ended_s: float) -> float:
        """Time by which a device may have been late through this machine between two times, s; 0 if it was punctual."""
        first_s, last_s = began_s - AROUND_S, ended_s + AROUND_S
        near_s = [ended - began for began, ended in tuple(self._late) if began < last_s and ended > first_s]
        before = [waited for at, waited in tuple(self._waited) if at <= began_s]
        waited_s = _waited_s() - before[-1] if before else 0.0
        return max(FACTOR * max(near_s, default=0.0), waited_s if waited_s > LATE_S else 0.0)

    @staticmethod
    def stalls_alone(limit_s: float, for_s: float) -> bool:
        """Whether this machine keeps a thread that uses no device waiting for longer than a limit, within some seconds."""
        end_s = (before_s := time.perf_counter()) + for_s
        while before_s < end_s:
            now_s = time.perf_counter()
            if now_s - before_s > limit_s:
                return True
            before_s = now_s
        return False

    def _nap(self) -> None:
        while not self._over.is_set():
            began = time.perf_counter()
            time.sleep(NAP_S)
            ended = time.perf_counter()
            self._waited.append((ended, _waited_s()))
            if ended - began > NAP_S + LATE_S:
                self._late.append((began, ended))

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join()


def _waited_s() -> float:
    """Time for which some process had to wait for a processor since the system was started, s; 0 where that is not told."""
    try:
        return int(PRESSURE.read_text(encoding="ascii").partition("total=")[2].split()[0]) / 1e6
    except (OSError, ValueError, IndexError):
        return 0.0

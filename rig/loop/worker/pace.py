"""Due times of the loop's blocks: by the host's clock, by the device's clock, or without any clock."""

import math
import time

from rig.daq import DAQ

DRIFT = 2e-4  # the clocks of host and device differ by less
WINDOW_S = 0.2  # if no block is on time for so long, the device's clock counts as stopped for a while
WINDOW_BLOCKS = 20  # at least in such a window; chosen

_now = time.monotonic_ns
_sleep = time.sleep


class Pace:
    """Paces the blocks of a loop. This one is lockstep: the device waits for the host, and no block is due at any time."""

    by_device = True
    """Whether the device paces the loop."""
    has_clock = False
    """Whether time goes on without the loop, so that it can be late."""
    skipped = 0
    """Number of whole periods skipped so far because the loop was late by more than a period."""

    def begin(self) -> None:
        """Start the clock."""

    def wait(self) -> int:
        """Wait until the next block is due and return the time then (monotonic clock, ns); 0 at once if the exchange waits."""
        return 0

    def release(self, begun_ns: int) -> int:
        """Return when the block that began at ``begun_ns`` was due (monotonic clock, ns)."""
        return begun_ns


class HostPace(Pace):
    """Absolute deadlines of the host's monotonic clock: block j is due j + 1 periods after the start. Waiting never spins.

    Missed whole periods are skipped and counted, because a burst of blocks would sample at wrong times.
    """

    by_device = False
    has_clock = True

    def __init__(self, period_s: float) -> None:
        self._period_ns = 1e9 * period_s
        self._began = self._due = self._number = 0

    def begin(self) -> None:
        """Start the clock now."""
        self._began, self._number = _now(), 0

    def wait(self) -> int:
        """Sleep until the next block is due; return the time of waking."""
        self._number += 1
        self._due = self._began + int(self._number * self._period_ns)
        early = self._due - _now()
        if early > 0:
            _sleep(1e-9 * early)
        elif -early > self._period_ns:
            missed = int(-early // self._period_ns)
            self.skipped += missed
            self._number += missed
            self._due = self._began + int(self._number * self._period_ns)
        return _now()

    def release(self, begun_ns: int) -> int:
        """Return the deadline of the present block."""
        return self._due


class DevicePace(Pace):
    """The device's clock: block j was due j periods after the earliest arrival that any block so far allows.

    Every block that arrives still earlier renews the earliest arrival. The earliest arrival also grows by 200 ppm of the time,
    to follow a device whose clock is slower than its nominal rate. A block therefore counts as late if the transfer was late or
    the host took the block late. If all blocks of a fifth of a second are late by more than half a period, the device's own
    clock has paused, and the reference is set anew.
    """

    has_clock = True

    def __init__(self, period_s: float) -> None:
        self._period_ns = 1e9 * period_s
        self._window = max(WINDOW_BLOCKS, round(WINDOW_S / period_s))
        self._earliest = self._lately = math.inf
        self._number = 0

    def begin(self) -> None:
        """Take the next block as the first."""
        self._earliest = self._lately = math.inf
        self._number = 0

    def release(self, begun_ns: int) -> int:
        """Return when the block that arrived at ``begun_ns`` was due."""
        since = begun_ns - self._number * self._period_ns
        self._earliest = min(self._earliest + DRIFT * self._period_ns, since)
        self._lately = min(self._lately, since)
        due = self._earliest + self._number * self._period_ns
        self._number += 1
        if self._number % self._window == 0:
            if self._lately - self._earliest > 0.5 * self._period_ns:
                self._earliest = self._lately
            self._lately = math.inf
        return min(begun_ns, int(due))


def pacing_of(daq: DAQ) -> str:
    """Return what paces an open device: ``host``, ``device``, or neither (``lockstep``).

    A device that paces and is repeatable must wait for the host: with its own clock, no two runs would be identical.
    """
    capabilities = daq.capabilities
    return "host" if not capabilities.paced else "lockstep" if capabilities.repeatable else "device"


def pace_of(daq: DAQ) -> Pace:
    """Return the pace of a started device."""
    pacing, period_s = pacing_of(daq), daq.block / daq.sample_rate_hz
    return HostPace(period_s) if pacing == "host" else DevicePace(period_s) if pacing == "device" else Pace()

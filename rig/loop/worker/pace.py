"""When a block of the loop is due: by the host's clock, by the device's clock, or without any clock."""

import math
import time
from collections.abc import Callable
from typing import Protocol

from rig.daq import DAQ

__all__ = ["DevicePace", "HostPace", "Lockstep", "Pace", "pace_of", "pacing_of"]

DRIFT = 2e-4  # the clocks of host and device differ by less
WINDOW_S = 0.2  # without a block on time, after which the device's clock is taken to have stopped for a while
WINDOW_BLOCKS = 20

_now = time.monotonic_ns
_sleep = time.sleep


class Pace(Protocol):
    """Waits for the blocks of a loop."""

    by_device: bool
    """Whether the device paces the loop."""
    has_clock: bool
    """Whether time goes on without the loop, so that it can be late."""

    def wait(self) -> None:
        """Until the next block is due; at once where `DAQ.exchange` waits."""

    def release(self, begun_ns: int) -> int:
        """When the block that has begun at a time was due (monotonic clock, ns)."""

    def begin(self) -> None:
        """Start the clock."""

    @property
    def skipped(self) -> int:
        """Periods that were left out so far because the loop came too late for them altogether."""


class HostPace:
    """Absolute deadlines of the host's monotonic clock: block j is due j + 1 periods after the beginning. It never spins.

    Whole periods that have been missed are skipped and counted, because a burst of blocks would sample at wrong times.
    """

    by_device = False
    has_clock = True

    def __init__(self, period_s: float) -> None:
        self._period_ns = 1e9 * period_s
        self._began = self._due = self._number = 0
        self._skipped = 0

    @property
    def skipped(self) -> int:
        """Periods skipped so far."""
        return self._skipped

    def begin(self) -> None:
        """The clock runs from now on."""
        self._began, self._number = _now(), 0

    def wait(self) -> None:
        """Sleep until the next block is due."""
        self._number += 1
        self._due = self._began + int(self._number * self._period_ns)
        early = self._due - _now()
        if early > 0:
            _sleep(1e-9 * early)
        elif -early > self._period_ns:
            missed = int(-early // self._period_ns)
            self._skipped += missed
            self._number += missed
            self._due = self._began + int(self._number * self._period_ns)

    def release(self, begun_ns: int) -> int:
        """The deadline that was waited for."""
        return self._due


class DevicePace:
    """The device's clock: block j was due j periods after the earliest arrival that any block so far allows.

    The earliest is renewed by every block that comes earlier still, and grows by 200 ppm of the time to follow a device whose
    clock is slower than its nominal rate. So what is late is what came late over the wire or was picked up late. Where every
    block of a fifth of a second came later by half a period, the device's own clock has stood still: it counts anew.
    """

    by_device = True
    has_clock = True
    skipped = 0

    def __init__(self, period_s: float) -> None:
        self._period_ns = 1e9 * period_s
        self._window = max(WINDOW_BLOCKS, round(WINDOW_S / period_s))
        self._earliest = self._lately = math.inf
        self._number = 0

    def begin(self) -> None:
        """The next block is the first."""
        self._earliest = self._lately = math.inf
        self._number = 0

    def wait(self) -> None:
        """Do nothing: the exchange waits."""

    def release(self, begun_ns: int) -> int:
        """When the block that arrived at this time was due."""
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


class Lockstep:
    """A device that waits for the host at every block: no clock runs, and no block is due at any time."""

    by_device = True
    has_clock = False
    skipped = 0

    def begin(self) -> None:
        """Nothing."""

    def wait(self) -> None:
        """Nothing: the exchange waits."""

    def release(self, begun_ns: int) -> int:
        """The time of its arrival."""
        return begun_ns


def pacing_of(daq: DAQ) -> str:
    """What paces an open device: ``host``, ``device``, or neither (``lockstep``).

    One that paces and is repeatable must wait for the host: with a clock of its own, no two runs would be alike.
    """
    capabilities = daq.capabilities
    return "host" if not capabilities.paced else "lockstep" if capabilities.repeatable else "device"


def pace_of(daq: DAQ) -> Pace:
    """The pace of a started device."""
    period_s = daq.block / daq.sample_rate_hz
    paces: dict[str, Callable[[], Pace]] = {
        "host": lambda: HostPace(period_s),
        "device": lambda: DevicePace(period_s),
        "lockstep": Lockstep,
    }
    return paces[pacing_of(daq)]()

"""When a block of the loop is due: by the host's clock, or by the device's."""

import time
from typing import Protocol

from rig.daq import DAQ

__all__ = ["DevicePace", "HostPace", "Pace", "pace_of"]

DRIFT = 2e-4  # crystals of host and device differ by less

_now = time.monotonic_ns
_sleep = time.sleep


class Pace(Protocol):
    """Waits for the blocks of a loop."""

    by_device: bool
    """Whether the device's clock paces the loop."""

    def wait(self) -> None:
        """Until the next block is due; at once where `DAQ.exchange` waits."""

    def release(self, begun_ns: int) -> int:
        """When the block that has begun at a time was due (monotonic clock, ns)."""

    def begin(self) -> None:
        """The clock runs from now on."""

    @property
    def skipped(self) -> int:
        """Periods that were left out so far because the loop came too late for them altogether."""


class HostPace:
    """Absolute deadlines of the host's monotonic clock: block j is due j + 1 periods after the beginning. Never spins.

    What is late by whole periods goes on from the present, for a burst of blocks would sample at wrong times: these periods
    are skipped, and counted.
    """

    by_device = False

    def __init__(self, period_s: float) -> None:
        self._period_ns = 1e9 * period_s
        self._began = self._due = self._number = 0
        self._skipped = 0

    @property
    def skipped(self) -> int:
        """Periods left out so far."""
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
    clock is slower than its nominal rate. So what is late is what came late over the wire or was picked up late.
    """

    by_device = True
    skipped = 0

    def __init__(self, period_s: float) -> None:
        self._period_ns = 1e9 * period_s
        self._earliest = 0.0
        self._number = 0

    def begin(self) -> None:
        """The next block is the first."""
        self._number = 0

    def wait(self) -> None:
        """Nothing: the exchange waits."""

    def release(self, begun_ns: int) -> int:
        """When the block was due that has arrived at a time."""
        since = begun_ns - self._number * self._period_ns
        grown = self._earliest + DRIFT * self._period_ns
        self._earliest = since if self._number == 0 else min(grown, since)
        due = self._earliest + self._number * self._period_ns
        self._number += 1
        return min(begun_ns, int(due))


def pace_of(daq: DAQ) -> Pace:
    """How a started device is paced."""
    period_s = daq.block / daq.sample_rate_hz
    return DevicePace(period_s) if daq.capabilities.paced else HostPace(period_s)

"""The loop process of a device that runs the loop itself: it collects rows and state, and hands them to the campaign."""

import os
import time
from collections.abc import Callable
from multiprocessing.connection import Connection

import numpy as np

from rig.errors import DaqError
from rig.loop.on_device import DeviceLoop
from rig.loop.worker.loop import NOTICE
from rig.loop.worker.memory import RELEASE_START, STOP, SharedMemory
from rig.tick.layout import ROW
from rig.tick.safety.layout import GuardMode

ROOM_S = 0.01  # between two looks for room in lockstep; chosen


class Collector:
    """Takes the rows of a loop on the device, and fills the ring that the campaign empties.

    ``state`` is the memory of the tick's state (`rig.loop.worker.memory.packed`). ``asked`` returns who has asked the process
    to end. Requests to end, a campaign that is gone and a ring that fills up start the ramp on the device; ``cause`` says why,
    unless the campaign has asked. A device that waits (``lockstep``) is left waiting while there is no room.
    """

    def __init__(
        self,
        loop: DeviceLoop,
        state: np.ndarray,
        memory: SharedMemory,
        facts: Connection,
        asked: Callable[[], str],
        *,
        lockstep: bool,
    ) -> None:
        self._loop, self._state, self._memory, self._asked, self._lockstep = loop, state, memory, asked, lockstep
        self._facts_descriptor = facts.fileno()
        self._parent = os.getppid()
        self._alone = self._released = self._stopped = False
        self._samples = self._filled = 0  # in all, and those of the chunk under way
        self.cause = ""

    def run(self) -> None:
        """Collect until the output is off; the device is stopped then."""
        began_ns = time.monotonic_ns()
        for readings, rows in self._loop.run():
            self._samples += rows.size
            self._hand_over(readings, rows, time.monotonic_ns() - began_ns)
            self._look_round()
        self._publish(time.monotonic_ns() - began_ns)

    def _hand_over(self, readings: np.ndarray, rows: np.ndarray, wall_ns: int) -> None:
        if self._alone or self._memory.free < 1:
            return
        slot, begin, end = self._memory.to_fill(), self._filled, self._filled + rows.size
        slot.readings[begin:end] = readings
        for name in ROW.names or ():
            slot.rows[name][begin:end] = rows[name]
        self._filled = end
        if end + rows.size > self._memory.layout.chunk:
            self._publish(wall_ns)

    def _publish(self, wall_ns: int) -> None:
        """Hand over the rows of the chunk under way."""
        if not self._filled:
            return
        slot = self._memory.to_fill()
        slot.head[:] = self._filled, self._samples, 0, 0, wall_ns
        self._filled = 0
        counts = list(self._loop.daq.counters.values())[: slot.counters.size]
        slot.counters[: len(counts)] = counts
        slot.state[:] = self._state
        self._memory.publish()
        try:
            os.write(self._facts_descriptor, NOTICE)
        except OSError:
            self._alone = True

    def _look_round(self) -> None:
        words, loop = self._memory.words, self._loop
        if words[RELEASE_START] and not self._released:
            self._released = True
            loop.release_start()
        if words[STOP]:
            self._end("")
        self._alone = self._alone or os.getppid() != self._parent
        if self._alone:
            self._end("the campaign's process is gone")
        elif self._memory.free <= self._memory.layout.reserve and not self._waited_for_room():
            self._end("the campaign did not take its rows, and the output was brought down before any was lost")
        if cause := self._asked():
            self._end(cause)

    def _waited_for_room(self) -> bool:
        while self._lockstep and self._memory.free <= self._memory.layout.reserve:
            if os.getppid() != self._parent or self._asked() or self._memory.words[STOP]:
                break
            time.sleep(ROOM_S)
        return self._lockstep

    def _end(self, cause: str) -> None:
        """Request the ramp, once; the first cause is kept."""
        if not self._stopped:
            armed = int(self._loop.tick.guard["mode"][0]) == GuardMode.ARMED
            self.cause = cause if armed and not self._memory.words[STOP] else ""
            self._stopped = True
            self._loop.request_stop()

    @property
    def failure(self) -> DaqError | None:
        """Why the loop failed, if it did."""
        return self._loop.failure

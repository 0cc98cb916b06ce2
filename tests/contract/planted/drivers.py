"""Good drivers that faults are planted in: a virtual rig with time of its own, with a clock, and without a witness.

Time is simulated: a driver's ``now_s`` goes on by what its calls would take. Nothing waits.
"""

from collections import deque

import numpy as np

from rig.daq import HELD
from rig.drivers.virtual import VirtualDAQ
from rig.drivers.virtual.driver import COUNTED
from rig.drivers.virtual.faults import OUTPUT_HELD
from rig.errors import DaqDisconnected

CALL_S = 50e-6


class TimedDAQ(VirtualDAQ):
    """A virtual rig whose calls take simulated time, and whose cable can be pulled."""

    plugged = True

    def __init__(self, bench, seed=0):
        super().__init__(bench, seed)
        self.now_s = 0.0

    def _exchange(self, voltages, inputs):
        self.now_s += CALL_S
        if not self.plugged:
            raise DaqDisconnected("virtual rig: unplugged; plug it in and run `rig resume`")
        super()._exchange(voltages, inputs)


class PacedDAQ(TimedDAQ):
    """A virtual rig with a clock: a call returns once its block is measured, an output that comes too late is dropped."""

    wall_clock = True
    queue = 2
    rate_share = 1.0
    """The clock's own rate over the sample rate that is declared."""

    def __init__(self, bench, seed=0):
        options = {**bench.driver.options, "queue_blocks": self.queue}
        driver = bench.driver.model_copy(update={"options": options})
        super().__init__(bench.model_copy(update={"driver": driver}), seed)

    @property
    def capabilities(self):
        return super().capabilities.model_copy(update={"paced": True, "repeatable": False})

    def _start(self):
        super()._start()
        self._began_s, self._blocks = None, 0
        self._held = deque([False] * self.queue)
        self._last_v = np.zeros(self.block)

    def _exchange(self, voltages, inputs):
        block_s = self.block / self.sample_rate_hz / self.rate_share
        self._began_s = self.now_s if self._began_s is None else self._began_s
        late = self.now_s > self._began_s + (self._blocks + self.queue) * block_s
        self._blocks += 1
        self._take(voltages, inputs, late)
        self.now_s = max(self.now_s, self._began_s + self._blocks * block_s)

    def _take(self, voltages, inputs, late):
        """Swap a block: one that is too late is replaced by the voltage before it, and flagged when it is put out."""
        if not late:
            self._last_v = np.full(self.block, voltages[-1])
        super()._exchange(self._last_v if late else voltages, inputs)
        self._held.append(late)
        if self._held.popleft():
            self.flags |= OUTPUT_HELD
            self._counts[COUNTED.index(HELD)] += self.block


class UnseenDAQ(VirtualDAQ):
    """A virtual rig whose converter nobody can look at, and which goes on with its last output until it gets another.

    As most devices do it starts with what it was left with.
    """

    output_v = None
    left_v = 0.0

    def _start(self):
        super()._start()
        self._exchanged.queue[:] = self.left_v
        self._exchanged.loopback.past[:] = self.left_v

    def _exchange(self, voltages, inputs):
        super()._exchange(voltages, inputs)
        self.left_v = float(voltages[-1])

    def _rest(self):
        super()._rest()
        self.left_v = 0.0


class QueuedUnseenDAQ(UnseenDAQ):
    """The same with a queue of one block, whose loopback shows the old output before the first new one."""

    def __init__(self, bench, seed=0):
        options = {**bench.driver.options, "queue_blocks": 1}
        driver = bench.driver.model_copy(update={"options": options})
        super().__init__(bench.model_copy(update={"driver": driver}), seed)


class LateHost(PacedDAQ):
    """A good device with a clock on a machine that is late by up to 20 ms at one block in ten, and once by half a second."""

    def __init__(self, bench, seed=0):
        super().__init__(bench, seed)
        self._draw = np.random.default_rng(seed)

    def _exchange(self, voltages, inputs):
        super()._exchange(voltages, inputs)
        self.now_s += 0.02 * self._draw.random() * (self._draw.random() < 0.1) + 0.5 * (self._blocks == 700)


class StopUnseen(UnseenDAQ):
    """A device without latency or filters, whose stop does nothing, and whose start brings its output to 0 V."""

    def __init__(self, bench, seed=0):
        options = {**bench.driver.options, "converter": {}}
        driver = bench.driver.model_copy(update={"options": options})
        super().__init__(bench.model_copy(update={"driver": driver}), seed)

    def _start(self):
        VirtualDAQ._start(self)

    def _stop(self):
        pass


class CloseUnseen(StopUnseen):
    """The same with a close that does nothing."""

    def _close(self):
        pass


GOOD = (VirtualDAQ, TimedDAQ, PacedDAQ, UnseenDAQ, QueuedUnseenDAQ)

"""A device that runs the loop, in the test's own process: a virtual rig with the tick of this computer, sample by sample."""

from collections import deque

import numpy as np

from rig.drivers.virtual import VirtualDAQ
from rig.errors import DaqTimeout
from rig.firmware.machine_code import kernels_digest
from rig.tick.layout import ROW, TickArrays
from rig.wire.messages import ROW_BYTES, Record, Rows, State

TOLD = ("loop", "control", "guard", "progress", "outcomes")
"""Arrays of the records of which the state tells."""


class LoopingDAQ(VirtualDAQ):
    """Loses the blocks ``lost_rows`` and the states ``lost_states`` on the way, and is silent from block ``silent_from`` on."""

    wall_clock = True
    loop = "device"
    loop_digest = kernels_digest()
    lost_rows: frozenset[int] = frozenset()
    lost_states: frozenset[int] = frozenset()
    silent_from = 1 << 60
    outcomes_from = 0
    """The states before this block do not tell the outcomes."""

    @property
    def loop_latency_samples(self):
        return 0.5 + self.filter_delay_samples

    obstacle = ""
    """Why the wire does not carry the rows."""

    def why_no_rows(self, block):
        return self.obstacle

    def why_no_room(self, sizes):
        return ""

    @property
    def counters(self):
        return {"lost_samples": 0}

    def load_loop(self, arrays, block):
        self.start(1)
        self.remote = InProcess(self, TickArrays(*(array.copy() for array in arrays)), block)
        return self.remote


class InProcess:
    """The run of a loop on a `LoopingDAQ`; ``asked`` lists what it was asked to do."""

    def __init__(self, daq, arrays, block):
        self.daq, self.arrays, self.block = daq, arrays, block
        self.expected = 0
        self.asked: deque[str] = deque()

    def begin(self):
        self.asked.append("begin")

    def take(self):
        number = self.expected // self.block
        if number >= self.daq.silent_from:
            raise DaqTimeout("the device is silent")
        readings = np.zeros((self.block, len(self.daq.channels)), np.float32)
        rows = np.zeros(self.block, ROW)
        self.daq.run_fused(self.arrays, readings, rows)
        self.expected += self.block
        if number in self.daq.lost_rows:
            return None, None
        told = [name for name in TOLD if name != "outcomes" or number >= self.daq.outcomes_from]
        pieces = (Record(TickArrays._fields.index(name), 0, getattr(self.arrays, name).tobytes()) for name in told)
        state = None if number in self.daq.lost_states else State(self.expected, tuple(pieces))
        return Rows(0, readings, rows.view(np.uint8).reshape(-1, ROW_BYTES)), state

    def ramp(self):
        self.asked.append("ramp")
        self.arrays.guard["stop_requested"] = 1

    def release(self):
        self.asked.append("release")
        self.arrays.progress["held_back"] = 0

    def agrees(self, name, array):
        return getattr(self.arrays, name).tobytes() == array.tobytes()

    def stop(self):
        self.asked.append("stop")
        self.daq.stop()

"""Drivers that a loop process opens in tests: virtual rigs that write down their output, or fail."""

import struct
import threading
import time
from pathlib import Path
from typing import ClassVar

from rig.daq import Capabilities, State
from rig.drivers.virtual import VirtualDAQ
from rig.errors import DaqBusy, DaqDisconnected, DaqWatchdog

OURS = (
    "log",
    "fails_after",
    "fails_with",
    "busy",
    "paced",
    "lockstep",
    "hangs_after",
    "opens_in_s",
    "latched",
    "late_blocks",
)


class NotingDAQ(VirtualDAQ):
    """A rig by the wall clock. ``log``: file of its outputs (float64); ``fails_after`` so many blocks it is unplugged."""

    wall_clock: ClassVar[bool] = True

    def __init__(self, bench, seed=0):
        options = dict(bench.driver.options)
        self.ours = {name: options.pop(name) for name in OURS if name in options}
        driver = bench.driver.model_copy(update={"options": options})
        super().__init__(bench.model_copy(update={"driver": driver}), seed)
        self.blocks = 0
        self.due = None

    @property
    def capabilities(self):
        paced = bool(self.ours.get("paced"))
        return Capabilities(largest_block=1000, paced=paced, virtual=True, repeatable=bool(self.ours.get("lockstep")))

    @property
    def latency_samples(self):
        later = self.ours.get("late_blocks", 0) * self.block if self.state is State.RUNNING else 0
        return super().latency_samples + later

    @property
    def identity(self):
        return {"model": "virtual rig with a log"}

    @property
    def latched(self):
        return self.ours.get("latched", "")

    def clear(self):
        self.ours["latched"] = ""

    def _start(self):
        if self.latched:
            raise DaqWatchdog(self.latched)
        super()._start()

    def _open(self):
        if self.ours.get("busy"):
            raise DaqBusy("port X is held by somebody else")
        threading.Event().wait(self.ours.get("opens_in_s", 0.0))

    def _exchange(self, voltages, inputs):
        self.blocks += 1
        if self.blocks > self.ours.get("fails_after", self.blocks):
            raise {"TypeError": TypeError}.get(self.ours.get("fails_with"), DaqDisconnected)("port X is gone")
        if self.blocks > self.ours.get("hangs_after", self.blocks):
            threading.Event().wait()
        if self.ours.get("paced") and not self.ours.get("lockstep"):
            self.due = (self.due or time.monotonic()) + self.block / self.sample_rate_hz
            time.sleep(max(0.0, self.due - time.monotonic()))
        if "log" in self.ours:
            with Path(self.ours["log"]).open("ab") as file:
                file.write(struct.pack(f"<{voltages.size}d", *voltages))
        super()._exchange(voltages, inputs)

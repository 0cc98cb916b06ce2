"""The two devices that the faults happen to: a driver in this process, and one behind the wire protocol."""

from typing import ClassVar

import numpy as np

from rig.bench import Bench
from rig.daq import LOST
from rig.drivers.virtual import VirtualDAQ
from rig.drivers.wire import WireDAQ, WireOptions
from rig.emulator import Device, Faults, VirtualPlant, Wiring
from rig.emulator.parameters import described
from rig.errors import DaqTimeout
from rig.wire.link import Link
from tests.reliability.faults.plant import BrokenRig
from tests.reliability.faults.table import Fault
from tests.rig.wire.memory_link import MemoryLink, MemoryWire

STALE_SAMPLES = 50
SKIPPED_SAMPLES = 37
LOST_OF_BLOCKS = 20
AFTER_S = 1.0  # in which a device without a host has to come to rest
LATE_S = 0.05


class HostKilledError(BaseException):
    """The host's process is gone: nothing that it would still do is done."""


class Watched:
    """What both devices note: the blocks that were handed over, and the rig behind."""

    broken: BrokenRig
    handed: list[np.ndarray]
    fault: Fault | None
    onset: int

    def due(self, kind: str) -> bool:
        """Whether a fault of the driver is to act with this block."""
        fault = self.fault
        return fault is not None and fault.part == "driver" and fault.kind == kind and self.broken.first >= self.onset


class VirtualRigInProcess(Watched, VirtualDAQ):
    """The virtual driver, exchanged block by block, with the faults that a driver may have."""

    run_fused = None

    def __init__(self, bench: Bench, seed: int, fault: Fault | None, onset: int, needed_v: float) -> None:
        super().__init__(bench, seed)
        self.fault, self.onset, self.handed = fault, onset, []
        self.broken = BrokenRig(self.rig, bench, seed, fault, onset, needed_v)
        self._kept: list[np.ndarray] = []

    def _exchange(self, voltages: np.ndarray, inputs: np.ndarray) -> None:
        if self.fault is None or self.fault.part != "driver":  # nothing of what follows, which takes as long as a block
            self.handed.append(voltages.copy())
            inputs[:], self.flags[:] = self.broken.step(voltages)
            return
        if self.due("times-out"):
            raise DaqTimeout("no block within the agreed time")
        if self.due("raises"):
            raise OSError("the library of the device has failed")
        self.handed.append(voltages.copy())
        if self.due("skips") and self.broken.first - self.onset < voltages.size:
            self.broken.step(np.full(SKIPPED_SAMPLES, voltages[0]))
        readings, self.flags[:] = self.broken.step(voltages)
        inputs[:] = self._handed_back(readings)

    def _handed_back(self, readings: np.ndarray) -> np.ndarray:
        self._kept = [*self._kept, readings][-(1 + STALE_SAMPLES // len(readings)) :]
        if self.due("nan-block"):
            return np.full_like(readings, np.nan)
        block = (self.broken.first - self.onset) // len(readings)
        if self.due("loses-all") or (self.due("loses-some") and block % LOST_OF_BLOCKS == 0):
            self.flags[:] |= LOST
            return np.full_like(readings, np.nan)
        if self.due("repeats"):
            self._kept = self._kept[:1]
            return self._kept[0]
        return self._kept[0] if self.due("stale") else readings


class BrokenPlant(VirtualPlant):
    """The plant of an emulated device, with the broken rig in place of the whole one."""

    def __init__(self, bench: Bench, seed: int, fault: Fault | None, onset: int, needed_v: float) -> None:
        self._given = (bench, seed, fault, onset, needed_v)
        super().__init__(bench, seed, Wiring(tuple(channel.name for channel in bench.channels)))
        self.before, self.broken = None, BrokenRig(self._rig, *self._given)  # nothing was measured while it was made

    def reset(self) -> None:
        """Back to rest."""
        super().reset()
        if getattr(self, "broken", None) is None or self.broken.first > 0:
            self.before, self.broken = getattr(self, "broken", None), BrokenRig(self._rig, *self._given)

    def step(self, voltages: np.ndarray) -> tuple[np.ndarray, int]:
        """As the whole plant's."""
        if self._raised.size != voltages.size:
            self._buffers_for(voltages.size)
        self._readings_v[:], self._raised[:] = self.broken.step(voltages)
        np.clip(self._readings_v, -self.range_v, self.range_v - self.v_per_count, out=self._readings_v)
        return self._counted()


class EmulatedRig(Watched, WireDAQ):
    """The wire protocol over a wire in memory, whose time goes on while the host waits; the loop runs in this process."""

    wall_clock: ClassVar[bool] = False

    def __init__(self, bench: Bench, seed: int, fault: Fault | None, onset: int, needed_v: float) -> None:
        super().__init__(bench, seed, WireOptions(queue_blocks=1))
        self.fault, self.onset, self.handed = fault, onset, []
        self._was_late = False
        self.wire = MemoryWire()
        self.clock = self.wire.clock
        plant = BrokenPlant(bench, seed, fault, onset, needed_v)
        self.plant = plant
        self.device = Device(plant, described(plant), MemoryLink(self.wire, host=False), faults=self._faults())
        self.wire.device = self.device

    def _faults(self) -> Faults:
        """Those that the emulator has itself; its times count from the start, its blocks from 1."""
        fault, at_s = self.fault, self.onset / self.sample_rate_hz
        known = {
            "silent": {"silent_after_s": at_s},
            "deaf": {"deaf_after_s": at_s},
            "reset": {"reset_after_s": at_s},
        }
        return Faults(**known.get(fault.kind, {})) if fault is not None and fault.part == "driver" else Faults()

    @property
    def broken(self) -> BrokenRig:  # type: ignore[override]
        """The rig that was driven: the device brings a fresh one to rest once it is stopped."""
        return self.plant.before or self.plant.broken

    def _make_link(self) -> Link:
        return MemoryLink(self.wire, host=True)

    def _exchange(self, voltages: np.ndarray, inputs: np.ndarray) -> None:
        if self.fault is not None and self.fault.part == "driver":
            self._act()
        self.handed.append(voltages.copy())
        super()._exchange(voltages, inputs)

    def _act(self) -> None:
        if self.due("unplugged") or self.due("host-killed"):
            self.wire.cut = True
        if self.due("host-killed"):
            raise HostKilledError
        if self.due("emergency-stop"):
            self.device.press_emergency_stop()
        self._disturb()

    def _disturb(self) -> None:
        """What happens to blocks on the wire, counted from the onset."""
        sender = self.device._sender
        if self.due("drops-some") or self.due("drops-all"):
            every = LOST_OF_BLOCKS if self.due("drops-some") else 1
            sender._faults = Faults(drop_every=every, drop_burst=1)
        elif self.due("late-block") and not self._was_late:
            self._was_late = True
            sender._faults = Faults(late_every=self.device._sampling.blocks + 1, late_s=LATE_S)

    def left_alone(self) -> None:
        """Time goes on without a host."""
        self.wire.cut = True
        self.wire.pass_time(AFTER_S)

"""Drivers over a wire under the contract: over a wire in memory, and over a pseudo-terminal to an emulator."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from rig.bench import Bench
from rig.conformance import DriverContract, last_output_v, with_loopback
from rig.daq import DAQ
from rig.drivers import make_daq
from rig.drivers.virtual import VirtualDAQ
from rig.drivers.wire import WireOptions
from rig.emulator.emulated import emulated
from tests.rig.rigs import bench_with
from tests.rig.wire.memory_link import MemoryDAQ


def known_inputs(bench: Bench, outputs: np.ndarray, block: int) -> np.ndarray:
    """What the rig behind an emulated device reads, without any wire."""
    with VirtualDAQ(bench) as known:
        known.start(block)
        return np.vstack([known.exchange(part.copy()) for part in outputs.reshape(-1, block)])


@dataclass
class Reached:
    """An emulated bench with a loopback, what its device writes down, and the virtual bench behind it."""

    bench: Bench
    log: Path
    virtual: Bench


@pytest.fixture(scope="module")
def serial_bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Reached]:
    log = tmp_path_factory.mktemp("serial") / "log"
    virtual = with_loopback(bench_with())
    with emulated(virtual, "serial", log_output=log) as bench:
        yield Reached(bench, log, virtual)


@pytest.fixture(scope="module")
def can_bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Reached]:
    log = tmp_path_factory.mktemp("can") / "log"
    virtual = with_loopback(bench_with())
    with emulated(virtual, "can", log_output=log) as bench:
        yield Reached(bench, log, virtual)


class InMemory(DriverContract):
    """The device is in this process, and its converter can be looked at."""

    def make_loopback(self) -> DAQ:
        return self.over(with_loopback(bench_with()))

    def make(self) -> DAQ:
        return self.over(bench_with())

    def over(self, bench: Bench) -> DAQ:
        return MemoryDAQ(bench, simulated=2)

    def known_inputs(self, outputs: np.ndarray, block: int) -> np.ndarray:
        return known_inputs(bench_with(), outputs, block)

    def now_s(self, daq: DAQ) -> float:
        return float(daq.wire.now_s)

    def pause(self, daq: DAQ, seconds: float) -> None:
        daq.wire.pass_time(seconds)

    def unplug(self, daq: DAQ) -> bool:
        daq.wire.cut = True
        return True

    def witness(self, daq: DAQ | None) -> float | None:
        if daq is None:
            return None
        daq.wire.pass_time(0.001)  # what was sent last arrives
        return float(np.abs(daq.device.output_v).max())


class TestLockstepInMemory(InMemory):
    pass


class TestByTheClockInMemory(InMemory):
    def over(self, bench: Bench) -> DAQ:
        return MemoryDAQ(bench, options=WireOptions(queue_blocks=2), lockstep=False, simulated=1)


class OverAPort(DriverContract):
    """The device is in another process and writes down its output."""

    reached: Reached
    long_run_blocks = 2000  # `rig conformance` looks at more
    late_blocks = 200  # none of which is ever late by as much as is allowed here
    late_s = prompt_s = 10.0  # the device is a process of this machine, which the tests keep busy

    def make(self) -> DAQ:
        return make_daq(self.reached.bench)

    def known_inputs(self, outputs: np.ndarray, block: int) -> np.ndarray:
        return known_inputs(self.reached.virtual, outputs, block)

    def witness(self, daq: DAQ | None) -> float | None:
        return last_output_v(self.reached.log)


class TestSerialEmulator(OverAPort):
    @pytest.fixture(autouse=True)
    def _reached(self, serial_bench: Reached) -> None:
        self.reached = serial_bench


class TestCanEmulator(OverAPort):
    @pytest.fixture(autouse=True)
    def _reached(self, can_bench: Reached) -> None:
        self.reached = can_bench


del DriverContract

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
from rig.drivers.wire import WireOptions
from rig.emulator.emulated import emulated
from tests.rig.rigs import bench_with
from tests.rig.wire.memory_link import MemoryDAQ


@dataclass
class Reached:
    """An emulated bench with a loopback, and what its device writes down."""

    bench: Bench
    log: Path


@pytest.fixture(scope="module")
def serial_bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Reached]:
    log = tmp_path_factory.mktemp("serial") / "log"
    with emulated(with_loopback(bench_with()), "serial", log_output=log) as bench:
        yield Reached(bench, log)


@pytest.fixture(scope="module")
def can_bench(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Reached]:
    log = tmp_path_factory.mktemp("can") / "log"
    with emulated(with_loopback(bench_with()), "can", log_output=log) as bench:
        yield Reached(bench, log)


class InMemory(DriverContract):
    """The device is in this process, and its converter can be looked at."""

    def make_loopback(self) -> DAQ:
        return self.over(with_loopback(bench_with()))

    def make(self) -> DAQ:
        return self.over(bench_with())

    def over(self, bench: Bench) -> DAQ:
        return MemoryDAQ(bench, simulated=2)

    def witness(self, daq: DAQ | None) -> float | None:
        if daq is None:
            return None
        daq.wire.pass_time(0.001)  # what was sent last arrives
        return float(np.abs(daq.device.output_v).max())


class TestLockstepInMemory(InMemory):
    pass


class TestByTheClockInMemory(InMemory):
    def over(self, bench: Bench) -> DAQ:
        return MemoryDAQ(bench, options=WireOptions(queue_blocks=2), lockstep=False, simulated=2)


class OverAPort(DriverContract):
    """The device is in another process and writes down its output."""

    reached: Reached

    def make(self) -> DAQ:
        return make_daq(self.reached.bench)

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

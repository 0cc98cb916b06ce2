"""Drivers over a wire under the contract: over a wire in memory, and over a pseudo-terminal to an emulator."""

from collections.abc import Iterator

import pytest

from rig.bench import Bench
from rig.conformance import DriverContract
from rig.daq import DAQ
from rig.drivers import make_daq
from rig.drivers.wire import WireOptions
from rig.wire.device.emulator import emulated
from tests.rig.rigs import bench_with
from tests.rig.wire.memory_link import MemoryDAQ


@pytest.fixture(scope="module")
def serial_bench() -> Iterator[Bench]:
    with emulated(bench_with(), "serial") as bench:
        yield bench


@pytest.fixture(scope="module")
def can_bench() -> Iterator[Bench]:
    with emulated(bench_with(), "can") as bench:
        yield bench


class TestLockstepInMemory(DriverContract):
    def make(self) -> DAQ:
        return MemoryDAQ(bench_with(), simulated=2)


class TestByTheClockInMemory(DriverContract):
    def make(self) -> DAQ:
        return MemoryDAQ(bench_with(), options=WireOptions(queue_blocks=2), lockstep=False, simulated=2)


class TestSerialEmulator(DriverContract):
    @pytest.fixture(autouse=True)
    def _reached(self, serial_bench: Bench) -> None:
        self.bench = serial_bench

    def make(self) -> DAQ:
        return make_daq(self.bench)


class TestCanEmulator(DriverContract):
    @pytest.fixture(autouse=True)
    def _reached(self, can_bench: Bench) -> None:
        self.bench = can_bench

    def make(self) -> DAQ:
        return make_daq(self.bench)


del DriverContract

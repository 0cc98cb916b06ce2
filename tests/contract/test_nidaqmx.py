"""The driver of NI devices under the contract, over the emulated device server in lockstep."""

from collections.abc import Iterator

import pytest
from nidaqmx.error_codes import DAQmxErrors

from rig.conformance import DriverContract
from rig.daq import DAQ
from rig.drivers.nidaqmx.driver import NiDaqmxDAQ
from rig.emulator.nidaqmx.faults import Injection
from tests.rig.drivers.nidaqmx.test_driver import Served, served


@pytest.fixture(scope="module")
def chassis() -> Iterator[Served]:
    with served() as one:
        yield one


class TestOverADeviceServer(DriverContract):
    """Each call takes some milliseconds, so that blocks are few and large."""

    blocks = (16, 64)
    long_run_blocks = 200
    late_s = prompt_s = 10.0  # the server is in this process, on a machine that the tests keep busy

    @pytest.fixture(autouse=True)
    def _chassis(self, chassis: Served) -> Iterator[None]:
        self.chassis = chassis
        yield
        chassis.server.calls.injections.clear()

    def make(self) -> DAQ:
        return NiDaqmxDAQ(self.chassis.bench())

    def witness(self, daq: DAQ | None) -> float | None:
        return abs(self.chassis.output_v)

    def unplug(self, daq: DAQ) -> bool:
        gone = DAQmxErrors.DEV_ABSENT_OR_UNAVAILABLE
        for call in ("ReadAnalogF64", "WriteAnalogF64"):  # the server, which is not gone, lets its tasks go
            self.chassis.server.calls.injections.append(Injection(call, gone, times=1_000_000))
        return True


del DriverContract

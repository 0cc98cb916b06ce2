"""The firmware under the contract of drivers, over every wire."""

from collections.abc import Iterator

import pytest

from rig.conformance import with_loopback
from rig.emulator.emulated import emulated
from tests.closed_loop.test_wires import bench_at
from tests.contract.test_wire import OverAPort, Reached
from tests.firmware.building import built


class Wire(OverAPort):
    """The firmware under sanitizers, in lockstep."""

    wire: str
    rate = "shipped"
    fd = True

    @pytest.fixture(autouse=True, scope="class")
    @classmethod
    def _reached(cls, tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
        log = tmp_path_factory.mktemp("firmware") / "log"
        bench = with_loopback(bench_at(cls.rate))
        assert bench is not None
        with emulated(bench, cls.wire, log_output=log, firmware=built("host-sanitized"), fd=cls.fd) as far:
            cls.reached = Reached(far, log, bench)
            yield


class TestSerial(Wire):
    wire = "serial"


class TestCanFd(Wire):
    wire = "can"


class TestClassicalCan(Wire):
    wire, rate, fd = "can", "1 kHz", False


del OverAPort

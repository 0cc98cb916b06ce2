"""A device made from the page alone, in a process of its own, and the serial driver: they understand each other."""

import contextlib
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from rig.bench import Bench, DriverChoice
from rig.conformance import DriverContract
from rig.drivers import make_daq
from rig.errors import DaqDisconnected, DaqEmergencyStop, DaqMismatch, DaqWatchdog
from tests.refused import refused
from tests.rig.rigs import bench_with
from tests.rig.wire.serial import page_device

pytestmark = pytest.mark.skipif(not hasattr(os, "openpty"), reason="no pseudo-terminals on this system")

RATE_HZ, QUEUE = 2000, 4
PATIENT = {"queue_blocks": QUEUE, "watchdog_s": 5.0, "timeout_s": 20.0}  # of machines that are busy


@contextlib.contextmanager
def device():
    with subprocess.Popen(
        [sys.executable, page_device.__file__, str(RATE_HZ)], stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            yield process, process.stdout.readline().strip()
        finally:
            process.kill()


@pytest.fixture
def port():
    """A device of the test's own: a latched one would be the next test's trouble."""
    with device() as (_, path):
        yield path


def bench_at(port: str, **options: object) -> Bench:
    """Two channels of the shipped bench, behind that device."""
    bench = bench_with()
    driver = DriverChoice(name="serial", options={"port": port, **PATIENT, **options})
    return bench.model_copy(
        update={"driver": driver, "sample_rate_hz": float(RATE_HZ), "channels": bench.channels[:2], "block": 10}
    )


class TestMadeFromThePage(DriverContract):
    late_s = prompt_s = 10.0  # the device is a process of this machine, which the tests keep busy

    @pytest.fixture(autouse=True)
    def _reached(self):
        with device() as (self.process, self.port):
            yield

    def make(self):
        return make_daq(bench_at(self.port))

    def unplug(self, daq):
        self.process.kill()
        return True


del DriverContract


def test_it_does_not_use_the_product():
    source = Path(page_device.__file__).read_text(encoding="utf-8")
    assert "rig." not in source
    assert "import rig" not in source


@pytest.mark.parametrize("block", [1, 10, 40])
def test_outputs_are_read_back_at_the_index_they_were_meant_for(port, block):
    rng = np.random.default_rng(block)
    volts = np.round(rng.uniform(-9.0, 9.0, (400 // block, block)), 3)
    for _ in range(20):  # a busy machine may be late with all of them
        inputs, flags = [], []
        with make_daq(bench_at(port)) as daq:
            daq.start(block)
            for one in volts:
                inputs.append(daq.exchange(one.copy()))
                flags.append(daq.flags.copy())
        if np.vstack(inputs)[:, 0].any():
            break
    driven, clean = np.vstack(inputs)[QUEUE * block :], np.concatenate(flags)[QUEUE * block :] == 0
    expected = volts.ravel()[: len(driven)]
    assert not np.vstack(inputs)[: QUEUE * block].any()
    clean[: np.flatnonzero(driven[:, 0])[0]] = False  # until the first output has come, nothing is held and flagged
    assert clean.any()  # a machine that is busy may be late with some
    np.testing.assert_allclose(driven[clean, 0], expected[clean], atol=1e-9)
    np.testing.assert_allclose(driven[clean, 1], expected[clean] / 2, atol=1.1e-3)


def test_it_says_who_it_is(port):
    with make_daq(bench_at(port)) as daq:
        assert daq.identity["model"] == "made from the page"
        assert daq.capabilities.largest_block == page_device.LIMITS[page_device.BLOCK][1]


def test_its_watchdog_is_told_with_its_error_and_cleared_when_it_is_asked_to(port):
    with make_daq(bench_at(port, watchdog_s=1.0)) as daq:
        daq.start(10)
        daq.exchange(np.full(10, 1.0))
        time.sleep(1.5)  # a host that does nothing is the subject
        with pytest.raises(DaqWatchdog):
            any(daq.exchange(np.full(10, 1.0)) is None for _ in range(400))
    with daq:
        assert daq.latched == "the device's watchdog had latched"
        with refused(DaqWatchdog, "had-latched"):
            daq.start(10)
        daq.clear()
        daq.start(10)
        assert np.isfinite(daq.exchange(np.zeros(10))).all()


def test_its_emergency_stop_is_told(port):
    with make_daq(bench_at(port)) as daq:
        daq.start(10)
        daq.exchange(np.full(10, 1.0))
        daq.emergency_stop()
        with pytest.raises(DaqEmergencyStop):
            any(daq.exchange(np.zeros(10)) is None for _ in range(400))


def test_other_channels_are_refused(port):
    bench = bench_at(port)
    with refused(DaqMismatch, "force-drive"):
        make_daq(bench.model_copy(update={"channels": bench_with().channels})).open()


def test_its_end_is_that_of_the_port():
    with device() as (process, path):
        daq = make_daq(bench_at(path))
        daq.open()
        daq.start(10)
        daq.exchange(np.zeros(10))
        process.kill()
        with refused(DaqDisconnected, "the-port-is-gone"):
            any(daq.exchange(np.zeros(10)) is None for _ in range(400))
        daq.close()

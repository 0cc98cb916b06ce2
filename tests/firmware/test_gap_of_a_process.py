"""The firmware as a process, by the clock: a host that is silent for some periods sees that the vibration went on.

What is asserted counts samples, which are the device's clock: it stands still while a busy machine does not run it.
"""

import time
from pathlib import Path

import numpy as np
import pytest

from rig.bench import DriverChoice
from rig.daq import CONTINUED, DAQ, HELD
from rig.drivers import make_daq
from rig.emulator.emulated import Emulator
from tests.firmware.building import built
from tests.rig.rigs import bench_with
from tests.waiting import LONG_S, wait_until

BLOCK = 125  # 25 ms
PERIOD = 105.713  # samples
VOLTS, COUNT_V = 1.0, 10.0 / 2**15
PATIENCE = {"watchdog_s": 60.0, "timeout_s": 60.0}


class Host:
    """Drives a sine, and keeps what the device says of every sample."""

    def __init__(self, daq: DAQ, log: Path) -> None:
        self.daq, self.log = daq, log
        self.put_out, self.flags = np.zeros(0), np.zeros(0, int)
        self._bits = {name: 1 << number for number, name in enumerate(daq.counters)}

    def exchange(self) -> None:
        self.daq.continuation["period_samples"] = PERIOD
        first = self.flags.size + self.daq.queue_samples
        self.daq.exchange(sine(np.arange(first, first + BLOCK)))
        self.put_out = np.append(self.put_out, self.daq.put_out)
        self.flags = np.append(self.flags, self.daq.flags)

    def seen(self, name: str) -> np.ndarray:
        """Whether a flag was up, by sample."""
        return self.flags & self._bits[name] > 0

    @property
    def measured(self) -> int:
        """Samples that the device has measured, as it logs them."""
        whole_lines = self.log.read_bytes().rpartition(b"\n")[0]
        return int(whole_lines[-100:].splitlines()[-1].split()[1])

    def drive_until_in_time(self) -> None:
        """Drive until the device has come no further than the next block, some times in a row."""
        in_time, until_s = 0, time.monotonic() + LONG_S
        while in_time < 10:
            self.exchange()
            in_time = in_time + 1 if self.measured <= self.flags.size else 0
            assert time.monotonic() < until_s, "this host never caught up"


def sine(index: np.ndarray) -> np.ndarray:
    """The output, V."""
    return VOLTS * np.sin(2.0 * np.pi / PERIOD * index)


@pytest.mark.parametrize("wire", ["serial", "can"])
def test_a_silent_host_is_told_that_its_vibration_went_on(wire: str, tmp_path: Path) -> None:
    bench, log = bench_with({"block": BLOCK}), tmp_path / "log"
    with Emulator(bench, wire, lockstep=False, log_output=str(log), firmware=built("host-sanitized")) as emulator:
        driver = DriverChoice(name=wire, options={**emulator.bench.driver.options, **PATIENCE})
        with make_daq(emulator.bench.model_copy(update={"driver": driver})) as daq:
            daq.start(BLOCK)
            host = Host(daq, log)
            host.drive_until_in_time()
            begin = host.flags.size
            wait_until(lambda: host.measured > begin + 6 * PERIOD, "six periods without outputs")
            end = host.measured
            while host.flags.size < end:
                host.exchange()
    in_gap = np.arange(host.flags.size) >= begin
    assert (host.seen(CONTINUED) & in_gap).sum() > 5 * PERIOD - BLOCK
    assert not (host.seen(HELD) & in_gap).any()
    missing = in_gap & ~np.isnan(host.put_out)
    assert missing.sum() > PERIOD
    assert not (missing & ~host.seen(CONTINUED)).any()
    off = np.abs(host.put_out - sine(np.arange(host.put_out.size)))
    assert off[missing].max() < 0.001 * VOLTS + 2 * COUNT_V
    assert emulator.counted["continued_blocks"] * BLOCK >= (host.seen(CONTINUED) & in_gap).sum()
    assert emulator.counted.get("watchdog_trips", 0) == 0

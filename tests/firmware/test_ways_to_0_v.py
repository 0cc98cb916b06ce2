"""The firmware by the clock brings its output to 0 V, as it logs it: hosts that are killed, silent or flood, emergency stops.

What is asserted counts samples, which are the device's clock: it stands still while a busy machine does not run it.
"""

import os
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from rig.bench import DriverChoice
from rig.daq import DAQ
from rig.drivers import make_daq
from rig.emulator.emulated import Emulator
from rig.errors import DaqEmergencyStop, DaqProtocol, DaqTimeout, DaqWatchdog
from tests.firmware.building import built
from tests.rig.emulator.host_process import BLOCK, RAMP_S
from tests.rig.emulator.test_emulator import RATE_HZ, WATCHDOG_S, is_down, logged, require_0_v_after_a_kill
from tests.rig.rigs import bench_with
from tests.waiting import LONG_S, wait_until

VOLTS = 0.2


@contextmanager
def driven(log: Path, wire: str = "serial", watchdog_s: float = WATCHDOG_S) -> Iterator[tuple[Emulator, DAQ]]:
    """A host in this process that has driven the firmware for a while."""
    with Emulator(
        bench_with({"block": BLOCK}), wire, lockstep=False, log_output=str(log), firmware=built("host-sanitized")
    ) as emulator:
        patience = {"watchdog_s": watchdog_s, "ramp_s": RAMP_S, "timeout_s": 60.0}
        driver = DriverChoice(name=wire, options={**emulator.bench.driver.options, **patience})
        with make_daq(emulator.bench.model_copy(update={"driver": driver})) as daq:
            daq.start(BLOCK)
            for _ in range(10):
                daq.exchange(np.full(BLOCK, VOLTS))
            wait_until(lambda: bool((logged(log)[2][-1:] > 0.99 * VOLTS).all()), "the output")
            yield emulator, daq


def exchange_until_it_ends(daq: DAQ) -> None:
    until_s = time.monotonic() + LONG_S
    while time.monotonic() < until_s:
        daq.exchange(np.full(BLOCK, VOLTS))


def require_ramp_after(since_s: float, log: Path) -> None:
    """The output was on its level, and in a straight way down by the watchdog's ramp in time."""
    at_s, first, volts = logged(log)
    nonzero, full = np.flatnonzero(volts), np.flatnonzero(volts > 0.99 * VOLTS)
    assert abs(first[nonzero[-1]] - first[full[-1]] - RAMP_S * RATE_HZ) <= 2 * BLOCK
    assert first[nonzero[-1]] - first[at_s > since_s][0] <= (WATCHDOG_S + RAMP_S) * RATE_HZ + 1 + BLOCK
    assert (np.diff(volts[full[-1] :]) <= 0.0).all()


def require_drop(log: Path) -> None:
    """The output was on its level, then at 0 V for good, with nothing in between."""
    volts = logged(log)[2]
    last = np.flatnonzero(volts)[-1]
    assert volts[last] > 0.99 * VOLTS
    assert not volts[last + 1 :].any()
    assert last + 1 < volts.size


def reopen(daq: DAQ) -> None:
    """Open again; the device of a busy machine may answer later than the driver waits for."""

    def is_open() -> bool:
        try:
            daq.open()
        except (DaqTimeout, DaqProtocol):
            return False
        return True

    daq.close()
    wait_until(is_open, "an answer")


def test_a_host_that_is_killed(tmp_path: Path) -> None:
    require_0_v_after_a_kill(tmp_path / "log", firmware=built("host"))


@pytest.mark.parametrize("wire", ["serial", "can"])
def test_a_host_that_falls_silent(wire: str, tmp_path: Path) -> None:
    log = tmp_path / "log"
    with driven(log, wire) as (emulator, daq):
        silent_s = time.monotonic()
        wait_until(lambda: is_down(log, silent_s), "0 V after the last output")
        require_ramp_after(silent_s, log)
        with pytest.raises(DaqWatchdog):
            exchange_until_it_ends(daq)
    assert emulator.counted["watchdog_trips"] == 1


def test_a_host_that_sends_nothing_but_garbage(tmp_path: Path) -> None:
    log = tmp_path / "log"
    with driven(log) as (emulator, daq):
        line = daq._connection.link._descriptor  # type: ignore[attr-defined]
        garbage = np.random.default_rng(1).bytes(4096)
        since_s = time.monotonic()

        def flooded() -> bool:
            for _ in range(100):
                try:
                    os.write(line, garbage)
                except BlockingIOError:
                    break
            return is_down(log, since_s)

        wait_until(flooded, "0 V in a flood of garbage")
        require_ramp_after(since_s, log)
    assert emulator.counted["watchdog_trips"] == 1
    assert emulator.counted["damaged_frames"] > 0


@pytest.mark.parametrize("wire", ["serial", "can"])
@pytest.mark.parametrize("by", ["message", "signal"])
def test_an_emergency_stop(by: str, wire: str, tmp_path: Path) -> None:
    log = tmp_path / "log"
    with driven(log, wire, watchdog_s=60.0) as (emulator, daq):
        if by == "signal":
            emulator.press_emergency_stop()
        else:
            daq.emergency_stop(1)  # type: ignore[attr-defined]
        with pytest.raises(DaqEmergencyStop):
            exchange_until_it_ends(daq)
        require_drop(log)
        reopen(daq)
        assert daq.latched == "the device's emergency stop had latched"
        daq.clear()
        daq.start(BLOCK)
        daq.exchange(np.zeros(BLOCK))
    assert emulator.counted["emergency_stops"] == (1 if by == "signal" else 3)

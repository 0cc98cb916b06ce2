"""Emulators as processes: reached by ordinary benches, safe when the host dies."""

import itertools
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rig.bench import Bench, DriverChoice, load_bench
from rig.cli.emulate import _bench_text, _block, _write_bench
from rig.drivers import make_daq
from rig.drivers.can import CanOptions
from rig.emulator import VirtualPlant, Wiring
from rig.emulator.emulated import Emulator, emulated
from rig.emulator.plant import OutputLog
from rig.emulator.ports import device_end
from rig.emulator.process import Ready
from rig.emulator.settings import EmulatorSettings
from rig.errors import ConfigurationError, DaqBusy, DaqDisconnected, DaqEmergencyStop, DaqTimeout
from rig.wire.can.frames import BusTiming
from rig.wire.can.slcan_lines import opening
from tests.refused import refused
from tests.rig.drivers.test_wire import answers, virtual, voltages
from tests.rig.emulator.host_process import BLOCK, RAMP_S
from tests.rig.rigs import bench_with
from tests.waiting import LONG_S, wait_until

RATE_HZ = 5000.0
WATCHDOG_S = 2.0  # a host on a busy machine still feeds it


def rig_command(*arguments: str) -> list[str]:
    return [sys.executable, "-c", "from rig.cli import main; main()", *arguments]


@pytest.fixture(scope="module")
def serial_bench() -> Iterator[Bench]:
    with emulated(bench_with(), seed=3) as bench:
        yield bench


@pytest.fixture(scope="module")
def can_bench() -> Iterator[Bench]:
    with emulated(bench_with(), "can", seed=3) as bench:
        yield bench


@pytest.mark.parametrize("wire", ["serial", "can"])
def test_over_a_real_line_it_returns_bit_for_bit_what_the_virtual_driver_does(
    wire: str, request: pytest.FixtureRequest
) -> None:
    bench = request.getfixturevalue(f"{wire}_bench")
    for queue, block in ((1, 1), (1, 5), (3, 20)):
        options = {**bench.driver.options, "queue_blocks": queue}
        daq = make_daq(bench.model_copy(update={"driver": DriverChoice(name=wire, options=options)}))
        inputs, flags = answers(daq, block)
        np.testing.assert_array_equal(inputs, virtual(block, queue))
        assert not flags.any()


def test_a_port_that_somebody_holds_is_busy_and_free_afterwards(serial_bench: Bench) -> None:
    with make_daq(serial_bench), pytest.raises(DaqBusy):
        make_daq(serial_bench).open()
    with make_daq(serial_bench) as daq:
        assert daq.identity["model"] == "vibrolock emulator"


def test_what_is_reached_over_a_wire_cannot_be_emulated_itself(serial_bench: Bench) -> None:
    with refused(
        ConfigurationError,
        field="driver.name",
        value="serial",
        allowed="'virtual', for what is emulated is a virtual rig",
    ):
        VirtualPlant(serial_bench)


def test_its_emergency_stop_reaches_the_host_and_its_end_is_an_unplugged_cable() -> None:
    with Emulator(bench_with(), lockstep=True) as emulator:
        with make_daq(emulator.bench) as daq:
            daq.start(5)
            daq.exchange(np.zeros(5))
            emulator.press_emergency_stop()
            with pytest.raises(DaqEmergencyStop):
                all(daq.exchange(np.zeros(5)) is not None for _ in itertools.count())
        with make_daq(emulator.bench) as daq:
            assert daq.latched == "the device's emergency stop had latched"
            daq.clear()
            daq.start(5)
            daq.exchange(np.zeros(5))
            emulator.stop()
            with pytest.raises(DaqDisconnected):
                daq.exchange(np.zeros(5))


@contextmanager
def driving(port: str, watchdog_s: float) -> Iterator[subprocess.Popen[str]]:
    """A host in a process of its own that drives a device, and is killed at the latest when the block ends."""
    command = [sys.executable, "-m", "tests.rig.emulator.host_process", port, str(watchdog_s)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as host:
        try:
            assert host.stdout is not None
            assert host.stdout.readline() == "driving\n"
            yield host
        finally:
            host.kill()


def test_a_device_that_sends_other_channels_than_it_says_is_not_believed() -> None:
    options = {"timeout_s": 0.3}
    with emulated(bench_with(), options=options, faults={"channels_sent": 3}) as bench, make_daq(bench) as daq:
        daq.start(5)
        with refused(DaqTimeout, "malformed"):
            daq.exchange(np.zeros(5))
        assert daq.counters["malformed"] > 0


def test_a_host_that_is_killed_leaves_the_output_at_0_v_after_the_watchdog_s_ramp(tmp_path: Path) -> None:
    # How long the watchdog waits, tests/rig/emulator/test_device.py asks with a clock of its own.
    require_0_v_after_a_kill(tmp_path / "output.txt")


def require_0_v_after_a_kill(log: Path, **settings: Any) -> np.ndarray:
    """Kill a host that drives, and look at the output by the device's own clock; returns the log, as `logged`."""
    with Emulator(bench_with(), lockstep=False, log_output=str(log), **settings) as emulator:
        port = str(emulator.bench.driver.options["port"])
        with driving(port, WATCHDOG_S):
            killed_s = time.monotonic()
        dead_s = time.monotonic()
        wait_until(lambda: is_down(log, dead_s), "0 V after the host was killed")
    at_s, first, volts = logged(log)
    driven, full = np.flatnonzero(volts), np.flatnonzero(volts > 0.199)
    assert volts[at_s < killed_s][-1] == pytest.approx(0.2, abs=1e-3)
    assert abs(first[driven[-1]] - first[full[-1]] - RAMP_S * RATE_HZ) <= 2 * BLOCK  # samples are the device's clock
    assert (np.diff(volts[full[-1] :]) <= 0.0).all()
    assert first[driven[-1]] - first[at_s > dead_s][0] <= (WATCHDOG_S + RAMP_S) * RATE_HZ + 1 + BLOCK
    assert emulator.counted["watchdog_trips"] == 1
    return np.vstack([at_s, first, volts])


def is_down(log: Path, since_s: float) -> bool:
    """Whether the device has brought the output to 0 V since, and goes on sampling."""
    at_s, _, volts = logged(log)
    return bool((at_s[-6:] > since_s).all() and not volts[-6:].any())


def logged(path: Path) -> np.ndarray:
    """float64[3, n_blocks]: time, first sample, largest output; of whole lines."""
    text = path.read_text()
    return np.loadtxt(text[: text.rfind("\n")].splitlines(), unpack=True, ndmin=2)


def test_the_command_says_where_it_is_and_writes_a_bench_that_reaches_it(tmp_path: Path) -> None:
    link, file = tmp_path / "device", tmp_path / "emulated.toml"
    arguments = ["emulate", "serial", "--lockstep", "--link", str(link), "--bench-file", str(file), "--json"]
    with subprocess.Popen(rig_command(*arguments), stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        ready = json.loads(process.stdout.readline())
        assert ready["port"] == str(link)
        bench = load_bench(file)
        assert bench.block == ready["block"] == load_bench("magnet-beam").block
        assert bench.driver.name == "serial"
        assert bench.driver.options["port"] == str(link)
        assert link.is_symlink()
        with make_daq(bench) as daq:
            assert daq.identity["port"] == str(link)
        os.kill(process.pid, signal.SIGINT)
        assert json.loads(process.stdout.readline()) == {}
        assert process.wait(LONG_S) == 0
    assert not link.exists()


@pytest.mark.parametrize(
    ("rate_hz", "block", "lockstep", "largest", "written"),
    [
        (5000.0, 1, False, 65536, 10),
        (1100.0, 1, False, 65536, 3),  # 2.2 samples
        (5000.0, 25, False, 65536, 25),
        (20_000.0, 1, False, 32, 32),  # all that classical frames can number
        (5000.0, 1, True, 65536, 1),
    ],
)
def test_the_bench_it_writes_has_blocks_of_2_ms_where_the_clock_does_not_wait(
    tmp_path: Path, rate_hz: float, block: int, lockstep: bool, largest: int, written: int
) -> None:
    ready = Ready("serial", {"port": "/dev/ttyACM0"}, lockstep, "ordinary scheduling", largest)
    bench = load_bench("magnet-beam").model_copy(update={"sample_rate_hz": rate_hz, "block": block})
    file = tmp_path / "emulated.toml"
    file.write_text(_bench_text("magnet-beam", _block(bench, ready), ready, False), encoding="utf-8")
    assert load_bench(file).block == written


def test_driver_and_emulator_agree_on_a_data_bit_rate_that_adapters_have() -> None:
    default = CanOptions(channel="can0").data_bitrate
    assert EmulatorSettings(wire="can", bench=bench_with()).data_bitrate == default
    assert b"Y5" in opening(BusTiming(True, data_bit_rate_hz=default))


def test_what_cannot_be_emulated_is_refused_in_one_line() -> None:
    with refused(ConfigurationError, "there-is-no-such-channel", field="flip", value="nose"):
        Wiring(("force", "drive"), flip=("nose",))
    with refused(ConfigurationError, field="wire", value="usb"):
        Emulator(bench_with(), "usb")
    with refused(ConfigurationError, "allowed-version", field="faults"):
        Emulator(bench_with(), faults={"vers": 2})


def test_a_host_may_come_back_as_often_as_it_likes(serial_bench: Bench) -> None:
    expected = virtual(5)[:10]
    for _ in range(20):
        with make_daq(serial_bench) as daq:
            daq.start(5)
            inputs = np.vstack([daq.exchange(volts) for volts in voltages(5, 2)])
            np.testing.assert_array_equal(inputs, expected)
            assert not daq.remarks


def test_a_device_that_streams_to_a_dead_host_is_taken_over_by_the_next() -> None:
    watchdog_s = 600.0  # it is still streaming when the next host comes, however late that is
    with Emulator(bench_with(), lockstep=False, options={"watchdog_s": watchdog_s, "timeout_s": 60.0}) as emulator:
        with driving(str(emulator.bench.driver.options["port"]), watchdog_s):
            pass
        for found in ("still running", ""):
            with make_daq(emulator.bench) as daq:
                daq.start(250)
                inputs = np.vstack([daq.exchange(np.zeros(250)) for _ in range(8)])
                lost = np.isnan(inputs).any(axis=1)
                assert lost.sum() == daq.counters["lost_samples"] < lost.size  # a busy machine may lose some
                assert found in "".join(daq.remarks)


def test_a_link_left_behind_gives_way_and_one_in_use_does_not(tmp_path: Path) -> None:
    link = tmp_path / "device"
    settings = EmulatorSettings(wire="serial", bench=bench_with(), link=link)
    link.symlink_to("/dev/pts/999999")
    with device_end(settings) as (_, options):
        assert options["port"] == str(link)
        assert link.resolve().is_char_device()
        with (
            refused(ConfigurationError, "leads-to-already-end-the-emulator", field="link"),
            device_end(settings),
        ):
            pass
        assert link.is_symlink()
        link.unlink()
        link.symlink_to(tmp_path / "another")
    assert link.is_symlink()  # another's, by now
    link.unlink()
    link.write_text("notes")
    with refused(ConfigurationError, "cannot-be-made-file-exists", field="link"), device_end(settings):
        pass
    assert link.read_text() == "notes"


def test_a_full_disk_is_one_line_and_a_log_that_ends_does_not_end_the_device(tmp_path: Path) -> None:
    with refused(ConfigurationError, "bench-file-dev-full-cannot-be"):
        _write_bench(Path("/dev/full"), "base")
    with refused(ConfigurationError, "cannot-be-written", field="log_output"):
        OutputLog(tmp_path / "no" / "log")
    plant = VirtualPlant(bench_with())
    plant.log = OutputLog(Path("/dev/full"))
    for _ in range(3):
        assert plant.step(np.zeros(5))[0].shape == (5, 4)

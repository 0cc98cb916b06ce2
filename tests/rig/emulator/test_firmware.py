"""A firmware's program as the emulated device: what it is told, what is refused, and that it is the emulator's like."""

import itertools
import json
import os
import signal
import stat
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rig.bench import load_bench
from rig.drivers import make_daq
from rig.emulator.emulated import Emulator, emulated
from rig.emulator.firmware import description, started
from rig.emulator.plant import VirtualPlant
from rig.emulator.programs import is_for_arm
from rig.emulator.settings import EmulatorSettings
from rig.errors import ConfigurationError, DaqDisconnected, DaqEmergencyStop
from tests.firmware.building import built
from tests.refused import refused
from tests.rig.drivers.test_wire import answers, virtual
from tests.rig.emulator.test_emulator import rig_command
from tests.rig.rigs import bench_with
from tests.waiting import LONG_S

ARM_HEAD = b"\x7fELF\1\1\1" + bytes(9) + (2).to_bytes(2, "little") + (40).to_bytes(2, "little")


def program(folder: Path, text: str) -> Path:
    """A program that takes a description and then does as the text says."""
    path = folder / "device"
    path.write_text(f"#!/bin/sh\n{text}\n")
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return path


def refusal(firmware: Path, wire: str = "serial", **settings: Any) -> str:
    with pytest.raises(ConfigurationError) as error, emulated(bench_with(), wire, firmware=firmware, **settings):
        pass
    return str(error.value).replace("`", "")


def test_what_a_firmware_cannot_be_asked_for_is_refused_in_one_line(tmp_path: Path) -> None:
    path = program(tmp_path, "exit 0")
    assert "'drop_every'" in refusal(path, faults={"drop_every": 3})
    udp = refusal(path, "can", interface="udp_multicast", channel="239.0.0.1")
    assert "interface = 'udp_multicast'" in udp


def test_a_program_that_is_not_there_or_no_program_is_one_line(tmp_path: Path) -> None:
    gone = refusal(tmp_path / "gone")
    assert "cannot be read: No such file" in gone
    assert "make -C firmware" in gone
    text = tmp_path / "text"
    text.write_text("no program")
    assert "Permission denied" in refusal(text)


def test_a_program_that_refuses_its_description_is_a_configuration_error_with_its_words(tmp_path: Path) -> None:
    path = program(tmp_path, "echo 'no such wire' >&2; exit 2")
    assert refusal(path) == "firmware: refuses to be this device: no such wire"


def test_a_program_that_ends_by_itself_is_one_line_with_status_and_words(tmp_path: Path) -> None:
    path = program(tmp_path, "echo 'out of order' >&2; exit 5")
    with (
        refused(DaqDisconnected, "ended-by-itself-status-out-of"),
        emulated(bench_with(), firmware=path),
    ):
        pass
    settings = EmulatorSettings(wire="serial", bench=bench_with(), firmware=built("host"))
    with started(settings, VirtualPlant(settings.bench)) as firmware:
        firmware.child.kill()
        assert not firmware.serve(lambda: False)
        assert "status -9: it said nothing" in str(firmware.failure())


def test_an_image_for_arm_is_told_by_its_header(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    image, other = tmp_path / "image.elf", tmp_path / "other"
    image.write_bytes(ARM_HEAD)
    other.write_bytes(ARM_HEAD[:18] + (62).to_bytes(2, "little"))
    assert is_for_arm(image)
    assert not is_for_arm(other)
    assert "wire = 'can'" in refusal(image, "can")
    assert "lockstep = False" in refusal(image, lockstep=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    assert "qemu-system-arm" in refusal(image)


def test_the_description_says_what_the_device_is() -> None:
    bench = bench_with()
    plant = VirtualPlant(bench)
    lines = description(EmulatorSettings(wire="can", bench=bench, node=7, serial_number="a\nb", lockstep=True), plant)
    words = dict(line.split(" ", 1) for line in lines.splitlines()[:-1] if not line.startswith("channel"))
    assert lines.endswith("\nend\n")
    assert (words["wire"], words["node"], words["serial_number"], words["simulated"]) == ("can-fd", "7", "a?b", "2")
    assert float.fromhex(words["filter_delay_s"]) == plant.filter_delay_s
    assert [line.split()[1] for line in lines.splitlines() if line.startswith("channel")] == list(plant.names)
    assert "simulated 0" in description(EmulatorSettings(wire="serial", bench=bench, as_hardware=True), plant)
    assert "wire can\n" in description(EmulatorSettings(wire="can", bench=bench, fd=False), plant)


@pytest.mark.parametrize("wire", ["serial", "can"])
@pytest.mark.parametrize(("queue", "block"), [(1, 1), (1, 5), (3, 20)])
def test_it_returns_bit_for_bit_what_the_virtual_driver_does(wire: str, queue: int, block: int) -> None:
    options = {"queue_blocks": queue}
    with emulated(bench_with(), wire, seed=3, options=options, firmware=built("host")) as bench:
        inputs, flags = answers(make_daq(bench), block)
        np.testing.assert_array_equal(inputs, virtual(block, queue))
        assert not flags.any()


def test_wrong_wiring_is_the_emulator_s() -> None:
    wrong = {"flip": ("force",), "dead": ("drive",), "swap": (("acc_top", "acc_right"),)}
    names = [channel.name for channel in bench_with().channels]
    wrong["swap"] = ((names[-2], names[-1]),)
    seen = []
    for firmware in (None, built("host")):
        with emulated(bench_with(), seed=3, firmware=firmware, **wrong) as bench:
            seen.append(answers(make_daq(bench), 5)[0])
    np.testing.assert_array_equal(*seen)
    assert (seen[0] != virtual(5)).any()


def test_a_host_finds_a_device_that_was_started_anew_and_says_whether_it_moves() -> None:
    seen = []
    for as_hardware in (True, False):
        with (
            emulated(bench_with(), firmware=built("host"), as_hardware=as_hardware, serial_number="12") as bench,
            make_daq(bench) as daq,
        ):
            seen.append(daq.identity)
            assert daq.capabilities.virtual is not as_hardware
    assert {one["model"] for one in seen} == {"vibrolock firmware"}
    assert {one["serial_number"] for one in seen} == {"12"}
    assert seen[0]["boot"] != seen[1]["boot"]


def test_a_host_may_come_back_as_often_as_it_likes() -> None:
    with emulated(bench_with(), seed=3, firmware=built("host")) as bench:
        for _ in range(5):
            np.testing.assert_array_equal(answers(make_daq(bench), 5, 10)[0], virtual(5)[:50])


def test_its_emergency_stop_is_pressed_once_for_each_signal() -> None:
    with Emulator(bench_with(), lockstep=True, firmware=built("host")) as emulator:
        for _ in range(2):
            with make_daq(emulator.bench) as daq:
                daq.clear()
                daq.start(5)
                daq.exchange(np.zeros(5))
                emulator.press_emergency_stop()
                with pytest.raises(DaqEmergencyStop):
                    all(daq.exchange(np.zeros(5)) is not None for _ in itertools.count())
    assert emulator.counted["emergency_stops"] == 2


def test_the_command_runs_it_and_says_what_it_has_counted(tmp_path: Path) -> None:
    link, file, log = tmp_path / "device", tmp_path / "emulated.toml", tmp_path / "log"
    command = ["emulate", "serial", "--lockstep", "--firmware", str(built("host")), "--log-output", str(log), "--json"]
    with subprocess.Popen(
        rig_command(*command, "--link", str(link), "--bench-file", str(file)), stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        ready = json.loads(process.stdout.readline())
        assert ready["port"] == str(link)
        with make_daq(load_bench(file)) as daq:
            assert daq.identity["model"] == "vibrolock firmware"
            daq.start(5)
            daq.exchange(np.zeros(5))
        os.kill(process.pid, signal.SIGINT)
        assert json.loads(process.stdout.readline()) == {}
        assert process.wait(LONG_S) == 0
    assert not link.exists()
    assert [line.split()[2] for line in log.read_text().splitlines()][-1] == "0.000000"

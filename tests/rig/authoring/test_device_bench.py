"""Devices of this computer, and the bench that begins from one."""

import sys
import tomllib

import can
import pytest

from rig.authoring.device_bench import _roles
from rig.bench import load_bench
from rig.drivers import make_daq
from rig.emulator.emulated import emulated
from rig.wire.serial import port
from tests.rig.drivers.sound.card import Card
from tests.rig.rigs import bench_with


@pytest.fixture
def computer(monkeypatch, tmp_path):
    """A computer with a sound card of five inputs, a serial port and a CAN interface."""
    monkeypatch.setitem(sys.modules, "sounddevice", Card(gains=(1.0,) * 5, name="Box 6i2"))
    monkeypatch.setattr(port, "port_names", lambda: ["/dev/ttyACM0"])
    found = [{"interface": "socketcan", "channel": "can0"}]
    monkeypatch.setattr(can, "detect_available_configs", lambda interfaces: found)
    monkeypatch.chdir(tmp_path)


def test_devices_are_listed_as_lines_of_a_bench(computer, command):
    said, _, of_ni = command("list", "--devices").succeeded().out.partition("\n# NI devices: ")
    assert of_ni.startswith("NI-DAQmx is not installed on this computer")
    tables = [tomllib.loads(f"# {part}") for part in said.split("\n# ")]
    assert [table["driver"]["name"] for table in tables] == ["serial", "can", "sound"]
    assert tables[0]["driver"]["options"] == {"port": "/dev/ttyACM0"}
    assert tables[1]["driver"]["options"] == {"interface": "socketcan", "channel": "can0"}
    assert tables[2]["driver"]["options"] == {"device": "Box 6i2", "host_api": "ALSA"}
    assert "5 inputs, 2 outputs, 48000 Hz" in said


def test_a_missing_package_ends_nothing(computer, command, monkeypatch):
    monkeypatch.setitem(sys.modules, "sounddevice", None)
    monkeypatch.setitem(sys.modules, "can", None)
    said = command("list", "--devices").succeeded().out
    assert 'port = "/dev/ttyACM0"' in said
    assert "sounddevice is not installed" in said
    assert "CAN interfaces: " in said


def test_a_bench_begins_from_a_card(computer, command):
    said = command("new", "bench", "--from", "sound:box", "-o", "bench.toml").succeeded().out
    assert "rig calibrate" in said
    bench = load_bench("bench.toml")
    assert bench.driver.options["device"] == "Box 6i2"
    assert bench.sample_rate_hz == 12000.0
    assert [channel.role for channel in bench.channels] == ["force", "drive", "response", "response", "monitor"]
    assert bench.channels[-1].loopback


def test_a_bench_begins_from_a_port_and_leaves_sensors_that_are_there(computer, command, tmp_path):
    (tmp_path / "sensors.toml").write_text("# mine\n")
    command("new", "bench", "--from", "serial:/dev/ttyACM0", "-o", "bench.toml").succeeded()
    assert load_bench("bench.toml").driver.options == {"port": "/dev/ttyACM0"}
    assert (tmp_path / "sensors.toml").read_text() == "# mine\n"


def test_a_device_on_a_wire_says_its_channels_ranges_and_rates(computer, command, monkeypatch):
    with emulated(bench_with()) as reaching:
        name = str(reaching.driver.options["port"])
        monkeypatch.setattr(port, "port_names", lambda: [name])
        said = command("new", "bench", "--from", f"serial:{name}", "-o", "bench.toml").succeeded().out
        bench = load_bench("bench.toml")
        with make_daq(bench) as daq:  # which refuses channels, ranges and rates that are not the device's
            assert not [remark for remark in daq.remarks if "channel" in remark]
    assert "vibrolock emulator" in said
    assert [(channel.name, channel.role) for channel in bench.channels] == [
        (channel.name, channel.role) for channel in reaching.channels
    ]
    assert bench.sample_rate_hz == 5000.0
    assert bench.output_range_v == 10.0
    assert {channel.range_v for channel in bench.channels} == {10.0}


def test_a_device_that_does_not_answer_leaves_examples_and_says_so(computer, command):
    said = command("new", "bench", "--from", "serial:/dev/ttyACM0", "-o", "bench.toml").succeeded().out
    assert "did not say its own" in said
    assert "did not say its own" in load_bench("bench.toml").description


@pytest.mark.parametrize(
    ("names", "roles"),
    [
        (("a", "b", "c"), ["force", "drive", "response"]),
        (("drive", "x", "force", "loopback"), ["drive", "response", "force", "monitor"]),
        (("x", "drive", "y"), ["force", "drive", "response"]),
    ],
)
def test_roles_are_those_of_names_or_of_the_order(names, roles):
    assert _roles(names) == roles


@pytest.mark.parametrize("name", ["sound:other", "tdms:box", "sound"])
def test_a_device_that_is_not_there_is_told_with_those_that_are(computer, command, name):
    said = command("new", "bench", "--from", name, "-o", "bench.toml")
    if name == "sound":  # the only one of its driver
        said.succeeded()
        return
    assert said.status == 1
    assert "--from" in said.err
    assert "sound:Box 6i2 (ALSA)" in said.err

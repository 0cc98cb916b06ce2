"""The driver against an emulated device, over python-can's virtual bus and over an adapter behind a pseudo-terminal."""

from pathlib import Path
from uuid import uuid4

import numpy as np
import pytest

from rig.bench import load_bench
from rig.drivers.can import CanDAQ
from rig.drivers.virtual import VirtualDAQ
from rig.emulator import Device, VirtualPlant
from rig.emulator.parameters import described
from rig.errors import ConfigurationError, DaqDisconnected, DaqMismatch, DaqProtocol, DaqRefused
from rig.wire.can.bus import PythonCanBus
from rig.wire.can.frames import BusTiming
from rig.wire.can.link import CanLink
from rig.wire.can.protocol import definition
from rig.wire.can.slcan import SlcanBus
from rig.wire.messages import Parameter
from rig.wire.serial.port import open_pseudo_terminal
from tests.refused import refused
from tests.rig.wire.can.devices import bench_on, device_on, two_devices_on


def virtual_bus(channel: str, fd: bool, node: int = 1) -> PythonCanBus:
    return PythonCanBus("virtual", channel, BusTiming(fd, 1_000_000, 2_000_000), node)


def readings(daq: CanDAQ | VirtualDAQ, block: int, blocks: int = 200) -> np.ndarray:
    rng = np.random.default_rng(1)
    with daq:
        daq.start(block)
        out = [daq.exchange(rng.uniform(-1.0, 1.0, block)) for _ in range(blocks)]
        daq.stop()
    return np.concatenate(out)


def expected(block: int, queue_blocks: int) -> np.ndarray:
    bench = load_bench("magnet-beam")
    options = {**bench.driver.options, "queue_blocks": queue_blocks}
    driver = bench.driver.model_copy(update={"options": options})
    return readings(VirtualDAQ(bench.model_copy(update={"driver": driver})), block)


@pytest.mark.parametrize(("fd", "block", "queue_blocks"), [(True, 1, 1), (True, 10, 2), (False, 4, 1)])
def test_a_device_in_lockstep_returns_what_the_virtual_driver_returns_bit_for_bit(
    monkeypatch: pytest.MonkeyPatch, fd: bool, block: int, queue_blocks: int
) -> None:
    channel = uuid4().hex
    options = {"fd": fd, "queue_blocks": queue_blocks, "data_bitrate": 8_000_000}
    bench = bench_on("virtual", channel, block, **options)
    monkeypatch.setattr("rig.drivers.wire.connection.MOST_LOAD", 2.0)  # in lockstep 5 kHz may be too much for the wire
    with device_on(virtual_bus(channel, fd), fd):
        daq = CanDAQ(bench)
        np.testing.assert_array_equal(readings(daq, block), expected(block, queue_blocks))
    assert daq.counters["lost_samples"] == 0


def test_the_same_holds_behind_an_adapter_on_a_pseudo_terminal() -> None:
    line = open_pseudo_terminal()
    try:
        adapter = SlcanBus(line.descriptor, BusTiming(True), adapter=True)
        with device_on(adapter, True):
            for _ in range(2):  # the line lives on when the host has gone
                daq = CanDAQ(bench_on("slcan", line.path, 5))
                np.testing.assert_array_equal(readings(daq, 5), expected(5, 1))
                assert daq.counters["damaged_lines"] == daq.counters["garbage_bytes"] == 0
    finally:
        line.close()


def test_a_rate_that_the_bus_cannot_carry_is_refused_with_the_sum() -> None:
    channel = uuid4().hex
    with (
        device_on(virtual_bus(channel, False), False),
        refused(DaqRefused, "samples-s-x-us"),
    ):
        CanDAQ(bench_on("virtual", channel, 1, fd=False)).open()


@pytest.mark.parametrize(("block", "version"), [(10, "1"), (8, "2")])
def test_version_1_is_spoken_where_the_bus_has_no_room_for_version_2(block: int, version: str) -> None:
    channel = uuid4().hex
    with device_on(virtual_bus(channel, False), False):
        daq = CanDAQ(bench_on("virtual", channel, block, fd=False))
        np.testing.assert_array_equal(readings(daq, block), expected(block, 1))
        assert daq.identity["protocol"] == version
        assert ["no room for version 2" in remark for remark in daq.remarks].count(True) == (version == "1")
        assert daq.statistics["wire_load_share"] < 0.9


def test_a_device_that_speaks_version_2_alone_is_refused_where_the_bus_has_no_room_for_it() -> None:
    channel = uuid4().hex
    with device_on(virtual_bus(channel, False), False) as device:
        device.words[Parameter.LOWEST_VERSION, 0] = 2
        with refused(DaqRefused, "periods-s-x-us"):
            CanDAQ(bench_on("virtual", channel, 10, fd=False)).open()


def test_a_block_beyond_the_sequence_numbers_is_refused_when_opening() -> None:
    channel = uuid4().hex
    with (
        device_on(virtual_bus(channel, False), False),
        refused(DaqRefused, field="block", value=64),
    ):
        CanDAQ(bench_on("virtual", channel, 64, fd=False)).open()


def test_two_devices_under_one_node_are_noticed() -> None:
    channel = uuid4().hex
    with (
        two_devices_on(virtual_bus(channel, True), virtual_bus(channel, True)),
        refused(DaqProtocol, "two-devices"),
    ):
        CanDAQ(bench_on("virtual", channel)).open()


def test_two_devices_under_different_nodes_do_not_hear_each_other() -> None:
    channel = uuid4().hex
    with (
        device_on(virtual_bus(channel, True), True),
        device_on(virtual_bus(channel, True, 2), True, 2, serial_number="0002"),
        CanDAQ(bench_on("virtual", channel, node=2)) as daq,
    ):
        assert daq.identity["serial_number"] == "0002"


def test_a_device_with_another_definition_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "moved.dbc"
    path.write_text(definition(4, True).replace("BO_ 64 OutputIndex", "BO_ 112 OutputIndex"))
    channel = uuid4().hex
    with device_on(virtual_bus(channel, True), True), refused(DaqMismatch, "definition"):
        CanDAQ(bench_on("virtual", channel, dbc=str(path))).open()


def test_nobody_on_the_bus_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rig.drivers.wire.connection.FIND_TRIES", 2)
    with refused(DaqProtocol, "nothing-answers"):
        CanDAQ(bench_on("virtual", uuid4().hex)).open()


def test_a_missing_interface_port_or_backend_is_one_clear_line() -> None:
    with refused(DaqDisconnected, "dev-nowhere"):
        CanDAQ(bench_on("slcan", "/dev/nowhere")).open()
    with refused(DaqDisconnected, "nocan"):
        CanDAQ(bench_on("socketcan", "nocan7")).open()
    with refused(DaqRefused, "no-such-backend"):
        CanDAQ(bench_on("carrier-pigeon", "0")).open()
    with refused(ConfigurationError, field="node", value=16, allowed="less than or equal to 15"):
        CanDAQ(bench_on("virtual", "x", node=16))


def test_multicast_is_refused_where_there_is_a_network(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("rig.wire.can.bus.socket.if_nameindex", lambda: [(1, "lo"), (2, "eth0")])
    with refused(DaqRefused, "network-namespace"):
        CanDAQ(bench_on("udp_multicast", "239.74.163.2")).open()


def test_with_a_definition_of_version_1_version_1_is_spoken_at_either_end(tmp_path: Path) -> None:
    path = tmp_path / "version-1.dbc"
    path.write_text(definition(4, True, 1))
    channel = uuid4().hex
    with device_on(virtual_bus(channel, True), True):
        daq = CanDAQ(bench_on("virtual", channel, 10, dbc=str(path), data_bitrate=8_000_000))
        with daq:
            assert daq.identity["protocol"] == "1"
    plant = VirtualPlant(load_bench("magnet-beam"))
    link = CanLink(virtual_bus(channel, True), 4, BusTiming(True), dbc=path, device=True)
    device = Device(plant, described(plant, layout_crc=link.layout_crc), link)
    assert device.words[Parameter.HIGHEST_VERSION, 0] == 1

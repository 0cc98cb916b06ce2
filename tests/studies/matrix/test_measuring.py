"""Rows are measured: over an emulator, from the report on a device, and of a way that cannot be opened."""

import sys
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from rig.conformance.run import Finding
from rig.drivers import make_daq
from rig.emulator.sound import reaching_bench
from rig.wire.messages import EmergencyStop
from studies.matrix import measuring
from studies.matrix.measuring import device_row, matrix_rows
from studies.matrix.transports import Transport, at_rate, is_arm, transports
from tests.rig.rigs import bench_with

BENCH = bench_with()
STEP_MV = 1e3 * 20.0 / 65536.0  # 16 bit over 10 V each way
FACTS = {
    "driver": "serial",
    "identity": {"model": "board", "firmware": "1.2"},
    "sample_rate_hz": 5000.0,
    "reached_hz": 4999.7,
    "block": 10,
    "queue_blocks": 2,
    "blocks": 500,
    "held_blocks": 1,
    "lost_blocks": 0,
    "latency_samples": 20.5,
    "block_us": {"p50": 2000.0},
    "late_us": {"p99_9": 150.0, "largest": 400.0},
    "smallest_step_v": {"force": 1e-3},
    "statistics": {"round_trip_p50_us": 80.0},
    "recommendation": {"settings": {"largest_rate_hz": 8000.0, "watchdog_s": 0.1}},
}


@pytest.fixture
def one_way(monkeypatch):
    """Let only some ways be measured."""

    def only(*ways):
        monkeypatch.setattr(measuring, "transports", lambda firmware: list(ways))

    return only


def test_a_row_over_an_emulator_has_its_converter_and_the_time_to_0_v_that_a_witness_has_seen(one_way, monkeypatch):
    """In lockstep the ramp takes no time: the watchdog's second, and what the processes take."""
    monkeypatch.setattr(measuring, "LONGEST_LOOK_S", 120.0)  # of a busy machine
    one_way(Transport("serial", "serial"))
    (row,) = matrix_rows(BENCH)
    assert row.failure == ""
    assert row.resolution_mv == pytest.approx(dict.fromkeys(row.resolution_mv, STEP_MV), rel=1e-4)
    assert set(row.resolution_mv) == {channel.name for channel in BENCH.channels}
    assert (row.to_0v, row.watchdog_s) == ("measured", 1.0)
    assert row.to_0v_s >= 1.0
    assert row.held_blocks == row.lost_blocks == 0
    assert row.blocks > 0
    with make_daq(BENCH) as daq:
        filter_ms = 1e3 * daq.filter_delay_samples / BENCH.sample_rate_hz
    assert row.latency_ms == pytest.approx(
        2.0 + 0.1 + filter_ms, abs=1e-3
    )  # a queue of 10 samples, half a sample of hold
    assert row.verified is None


def test_a_row_of_the_virtual_driver_has_no_clock_and_no_watchdog(one_way):
    one_way(Transport("virtual"))
    (row,) = matrix_rows(BENCH)
    assert row.late_p99_9_ms is row.watchdog_s is row.to_0v_s is None
    assert row.to_0v == "ends with its process"
    assert row.resolution_mv == pytest.approx(dict.fromkeys(row.resolution_mv, STEP_MV), rel=1e-4)


def test_what_latched_while_settings_were_tried_does_not_spoil_the_row(one_way, monkeypatch):
    """The examination of an emulated device ends with a latch; it is cleared, for nothing moves."""
    examined = measuring.examine_bench

    def ends_latched(bench):
        facts = examined(bench)
        with make_daq(bench) as daq:
            daq.start(bench.block)
            daq.exchange(np.zeros(bench.block))
            for _ in range(3):
                daq._connection.link.send(EmergencyStop())
        return facts

    monkeypatch.setattr(measuring, "examine_bench", ends_latched)
    one_way(Transport("serial", "serial"))
    latched = []
    monkeypatch.setattr(measuring, "_driven", lambda bench, log: latched.append(_latched(bench)) or {})
    (row,) = matrix_rows(BENCH)
    assert latched == [""]
    assert row.blocks > 0


def _latched(bench):
    with make_daq(bench) as daq:
        return daq.latched


def test_what_the_suite_has_found_is_counted(one_way, monkeypatch):
    outcomes = [("a", "passed"), ("b", "failed"), ("c", "not applicable"), ("d", "passed"), ("e", "unproven")]
    found = [Finding(name, "", outcome, "why") for name, outcome in outcomes]
    monkeypatch.setattr(measuring, "check_driver", lambda bench, log: iter(found))
    one_way(Transport("virtual"))
    (row,) = matrix_rows(BENCH, verify=True)
    assert (row.verified.passed, row.verified.failed, row.verified.not_applicable) == (2, 1, 2)
    assert row.verified.failures == ("b: why",)
    assert row.verified.utc >= row.utc


def test_a_way_that_cannot_be_opened_is_a_row_that_says_why(one_way):
    one_way(Transport("none", "serial", settings={"interface": "slcan"}))
    (row,) = matrix_rows(BENCH)
    assert row.failure.startswith("ConfigurationError: ")
    assert row.block is None


def test_the_row_of_a_real_device_is_made_of_its_report_and_nothing_else_is_done_with_it():
    row = device_row(BENCH, FACTS)
    assert row.way == "serial board"
    assert row.device == "board 1.2"
    assert (row.block, row.queue_blocks, row.held_blocks, row.largest_rate_hz) == (10, 2, 1, 8000.0)
    assert (row.latency_ms, row.late_largest_ms, row.round_trip_p50_ms) == (4.1, 0.4, 0.08)
    assert (row.watchdog_s, row.to_0v, row.to_0v_s) == (0.1, "reported", None)
    assert row.resolution_mv == {"force": 1.0}


def test_the_row_of_a_device_that_has_latched_says_so():
    facts = {"driver": "serial", "identity": {}, "latched": "the device's watchdog had latched"}
    assert device_row(BENCH, facts).failure == "the device's watchdog had latched"


def test_time_to_0_v_is_that_of_the_first_block_at_rest_after_the_last_that_was_driven(tmp_path, monkeypatch):
    log = tmp_path / "log"
    log.write_text("1.0 0 0\n2.0 10 0.05\n3.0 20 0\n4.0 0 0.05\n4.1 10 0.05\n4.2 20 0.02\n4.3 30 0\n4.4 40 0\n4.5 5")
    assert measuring._seen_at_0_v(log) == 4.3
    monkeypatch.setattr(measuring, "LONGEST_LOOK_S", 0.05)
    log.write_text("1.0 0 0\n2.0 10 0.05\n")
    assert measuring._seen_at_0_v(log) is None
    assert measuring._seen_at_0_v(tmp_path / "nothing") is None


def elf(path, machine):
    path.write_bytes(b"\x7fELF\x01\x01\x01" + bytes(9) + b"\x02\x00" + machine.to_bytes(2, "little"))
    return path


def test_firmware_is_a_row_on_every_wire_by_the_clock_and_in_lockstep_and_for_arm_one_in_lockstep(
    tmp_path, monkeypatch
):
    host, arm = elf(tmp_path / "host-fw", 62), elf(tmp_path / "arm-fw", 40)
    asked = []

    @contextmanager
    def emulated(bench, wire, **settings):
        asked.append((wire, settings))
        yield bench

    monkeypatch.setattr("studies.matrix.transports.emulated", emulated)
    plain = len(transports())
    ways = transports([host, arm])[plain:]
    for way in ways:
        with way.opened(BENCH, tmp_path / "log") as bench:
            assert bench.block == 10
    assert [(wire, told["lockstep"], told.get("fd", True)) for wire, told in asked[:6]] == [
        (wire, lockstep, fd)
        for lockstep in (False, True)
        for wire, fd in (("serial", True), ("can", True), ("can", False))
    ]
    assert [told["firmware"] for _, told in asked] == [host] * 6 + [arm]
    assert asked[6][1]["lockstep"] is True
    assert "QEMU" in ways[6].name
    assert len({way.name for way in transports([host, arm])}) == plain + 7
    assert not is_arm(host)
    assert not is_arm(Path("nothing"))


def test_classical_can_has_half_the_rate_with_a_filter_below_it():
    way = next(way for way in transports() if "classical" in way.name)
    bench = way.scaled(BENCH)
    assert bench.sample_rate_hz == 2500.0
    assert bench.driver.options["converter"]["anti_alias_hz"] == pytest.approx(1000.0)
    assert np.isclose(BENCH.sample_rate_hz, 5000.0)


@pytest.mark.parametrize(("rate_hz", "block"), [(48000.0, 128), (12000.0, 32), (6000.0, 16)])
def test_a_bench_at_a_sound_card_has_a_block_of_a_period_at_each_rate(rate_hz, block):
    reaching = reaching_bench(BENCH, {"device": "structure", "device_rate_hz": 48000.0, "period_frames": 128})
    bench = at_rate(reaching, rate_hz)
    assert (bench.sample_rate_hz, bench.block) == (rate_hz, block)


def test_a_sound_card_is_left_out_with_a_word_where_its_packages_are_missing(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "sounddevice", None)
    assert not [way for way in transports() if way.wire == "sound"]
    assert "sounddevice is not installed" in capsys.readouterr().err

"""Emulator and firmware are the same device: the same script, every answer, heartbeat and block compared."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

from rig.wire.messages import Command, DeviceFlag, Parameter
from tests.firmware.building import built
from tests.firmware.comparing import differences, sort_out
from tests.firmware.differential import (
    choices_that_are_refused,
    compare,
    far_script,
    is_refused,
    random_script,
    run_firmware,
)
from tests.firmware.events import CAN, CAN_FD, SERIAL, Choice, Event, Kind
from tests.firmware.host import Host
from tests.firmware.python_device import PythonDevice

SEEDS = range(100, 120)
ACTIONS = 60
WIRES = [SERIAL, CAN, CAN_FD]


@pytest.fixture(scope="module")
def program() -> Path:
    return built("script")


@pytest.fixture(scope="module")
def hosts() -> list[Host]:
    """Hosts that have played their scripts to the emulator."""
    return [random_script(seed, ACTIONS) for seed in SEEDS]


def test_emulator_and_firmware_do_the_same(program: Path, hosts: list[Host]) -> None:
    for seed, host in zip(SEEDS, hosts, strict=True):
        firmware = run_firmware(program, host.python.script(host.events))
        assert [str(one) for one in differences(host.python, firmware)] == [], f"seed {seed}"


def test_the_scripts_come_to_all_that_can_happen(hosts: list[Host]) -> None:
    flags: Counter[int] = Counter()
    counted: Counter[str] = Counter()
    for host in hosts:
        counted += host.python.device.counts + Counter(host.python.link.counters)
        for block in host.python.link.flags:
            flags.update(flag for flag in DeviceFlag if block & flag)
    assert set(flags) == set(DeviceFlag)
    for name in (
        *("watchdog_trips", "emergency_stops", "held_blocks", "bad_outputs", "repeated_requests", "outputs_while_idle"),
        *("crc_errors", "oversize_frames", "malformed", "foreign_versions", "damaged_frames", "repeated_frames"),
        *("incomplete_blocks", "resynchronised", "foreign_frames"),
    ):
        assert counted[name] > 0, name
    assert {host.choice.wire for host in hosts} == set(WIRES)
    ramped = [block for host in hosts for block in host.python.plant.blocks if (block != block.round()).any()]
    assert ramped


@pytest.mark.parametrize("what", ["answer", "heartbeat", "output", "flags", "lost"])
def test_a_device_that_differs_is_found(program: Path, what: str) -> None:
    """What the firmware has said, with one bit of one message changed, or one message less."""
    host = far_script(Choice(CAN_FD, 4), blocks=300)
    sent = run_firmware(program, host.python.script(host.events))
    function = {"answer": 0x030, "heartbeat": 0x010, "output": 0x300, "flags": 0x300, "lost": 0x030}[what]
    places = [at for at, one in enumerate(sent) if one.kind == Kind.FRAME and _function(one) == function]
    at = places[len(places) // 2]
    data = bytearray(sent[at].data)
    data[{"flags": 4, "output": 5}.get(what, -1)] ^= 1
    changed = [] if what == "lost" else [sent[at]._replace(data=bytes(data))]
    assert differences(host.python, sent) == []
    assert differences(host.python, [*sent[:at], *changed, *sent[at + 1 :]])


def _function(event: Event) -> int:
    return int.from_bytes(event.data[:2], "little") & ~0xF


@pytest.mark.parametrize("wire", WIRES)
def test_nothing_differs_from_one_clock_to_the_other_where_sequence_numbers_wrap(wire: int, program: Path) -> None:
    host = far_script(Choice(wire, 2), blocks=600)
    assert host.python.device.measured > 600
    assert compare(program, host.choice, host.events) == []


@pytest.mark.slow
@pytest.mark.parametrize("wire", WIRES)
def test_nothing_differs_beyond_65536_blocks(wire: int, program: Path) -> None:
    host = far_script(Choice(wire, 1), blocks=2**16 + 100)
    assert host.python.device.measured > 2**16 + 100
    assert compare(program, host.choice, host.events) == []


def test_a_switch_that_stays_pressed_is_not_cleared(program: Path) -> None:
    host = Host(Choice(), random_script(1, 0).random)
    host.switch()
    for command in (Command.CLEAR, Command.START, Command.STOP):
        host.request(command)
    host.switch()
    host.request(Command.CLEAR)
    host.request(Command.GET, Parameter.STATE)
    assert compare(program, host.choice, host.events) == []


@pytest.mark.parametrize("block", [1, 4])
def test_of_an_instant_that_was_missed_the_block_is_dropped_and_indices_go_on(block: int, program: Path) -> None:
    host = far_script(Choice(SERIAL, 3), blocks=300, block=block)
    missed_us = host.events[len(host.events) // 4].time_us
    python = host.python
    script = python.script([*host.events, Event(missed_us, Kind.MISS)])
    sizes = [one.size for one in python.plant.blocks]
    ours = sort_out(python.choice, python.link.sent, sizes)
    theirs = sort_out(python.choice, run_firmware(program, script), sizes)
    (lost,) = {one.first for one in ours.rows} - {one.first for one in theirs.rows}
    expected = [one._replace(dropped=block * (one.first > lost)) for one in ours.rows if one.first != lost]
    for one, other in zip(expected, theirs.rows, strict=True):
        assert one._replace(counts=None).is_like(other._replace(counts=None))
        np.testing.assert_array_equal(one.counts, other.counts)
    assert theirs.counters[4] == 1
    assert ours.answers == theirs.answers


@pytest.mark.parametrize("choice", choices_that_are_refused(), ids=str)
def test_what_does_not_fit_the_protocol_is_refused(choice: Choice, program: Path) -> None:
    assert is_refused(program, choice)


def test_a_script_is_the_same_every_time(program: Path) -> None:
    first, second = (random_script(7, 20) for _ in range(2))
    script = first.python.script(first.events)
    assert script == second.python.script(second.events)
    assert run_firmware(program, script) == run_firmware(program, script)


def test_the_python_device_answers_as_the_page_says() -> None:
    """So that a difference cannot hide in an emulator that says nothing."""
    device = PythonDevice(Choice())
    assert len(device.link.sent) == 1  # the heartbeat after it was switched on

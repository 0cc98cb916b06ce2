"""Emulator and firmware are the same device: the same script, every answer, heartbeat and block compared."""

from collections import Counter
from pathlib import Path
from random import Random

import numpy as np
import pytest

from rig.wire.can.codec import CanCodec
from rig.wire.messages import ARM_KEY, Command, DeviceFlag, Message, Parameter, Samples, Stream
from rig.wire.serial.codec import Codec
from rig.wire.serial.frames import FrameReader, frame
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
from tests.firmware.events import CAN, CAN_FD, SERIAL, Choice, Event, Kind, frame_of, protocol_of
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


@pytest.mark.slow
def test_emulator_and_firmware_do_the_same(program: Path, hosts: list[Host]) -> None:
    for seed, host in zip(SEEDS, hosts, strict=True):
        firmware = run_firmware(program, host.python.script(host.events))
        assert [str(one) for one in differences(host.python, firmware)] == [], f"seed {seed}"


def test_disarmed_and_armed_20_us_apart_both_put_out_0_v(program: Path) -> None:
    host = random_script(990327, 150)
    assert [str(one) for one in differences(host.python, run_firmware(program, host.python.script(host.events)))] == []


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
    assert any(host.choice.lockstep and host.python.plant.blocks for host in hosts)
    ramped = [block for host in hosts for block in host.python.plant.blocks if (block != block.round()).any()]
    assert ramped


@pytest.mark.parametrize("what", ["answer", "heartbeat", "readback", "output", "flags", "lost"])
def test_a_device_that_differs_is_found(program: Path, what: str) -> None:
    """What the firmware has said, with one bit of one message changed, or one message less."""
    host = far_script(Choice(CAN_FD, 4), blocks=300, version=2)
    sent = run_firmware(program, host.python.script(host.events))
    function = {"answer": 0x030, "heartbeat": 0x010, "readback": 0x060, "output": 0x300, "flags": 0x300, "lost": 0x030}[
        what
    ]
    places = [at for at, one in enumerate(sent) if one.kind == Kind.FRAME and _function(one) == function]
    at = places[len(places) // 2]
    data = bytearray(sent[at].data)
    data[{"flags": 4, "output": 5}.get(what, -1)] ^= 1
    changed = [] if what == "lost" else [sent[at]._replace(data=bytes(data))]
    assert differences(host.python, sent) == []
    assert differences(host.python, [*sent[:at], *changed, *sent[at + 1 :]])


def _function(event: Event) -> int:
    return int.from_bytes(event.data[:2], "little") & ~0xF


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("wire", WIRES)
def test_nothing_differs_from_one_clock_to_the_other_where_sequence_numbers_wrap(
    wire: int, version: int, program: Path
) -> None:
    host = far_script(Choice(wire, 2), blocks=600, version=version)
    assert host.python.device.measured > 600
    assert compare(program, host.choice, host.events) == []


@pytest.mark.slow
@pytest.mark.parametrize("wire", WIRES)
def test_nothing_differs_beyond_65536_blocks(wire: int, program: Path) -> None:
    host = far_script(Choice(wire, 1), blocks=2**16 + 100)
    assert host.python.device.measured > 2**16 + 100
    assert compare(program, host.choice, host.events) == []


def test_a_switch_that_stays_pressed_is_not_cleared(program: Path) -> None:
    host = Host(Choice(), Random(1))
    host.switch()
    for command in (Command.CLEAR, Command.START, Command.STOP):
        host.request(command)
    host.switch()
    host.request(Command.CLEAR)
    host.request(Command.GET, Parameter.STATE)
    assert compare(program, host.choice, host.events) == []


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("wire", WIRES)
def test_what_the_wire_does_not_take_is_lost_and_counted_and_no_index_is_wrong(
    wire: int, version: int, program: Path
) -> None:
    """In version 2 while every block has its readback."""
    host = far_script(Choice(wire, 3), blocks=600, version=version)
    times_us = [event.time_us for event in host.events]
    silent_us = times_us[np.argmax(np.diff(times_us))]
    shut_us = times_us[len(times_us) // 4] if version == 1 else silent_us + 20_000
    events = [*host.events, Event(shut_us, Kind.SHUT), Event(shut_us + 300_000, Kind.OPEN)]
    ours = _heard(host, host.python.link.sent)
    theirs = _heard(host, run_firmware(program, host.python.script(events)))
    assert 0 < len(ours) - len(theirs) < 300
    for first, (counts, dropped) in theirs.items():
        np.testing.assert_array_equal(counts, ours[first][0])
        if wire == SERIAL:  # in every block; on a bus in heartbeats
            assert dropped == sum(one not in theirs for one in range(first))
    assert theirs[max(theirs)][1] == min(len(ours) - len(theirs), 255)


def _heard(host: Host, sent: list[Event]) -> dict[int, tuple[np.ndarray, int]]:
    """Blocks of one sample as a host understands them: counts and what the device has dropped, by index."""
    choice = host.choice
    stream = Stream(choice.n_channels, 1, 1000.0, choice.bits, 3)
    messages: list[Message | None] = []
    if choice.wire == SERIAL:
        codec = Codec()
        codec.version = host.version
        codec.configure(stream)
        messages += FrameReader(codec, {}).feed(b"".join(one.data for one in sent if one.kind == Kind.BYTES))
    else:
        bus = CanCodec(protocol_of(choice.n_channels, choice.fd, choice.node), False, {})
        bus.speak(host.version)
        bus.configure(stream)
        messages += [bus.decode(frame_of(one.data)) for one in sent if one.kind == Kind.FRAME]
    return {one.first: (one.counts, one.dropped) for one in messages if isinstance(one, Samples)}


EVERYTHING = [
    *(Choice(SERIAL, n_channels, bits) for n_channels, bits in ((1, 16), (31, 32))),
    *(Choice(CAN, n_channels, simulated=0) for n_channels in (1, 3, 4, 5, 8, 9, 16)),
    *(Choice(CAN_FD, n_channels, simulated=2) for n_channels in (1, 2, 4, 7, 15, 16, 31)),
]


@pytest.mark.parametrize("choice", EVERYTHING, ids=lambda choice: f"{choice.wire}-{choice.n_channels}")
def test_both_tell_the_same_of_every_parameter_and_item(choice: Choice, program: Path) -> None:
    host = Host(choice, Random(1))
    items = {item for _, item in host.python.device.words}
    for parameter in (*range(68), 255):
        for item in sorted(items | {8 * choice.n_channels, choice.n_channels, 255}):
            host.request(Command.GET, parameter, item)
    for version in (2, 1, 3, 0):
        host.request(Command.SET, Parameter.VERSION, 0, version)
        host.request(Command.GET, Parameter.LAYOUT_CRC)
    assert compare(program, choice, host.events) == []


def test_a_run_without_a_zero_at_the_very_end_of_a_frame(program: Path) -> None:
    host = Host(Choice(SERIAL, 1, simulated=2), Random(1))
    host.request(Command.SET, Parameter.BLOCK, 0, 125)
    host.request(Command.SET, Parameter.WATCHDOG_US, 0, 1_000_000)
    host.request(Command.START)
    host.request(Command.ARM, value=ARM_KEY)
    counts = np.frombuffer(bytes(range(1, 251)), "<i2")
    for number in range(1, 20):
        host.output(number, counts=np.roll(counts, number) // 2 | 0x0101)
        host.wait(125_000)
    sent = run_firmware(program, host.python.script(host.events))
    assert any(one.data[-256:-255] == b"\xff" for one in sent if one.kind == Kind.BYTES)  # 254 bytes and nothing behind
    assert differences(host.python, sent) == []


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


@pytest.mark.parametrize("versions", [(1, 2), (2, 1)])
@pytest.mark.parametrize("wire", WIRES)
def test_outputs_after_another_version_was_set_belong_to_no_stream(
    wire: int, versions: tuple[int, int], program: Path
) -> None:
    host = Host(Choice(wire, 2), Random(1))
    host.request(Command.SET, Parameter.VERSION, 0, versions[0])
    host.request(Command.START)
    host.output(1)
    host.request(Command.STOP)
    host.request(Command.SET, Parameter.VERSION, 0, versions[1])
    host.tell_period()
    host.output(2)
    if wire == SERIAL:  # as long as those of the stream that was
        host.happens(Kind.BYTES, frame(bytes((versions[1], 4)) + bytes(12 if versions[0] == 1 else 20)))
    assert compare(program, host.choice, host.events) == []
    assert host.python.device.counts["outputs_while_idle"] >= 1


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

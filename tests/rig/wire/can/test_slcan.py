"""Adapters on a serial line: lines of text to frames, garbage, and python-can as the other end."""

import os
import threading
import time

import can
import pytest
from hypothesis import given, settings, strategies as st

from rig.errors import DaqBusy, DaqDisconnected, DaqRefused
from rig.wire.can.frames import FD_LENGTHS, BusTiming, Frame
from rig.wire.can.slcan import SlcanBus
from rig.wire.can.slcan_lines import LONGEST_LINE, SlcanLines, encode_line
from rig.wire.serial.port import PseudoTerminal, open_pseudo_terminal
from tests.refused import refused


@st.composite
def frames(draw: st.DrawFn) -> Frame:
    fd, extended = draw(st.booleans()), draw(st.booleans())
    identifier = draw(st.integers(0, 0x1FFFFFFF if extended else 0x7FF))
    length = draw(st.sampled_from(FD_LENGTHS if fd else FD_LENGTHS[:9]))
    return Frame(identifier, draw(st.binary(min_size=length, max_size=length)), fd, extended)


@pytest.fixture
def line():  # type: ignore[no-untyped-def]
    line = open_pseudo_terminal()
    yield line
    line.close()


def open_pair(line: PseudoTerminal) -> tuple[SlcanBus, SlcanBus]:
    adapter, host = SlcanBus(line.descriptor, BusTiming(True), adapter=True), SlcanBus(line.path, BusTiming(True))
    adapter.open()
    host.open()
    assert adapter.receive(0.1) is None  # it obeys the opening
    return adapter, host


def test_lines_are_those_of_the_published_format() -> None:
    assert encode_line(Frame(0x123, b"\x11\x22\x33")) == b"t1233112233\r"
    assert encode_line(Frame(0x1ABCDEF0, b"", False, True)) == b"T1ABCDEF00\r"
    assert encode_line(Frame(0x7FF, bytes(12), True)) == b"b7FF9" + b"0" * 24 + b"\r"


@given(st.lists(frames(), max_size=20), st.integers(1, 40))
def test_frames_survive_the_line_however_it_is_cut(wanted: list[Frame], piece: int) -> None:
    counters: dict[str, int] = {}
    lines = SlcanLines(counters)
    text = b"".join(map(encode_line, wanted))
    for first in range(0, len(text), piece):
        lines.feed(text[first : first + piece])
    assert list(lines.frames) == wanted
    assert not any(counters.values())


@settings(deadline=None)
@given(st.lists(frames(), min_size=1, max_size=12), st.data())
def test_frames_between_garbage_are_all_found_again(wanted: list[Frame], data: st.DataObject) -> None:
    counters: dict[str, int] = {}
    lines = SlcanLines(counters)
    garbage = st.binary(max_size=300).filter(lambda text: not any(letter in text for letter in b"tTdDbB"))
    for frame in wanted:
        lines.feed(data.draw(garbage) + b"\r" + encode_line(frame))
        assert len(lines._rest) <= LONGEST_LINE
    assert list(lines.frames) == wanted


@settings(deadline=None)
@given(st.lists(st.binary(max_size=400), max_size=20))
def test_nothing_that_comes_breaks_the_reader_or_fills_memory(pieces: list[bytes]) -> None:
    lines = SlcanLines({})
    for piece in pieces:
        lines.feed(piece)
        assert len(lines._rest) <= LONGEST_LINE
        for frame in lines.frames:
            assert len(frame.data) in FD_LENGTHS
            assert frame.identifier <= 0x1FFFFFFF


@pytest.mark.parametrize(
    "bad",
    [
        b"t1233 1 2 3",
        b"t12331122",
        b"t123311223344",
        b"t8003112233",
        b"t1239" + b"00" * 12,
        b"tG233112233",
        b"t123",
        b"x",
    ],
)
def test_lines_that_are_no_frames_are_counted(bad: bytes) -> None:
    counters: dict[str, int] = {}
    lines = SlcanLines(counters)
    lines.feed(bad + b"\r" + encode_line(Frame(0x123, b"")))
    assert list(lines.frames) == [Frame(0x123, b"")]
    assert counters["damaged_lines"] == 1


def test_an_adapter_and_a_host_pass_frames_both_ways_and_close(line: PseudoTerminal) -> None:
    adapter, host = open_pair(line)
    for number in range(50):
        frame = Frame(number, bytes([number]) * 64, True)
        assert host.send(frame, 0.1)
        assert adapter.receive(0.5) == frame
        assert adapter.send(frame, 0.1)
        assert host.receive(0.5) == frame
    host.close()
    host.close()
    assert adapter.receive(0.1) is None
    assert adapter.send(Frame(1, b""), 0.0)  # off the bus: into the air
    assert os.get_blocking(line.descriptor) is False


def test_python_cans_own_adapter_driver_understands_ours(line: PseudoTerminal) -> None:
    adapter = SlcanBus(line.descriptor, BusTiming(True), adapter=True)
    adapter.open()
    ended = threading.Event()

    def echo() -> None:
        while not ended.is_set():
            frame = adapter.receive(0.05)
            if frame is not None:
                adapter.send(frame._replace(identifier=frame.identifier + 1), 0.5)

    thread = threading.Thread(target=echo)
    thread.start()
    try:
        with can.Bus(interface="slcan", channel=line.path, bitrate=1_000_000, sleep_after_open=0.0) as bus:
            for fd, length in ((False, 8), (True, 64), (False, 0)):
                message = can.Message(
                    arbitration_id=0x123, is_extended_id=False, is_fd=fd, bitrate_switch=fd, data=bytes(range(length))
                )
                bus.send(message)
                back = bus.recv(60.0)
                assert back is not None
                assert (back.arbitration_id, bytes(back.data), back.is_fd) == (0x124, bytes(range(length)), fd)
    finally:
        ended.set()
        thread.join()


def everything(bus: SlcanBus) -> list[Frame]:
    """All frames until the line falls silent."""
    out, silent = [], 0
    while silent < 2:  # a read of half a line returns no frame either
        frame = bus.receive(0.05)
        silent = 0 if frame is not None else silent + 1
        out += [frame] if frame is not None else []
    return out


def test_a_line_that_takes_no_more_lets_frames_expire_whole(line: PseudoTerminal) -> None:
    adapter, host = open_pair(line)
    frame = Frame(0x123, bytes(range(64)), True)
    for _ in range(3):  # a terminal takes a little more once in a while
        while host.send(frame, 0.0):
            pass
    assert host.counters["expired_frames"] == 3
    begin = time.monotonic()
    if not host.send(frame, 0.02):
        assert time.monotonic() - begin >= 0.02
    got = everything(adapter)
    assert host.send(frame._replace(identifier=5), 0.1)
    got += everything(adapter)
    assert set(got[:-1]) == {frame}
    assert got[-1].identifier == 5
    assert adapter.counters["damaged_lines"] == 0
    host.close()


def test_waiting_ends_within_a_millisecond_for_a_device_keeps_deadlines_of_parts_of_it(line: PseudoTerminal) -> None:
    _, host = open_pair(line)
    everything(host)
    took_s: list[float] = []
    while not took_s or min(took_s) >= 8e-4:  # a wait of whole milliseconds would never end so early
        assert len(took_s) < 20_000
        begin = time.monotonic()
        assert host.receive(2e-4) is None
        took_s.append(time.monotonic() - begin)
    assert min(took_s) >= 2e-4
    host.close()


def test_a_pulled_cable_is_said_and_the_adapter_waits_on(line: PseudoTerminal) -> None:
    adapter, host = open_pair(line)
    os.close(line.far_descriptor)
    host.close()
    assert everything(adapter) == []
    begin = time.monotonic()
    assert adapter.receive(0.02) is None
    assert time.monotonic() - begin > 0.005  # it does not spin
    gone = open_pseudo_terminal()
    bus = SlcanBus(gone.path, BusTiming(True))
    bus.open()
    gone.close()
    with refused(DaqDisconnected, "is-gone"):
        bus.receive(0.1)
    bus.close()


def test_a_port_that_is_held_or_a_rate_without_a_command_is_refused(line: PseudoTerminal) -> None:
    _, host = open_pair(line)
    with pytest.raises(DaqBusy):
        SlcanBus(line.path).open()
    host.close()
    with refused(DaqRefused, field="driver.options.bitrate", value=900000):
        SlcanBus(line.path, BusTiming(bit_rate_hz=900_000)).open()
    with refused(DaqRefused, field="driver.options.data_bitrate", value=3000000):
        SlcanBus(line.path, BusTiming(True, data_bit_rate_hz=3_000_000)).open()

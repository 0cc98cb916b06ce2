"""Links over pseudo-terminals: ports that are there, held, gone, full, or full of old bytes."""

import contextlib
import errno
import itertools
import math
import os
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
import serial

from rig.errors import DaqBusy, DaqDisconnected, DaqRefused, DaqTimeout
from rig.wire.messages import Answer, EmergencyStop, Heartbeat, Output, Request, Samples, Stream
from rig.wire.serial.link import SerialLink, line_load
from rig.wire.serial.port import is_pseudo_terminal, open_pseudo_terminal
from tests.docs.wire import on_the_line
from tests.refused import refused
from tests.rig.wire.serial.strategies import same

pytestmark = pytest.mark.skipif(not hasattr(os, "openpty"), reason="no pseudo-terminals on this system")

STREAM = Stream(n_channels=4, block=5, rate_hz=5000.0)
PATIENCE_S = 60.0  # for what must come
BAUD = 3_000_000


@pytest.fixture
def line():
    out = open_pseudo_terminal()
    yield out
    out.close()


@pytest.fixture
def ends(line):
    """Host and device, open and agreed on a stream."""
    host, device = SerialLink.port(line.path, BAUD), SerialLink.on(line.descriptor, "device")
    for link in (host, device):
        link.open()
        link.configure(STREAM)
    yield host, device
    host.close()
    device.close()


def messages():
    counts = np.arange(-10, 10, dtype=np.int16).reshape(5, 4)
    down = [Request(1, 2, 3, 4, 5), Output(15, counts[:, 0], 3), EmergencyStop(9)]
    return down, [Answer(1, 0, 3, 4, 5), Samples(10, counts, 1, 2, 3, 4), Heartbeat(2, 0, 7, 15, 2)]


def test_messages_pass_in_both_directions_and_in_order(ends):
    host, device = ends
    down, up = messages()
    for sender, receiver, some in ((host, device, down), (device, host, up)):
        for message in some * 10:
            sender.send(message)
        assert all(same(receiver.receive(PATIENCE_S), message) for message in some * 10)
        assert receiver.receive(0.0) is None
        assert not any(receiver.counters.values())


def test_on_the_line_are_the_frames_of_the_page(line, ends):
    host, _ = ends
    host.send(Request(7, 1, 65))
    os.set_blocking(line.descriptor, True)
    assert os.read(line.descriptor, 100) == b"\0" + on_the_line(bytes([1, 1, 0, 0, 7, 1, 65, 0, 0, 0, 0, 0]))


def test_noise_on_an_idle_line_costs_no_command(line, ends):
    host, device = ends
    os.write(line.far_descriptor, b"\x55noise")
    host.send(Request(1, 1, 65))
    assert device.receive(PATIENCE_S) == Request(1, 1, 65)
    assert device.counters["crc_errors"] == 1
    assert device.counters["garbage_bytes"] == 6


def test_a_frame_in_pieces_is_waited_for_and_a_trickle_does_not_prolong_the_wait(line, ends):
    host, _ = ends
    whole = on_the_line(bytes([1, 2, 0, 0, 7, 0, 65, 0, 0, 0, 0, 0]))
    stop = threading.Event()

    def trickle():
        os.write(line.descriptor, whole[:9])
        time.sleep(0.02)
        os.write(line.descriptor, whole[9:])
        while not stop.wait(0.005):
            os.write(line.descriptor, b"\x55")

    thread = threading.Thread(target=trickle)
    thread.start()
    try:
        assert host.receive(PATIENCE_S) == Answer(7, 0, 65)
        began = time.monotonic()
        assert host.receive(0.1) is None
        assert 0.09 < time.monotonic() - began < PATIENCE_S
    finally:
        stop.set()
        thread.join()


def test_waiting_costs_no_processor_time(ends):
    host, _ = ends
    began = time.thread_time()
    assert host.receive(0.3) is None
    assert time.thread_time() - began < 0.1


def test_what_an_earlier_host_has_left_in_the_line_is_dropped(line):
    os.write(line.descriptor, on_the_line(bytes([1, 2, 0, 0, 7, 0, 65, 0, 0, 0, 0, 0])))
    with contextlib.closing(SerialLink.port(line.path, BAUD)) as host:
        host.open()
        assert host.receive(0.05) is None


def test_a_port_can_be_opened_again_and_closed_twice(line, ends):
    host, device = ends
    host.close()
    host.close()
    with refused(DaqDisconnected, "is-not-open"):
        host.receive(0.01)
    host.open()
    device.send(Answer(1, 0))
    assert host.receive(PATIENCE_S) == Answer(1, 0)


def test_a_port_that_somebody_holds_is_busy(line, ends):
    with refused(DaqBusy, where=f"port {line.path!r}", hint="close the other program"):
        SerialLink.port(line.path, BAUD).open()


def test_a_port_that_is_not_there_is_said_with_those_that_are():
    with refused(DaqDisconnected, "dev-no-such-port-it-is-2"):
        SerialLink.port("/dev/no-such-port", BAUD).open()


def test_a_port_that_is_almost_there_is_suggested(monkeypatch):
    monkeypatch.setattr("rig.wire.serial.port.port_names", lambda: ["/dev/no-such-port-0", "/dev/ttyS0"])
    with refused(DaqDisconnected, "is-it-dev-no-such-port"):
        SerialLink.port("/dev/no-such-port-1", BAUD).open()
    with refused(DaqDisconnected, "tty"):
        SerialLink.port("/dev/another", BAUD).open()


def test_a_port_that_another_process_holds_is_busy(line):
    holder = (
        "import serial, sys; port = serial.Serial(sys.argv[1], exclusive=True); print(flush=True); sys.stdin.read()"
    )
    with subprocess.Popen(
        [sys.executable, "-c", holder, line.path], stdin=subprocess.PIPE, stdout=subprocess.PIPE
    ) as process:
        process.stdout.readline()
        host = SerialLink.port(line.path, BAUD)
        with pytest.raises(DaqBusy):
            host.open()
        process.kill()
        process.wait()
        host.open()  # the system has let go of it
        host.close()


@pytest.mark.parametrize("path", ["/dev/null", "/dev"])
def test_what_is_no_serial_port_is_refused(path):
    with refused(DaqRefused, reason="it is no serial port", where=f"port {path!r}"):
        SerialLink.port(path, BAUD).open()


@pytest.mark.parametrize("made", [Path.touch, os.mkfifo])
def test_a_file_of_any_kind_is_no_serial_port(tmp_path, made):
    made(tmp_path / "port")
    with refused(DaqRefused, "port-it-is-no-serial-port"):
        SerialLink.port(str(tmp_path / "port"), BAUD).open()


def test_a_port_without_permission_says_which_group_helps(monkeypatch):
    def denied(*_, **__):
        raise serial.SerialException(errno.EACCES, "Permission denied")

    monkeypatch.setattr("serial.Serial", denied)
    with refused(DaqRefused, "no-permission-to-open-it-on"):
        SerialLink.port("/dev/ttyS0", BAUD).open()


def test_a_port_that_goes_while_it_is_being_opened_is_let_go_of(line, monkeypatch):
    def gone(*_):
        raise DaqDisconnected("gone")

    with monkeypatch.context() as patch:
        patch.setattr("rig.wire.serial.port.second_descriptor", gone)
        with refused(DaqDisconnected, "gone"):
            SerialLink.port(line.path, BAUD).open()
    with contextlib.closing(SerialLink.port(line.path, BAUD)) as host:
        host.open()


@pytest.mark.parametrize("number", [errno.EIO, errno.ENODEV, errno.ENXIO, errno.EBADF])
def test_whatever_an_adapter_says_when_it_vanishes_the_port_is_gone(ends, monkeypatch, number):
    def vanished(*_):
        raise OSError(number, os.strerror(number))

    for link in ends:
        for name in ("read", "write"):
            with monkeypatch.context() as patch:
                patch.setattr(os, name, vanished)
                with refused(DaqDisconnected, "the-port-is-gone") as said:
                    link.send(Request(1, 1)) if name == "write" else link.receive(0.0 if link is ends[1] else 1.0)
            assert os.strerror(number) in str(said.value)


def test_the_devices_end_sees_its_line_go_as_well(line, ends):
    device = ends[1]
    ends[0].close()
    os.close(line.far_descriptor)
    with refused(DaqDisconnected, "device-the-port-is-gone"):
        device.receive(PATIENCE_S)


@pytest.mark.parametrize("wait_s", [0.0, 0.005, 0.05, 0.25])
def test_a_silent_line_is_waited_for_as_long_as_asked_at_both_ends(ends, wait_s):
    for link in ends:
        began = time.monotonic()
        assert link.receive(wait_s) is None
        assert wait_s <= time.monotonic() - began < wait_s + PATIENCE_S


def test_nothing_stays_unread_when_much_comes_at_a_time(ends):
    host, device = ends
    sent = [messages()[0][1]._replace(first=5 * number) for number in range(120)]  # more than one read takes
    for message in sent:
        host.send(message)
    got = [device.receive(PATIENCE_S) for _ in sent]
    assert [message.first for message in got] == [message.first for message in sent]


def test_an_unplugged_cable_is_said_by_reading_and_by_writing(line, ends):
    host, _ = ends
    line.close()
    with refused(DaqDisconnected, "the-port-is-gone", where=line.path):
        host.receive(PATIENCE_S)
    with refused(DaqDisconnected, "unplugged"):
        host.send(Request(1, 1))


def test_a_cable_unplugged_while_waiting_ends_the_wait(line, ends):
    host, _ = ends
    thread = threading.Timer(0.05, line.close)
    thread.start()
    began = time.monotonic()
    with pytest.raises(DaqDisconnected):
        host.receive(60.0)
    assert time.monotonic() - began < 30.0
    thread.join()


def test_a_line_that_takes_no_more_is_said_in_bounded_time_and_frames_stay_whole(ends):
    _, device = ends
    host = ends[0]
    samples = messages()[1][1]
    numbers = itertools.count()
    with refused(DaqTimeout, "takes-no-more-bytes"):
        any(device.send(samples._replace(first=number)) for number in numbers)
    sent = next(numbers) - 1  # the one that was not taken
    assert device.counters["unsent_frames"] == 1
    first = [message.first for message in iter(lambda: host.receive(0.05), None)]
    device.send(samples._replace(first=sent))  # what was begun is finished with it
    first += [message.first for message in iter(lambda: host.receive(0.05), None)]
    assert first == list(range(sent + 1))
    assert not any(host.counters.values())


@pytest.mark.parametrize("version", [1, 2])
def test_the_load_is_that_of_frames_at_ten_bits_a_byte(version):
    load = line_load(STREAM, BAUD, version)
    samples = 4 + 24 + 5 * 4 * 2 + 4 + 1 + 1  # header, body, CRC, COBS, zero
    heartbeats = 10 * (4 + 12 + 4 + 1 + 2)
    readbacks = 50 * (4 + 8 + 5 * 2 + 4 + 1 + 1) if version == 2 else 0  # of one block in twenty
    assert load.needed_bit_s == 10 * (1000 * samples + heartbeats + readbacks)
    assert ("readbacks" in load.sum_text) == (version == 2)
    assert load.share == load.needed_bit_s / BAUD
    assert f"1000/s x {samples} bytes of samples" in load.sum_text
    assert "3000000 baud carry 3000 kbit/s" in load.sum_text


def test_a_pseudo_terminal_carries_any_stream(line, ends):
    host, device = ends
    assert host.load(STREAM).available_bit_s == device.load(STREAM).available_bit_s == math.inf
    assert host.load(STREAM).share == 0.0
    assert is_pseudo_terminal(line.descriptor)
    assert is_pseudo_terminal(line.far_descriptor)

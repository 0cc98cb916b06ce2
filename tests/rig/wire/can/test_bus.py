"""python-can as a bus: what its backends raise and return becomes ours."""

import errno
import socket
from collections.abc import Iterator
from typing import Any

import can
import pytest

from rig.errors import DaqDisconnected
from rig.wire.can.bus import PythonCanBus
from rig.wire.can.frames import BusTiming, Frame
from rig.wire.can.link import CanLink
from rig.wire.messages import Heartbeat, Request
from tests.refused import refused


class Backend:
    """A backend that does what the test says."""

    def __init__(self) -> None:
        self.received: list[Any] = []
        self.errors: list[Exception] = []
        self.sent: list[can.Message] = []
        self.socket = socket.socket()

    def recv(self, timeout: float | None) -> Any:
        message = self.received.pop(0) if self.received else None
        if isinstance(message, Exception):
            raise message
        return message

    def send(self, message: can.Message, timeout: float | None) -> None:
        if self.errors:
            raise self.errors.pop(0)
        self.sent.append(message)

    def fileno(self) -> int:
        return self.socket.fileno()

    def shutdown(self) -> None:
        self.socket.close()
        raise can.CanOperationError("gone before")


@pytest.fixture
def bus(monkeypatch: pytest.MonkeyPatch) -> Iterator[PythonCanBus]:
    backend = Backend()
    monkeypatch.setattr(can, "Bus", lambda **_: backend)
    bus = PythonCanBus("socketcan", "can0", BusTiming(True, 1_000_000, 2_000_000), 1)
    bus.open()
    yield bus
    bus.close()


def test_a_socket_gets_more_room_for_frames_that_come_while_the_host_stalls(bus: PythonCanBus) -> None:
    with socket.socket() as plain:
        usual = plain.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF)
    assert bus._bus.socket.getsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF) > usual


def test_the_bus_being_off_ends_the_connection_and_other_error_frames_are_counted(bus: PythonCanBus) -> None:
    bus._bus.received = [
        can.Message(is_error_frame=True, arbitration_id=0x8),
        can.Message(is_error_frame=True, arbitration_id=0x40),
    ]
    assert bus.receive(0.0) is None
    with refused(DaqDisconnected, "the-bus-is-off"):
        bus.receive(0.0)
    assert bus.counters["error_frames"] == 2


def test_remote_frames_are_counted_and_data_frames_come_through(bus: PythonCanBus) -> None:
    bus._bus.received = [
        can.Message(is_remote_frame=True, arbitration_id=5, is_extended_id=False),
        can.Message(arbitration_id=5, is_extended_id=False, is_fd=True, data=bytes(12)),
    ]
    assert bus.receive(0.0) is None
    assert bus.receive(0.0) == Frame(5, bytes(12), True)
    assert bus.counters["foreign_frames"] == 1


def test_a_full_queue_is_tried_again_and_then_the_frame_expires(bus: PythonCanBus) -> None:
    full = can.CanOperationError("no buffer space", error_code=errno.ENOBUFS)
    bus._bus.errors = [full, full]
    assert bus.send(Frame(1, b"", True), 1.0)
    assert bus._bus.sent[0].bitrate_switch
    bus._bus.errors = [full] * 1000
    assert not bus.send(Frame(1, b""), 0.005)
    assert bus.counters["expired_frames"] == 1


@pytest.mark.parametrize("number", [errno.ENODEV, errno.ENETDOWN])
def test_an_interface_that_goes_is_said(bus: PythonCanBus, number: int) -> None:
    bus._bus.errors = [can.CanOperationError("gone", error_code=number)]
    with refused(DaqDisconnected, "can-is-gone"):
        bus.send(Frame(1, b""), 0.1)
    bus._bus.received = [can.CanOperationError("gone")]
    with refused(DaqDisconnected, "can-is-gone"):
        bus.receive(0.1)
    bus.close()
    bus.close()
    with refused(DaqDisconnected, "is-not-open"):
        bus.receive(0.0)


def test_a_bus_full_of_strangers_does_not_hold_a_call_that_must_not_wait(bus: PythonCanBus) -> None:
    link = CanLink(bus, 4, BusTiming(True))
    bus._bus.received = [can.Message(arbitration_id=0x7E0, is_extended_id=False)] * 1000
    assert link.receive(0.0) is None
    assert 0 < len(bus._bus.received) < 1000


def test_a_link_sends_and_receives_whole_messages(bus: PythonCanBus) -> None:
    link = CanLink(bus, 4, BusTiming(True))
    link.send(Request(1, 2, 3, 4, 5))
    (sent,) = bus._bus.sent
    assert (sent.arbitration_id, bytes(sent.data), sent.is_fd) == (0x021, bytes((1, 2, 3, 4, 5, 0, 0, 0)), False)
    bus._bus.received = [can.Message(arbitration_id=0x011, is_extended_id=False, data=bytes((1, 2, 3, 4, 5, 0, 0, 0)))]
    assert link.receive(0.1) == Heartbeat(1, 2, 3, 5, 4)
    assert link.layout_crc != 0


def test_a_send_whose_time_is_over_is_tried_once_and_does_not_wait_for_ever(
    bus: PythonCanBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    waited: list[float | None] = []
    monkeypatch.setattr(bus._bus, "send", lambda message, timeout: waited.append(timeout))
    assert bus.send(Frame(0x101, b""), 0.0)
    assert waited == [0.0]  # None would be for ever

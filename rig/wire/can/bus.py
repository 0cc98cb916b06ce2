"""Buses that frames are sent to and received from, and any backend of python-can as one (see also `rig.wire.can.slcan`)."""

import contextlib
import errno
import os
import socket
import time
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING

from rig.errors import DaqDisconnected, DaqRefused
from rig.wire.can.frames import BusTiming, Frame
from rig.wire.can.lean_import import lean_import
from rig.wire.can.protocol import NODE_MASK

if TYPE_CHECKING:
    import can

BUS_COUNTERS = ("error_frames", "expired_frames", "foreign_frames", "send_errors")
"""Counters of a bus: error frames, own frames not sent in time, foreign frames, failed sends."""

_BUS_OFF = 0x40
"""Class of an error frame, in its identifier (Linux: can/error.h)."""
_RETRY_S = 2e-4
"""Pause before a frame is sent again, s; chosen: about the duration of a classical frame at 1 Mbit/s."""
_SOCKETS = ("socketcan", "udp_multicast")
_BUFFER_BYTES = 4 << 20
"""Receive buffer that is asked for, bytes; chosen: seconds of a full bus."""
_FORCED = 33
"""SO_RCVBUFFORCE of Linux: a buffer beyond the system's limit, where permitted."""
_GONE = {errno.ENODEV, errno.ENETDOWN, errno.ENXIO, errno.EIO, errno.EBADF}


class FrameBus(ABC):
    """Frames in and out; errors are those of `rig.wire.link.Link`."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.counters: dict[str, int] = dict.fromkeys(BUS_COUNTERS, 0)

    @abstractmethod
    def open(self) -> None:
        """Open the interface; nothing is sent."""

    @abstractmethod
    def send(self, frame: Frame, timeout_s: float) -> bool:
        """Send a frame; False if it could not be sent within the time and was dropped."""

    @abstractmethod
    def receive(self, timeout_s: float) -> Frame | None:
        """The next data frame, or None after ``timeout_s``; 0 does not wait."""

    @abstractmethod
    def close(self) -> None:
        """Close the interface; may be called again."""


def only_loopback() -> bool:
    """Whether this network namespace has nothing but the loopback interface."""
    return {name for _, name in socket.if_nameindex()} <= {"lo"}


class PythonCanBus(FrameBus):
    """An interface by way of python-can: SocketCAN, PEAK, Vector, Kvaser, virtual and all others.

    ``options`` are further keyword arguments of the backend (`can.Bus`), for instance its clock and bit timing. `udp_multicast`
    follows the default route and is therefore refused wherever there is a network besides the loopback.
    """

    def __init__(
        self,
        interface: str,
        channel: str | int,
        timing: BusTiming,
        node: int | None = None,
        options: dict[str, object] | None = None,
    ) -> None:
        super().__init__(f"{interface} {channel}")
        self._interface = interface
        self._arguments: dict[str, object] = {"interface": interface, "channel": channel, "bitrate": timing.bit_rate_hz}
        if timing.fd or interface == "udp_multicast":
            self._arguments["fd"] = timing.fd
        if timing.fd:
            self._arguments["data_bitrate"] = timing.data_bit_rate_hz
        if node is not None:  # receive frames of this node, and the emergency stop
            shared = {"extended": False}
            self._arguments["can_filters"] = [
                {"can_id": node, "can_mask": NODE_MASK, **shared},
                {"can_id": 0, "can_mask": 0x7FF, **shared},
            ]
        self._arguments.update(options or {})
        self._bus: can.BusABC | None = None

    def open(self) -> None:
        """Open the interface. `DaqRefused` without its backend, `DaqDisconnected` without the interface itself."""
        with lean_import():
            import can

        if self._interface == "udp_multicast" and not only_loopback():
            raise DaqRefused(
                f"{self.name}: would send to the network; allowed only in a network namespace that has nothing but loopback"
            )
        try:
            self._bus = can.Bus(**self._arguments)  # type: ignore[arg-type]  # the backend checks them
        except (can.CanInterfaceNotImplementedError, ImportError) as error:
            raise DaqRefused(f"{self.name}: python-can has no such backend here: {_line(error)}") from None
        except (can.CanInitializationError, OSError) as error:
            raise DaqDisconnected(f"{self.name}: cannot be opened: {_line(error)}") from None
        except (can.CanError, ValueError, TypeError) as error:
            raise DaqRefused(f"{self.name}: python-can refuses it: {_line(error)}") from None
        if self._interface in _SOCKETS:
            _enlarge(self._bus.fileno())

    def send(self, frame: Frame, timeout_s: float) -> bool:
        """Hand a frame to the backend; if its queue is full, try again until the time is over."""
        import can

        message = can.Message(
            arbitration_id=frame.identifier,
            is_extended_id=frame.extended,
            is_fd=frame.fd,
            bitrate_switch=frame.fd,
            data=frame.data,
        )
        deadline = time.monotonic() + timeout_s
        left_s = timeout_s  # kept the same from call to call: backends are slow to change it
        while True:
            try:
                self._opened().send(message, timeout=left_s)
                return True
            except (can.CanError, OSError) as error:
                if _code(error) in _GONE:
                    raise DaqDisconnected(f"{self.name}: is gone: {_line(error)}") from None
                if time.monotonic() + _RETRY_S >= deadline:
                    self.counters["expired_frames" if _code(error) == errno.ENOBUFS else "send_errors"] += 1
                    return False
            time.sleep(_RETRY_S)
            left_s = max(deadline - time.monotonic(), 0.0)

    def receive(self, timeout_s: float) -> Frame | None:
        """The next data frame. Error frames are counted; one that reports bus-off raises `DaqDisconnected`."""
        import can

        try:
            message = self._opened().recv(timeout=timeout_s)
        except (can.CanError, OSError, ValueError) as error:
            raise DaqDisconnected(f"{self.name}: is gone: {_line(error)}") from None
        if message is None:
            return None
        if message.is_error_frame:
            self.counters["error_frames"] += 1
            if self._interface == "socketcan" and message.arbitration_id & _BUS_OFF:
                raise DaqDisconnected(f"{self.name}: the bus is off: too many errors (wiring, termination, bit rate?)")
            return None
        if message.is_remote_frame:
            self.counters["foreign_frames"] += 1
            return None
        return Frame(message.arbitration_id, bytes(message.data), message.is_fd, message.is_extended_id)

    def _opened(self) -> "can.BusABC":
        if self._bus is None:
            raise DaqDisconnected(f"{self.name}: is not open")
        return self._bus

    def close(self) -> None:
        """Shut the backend down."""
        bus, self._bus = self._bus, None
        if bus is not None:
            try:
                bus.shutdown()
            except Exception:  # a backend may raise anything for an interface that is gone
                return


def _enlarge(descriptor: int) -> None:
    """Enlarge the receive buffer for frames that arrive while this process stalls, as far as the system permits."""
    with socket.socket(fileno=os.dup(descriptor)) as copy:
        for option in (_FORCED, socket.SO_RCVBUF):
            with contextlib.suppress(OSError):
                copy.setsockopt(socket.SOL_SOCKET, option, _BUFFER_BYTES)
                return


def _line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__


def _code(error: BaseException) -> int | None:
    """The system's error number, which python-can keeps under a name of its own."""
    code = getattr(error, "error_code", None)
    return code if code is not None else getattr(error, "errno", None)

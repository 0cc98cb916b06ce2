"""CAN by an adapter on a serial line (slcan), as the host and as the adapter itself."""

import contextlib
import errno
import os
import time
from collections.abc import Callable
from select import select
from typing import TYPE_CHECKING

from rig.errors import DaqDisconnected
from rig.wire.can.bus import FrameBus
from rig.wire.can.frames import BusTiming, Frame
from rig.wire.can.slcan_lines import SlcanLines, encode_line, opening

if TYPE_CHECKING:
    import serial

_READ_BYTES = 4096
"""Most bytes of a read: a pseudo-terminal holds no more."""
_NOBODY_S = 0.01
"""Pause between two reads of a line without another end, s; chosen: such a line is always ready to be read."""


class TextPort:
    """Lines over an open file descriptor, which the caller closes.

    If the other end hangs up, ``on_hang_up`` is called and the port goes on waiting; without it `DaqDisconnected` is raised.
    """

    def __init__(self, name: str, descriptor: int, on_hang_up: Callable[[], None] | None = None) -> None:
        self.name = name
        self._descriptor, self._on_hang_up = descriptor, on_hang_up
        self._tail = b""
        """Rest of a line whose beginning is written."""
        os.set_blocking(descriptor, False)

    def forget(self, longest_s: float) -> None:
        """Drop what an earlier conversation has left on the line."""
        deadline = time.monotonic() + longest_s
        while time.monotonic() < deadline and self._has_come(0.0):
            if not self._bytes():
                return

    def read(self, timeout_s: float) -> bytes:
        """Bytes that have arrived, after a wait of at most ``timeout_s``."""
        if timeout_s > 0.0 and not self._has_come(timeout_s):
            return b""
        data = self._bytes()
        if not data and timeout_s > 0.0:
            time.sleep(min(timeout_s, _NOBODY_S))  # without another end, select returns at once
        return data

    def _has_come(self, timeout_s: float) -> bool:
        try:
            return bool(select((self._descriptor,), (), (), timeout_s)[0])  # poll knows whole milliseconds only
        except (OSError, ValueError) as error:
            raise DaqDisconnected(f"{self.name}: is gone ({error})") from None

    def _bytes(self) -> bytes:
        try:
            data = os.read(self._descriptor, _READ_BYTES)
        except BlockingIOError:
            return b""
        except OSError as error:
            self._gone(error)
            return b""
        if not data:
            self._gone(OSError(errno.EIO, "end of file"))
        return data

    def write(self, line: bytes, timeout_s: float) -> bool:
        """Write a line within the time; False if nothing of it was written."""
        deadline = 0.0
        started = False
        data = self._tail + line
        whole = len(data)
        while True:
            try:
                data = data[os.write(self._descriptor, data) :]
            except BlockingIOError:
                pass
            except OSError as error:
                self._gone(error)
                self._tail = b""
                return False
            if not data:
                self._tail = b""
                return True
            started = whole - len(data) > len(self._tail)
            now = time.monotonic()
            deadline = deadline or now + timeout_s
            left = deadline - now
            if left <= 0:
                self._tail = data if started else data[: len(data) - len(line)]
                return started  # a line that was begun is ended before the next one, so it counts as sent
            select((), (self._descriptor,), (), left)

    def _gone(self, error: OSError) -> None:
        if self._on_hang_up is not None and error.errno == errno.EIO:
            self._on_hang_up()
            return
        raise DaqDisconnected(f"{self.name}: is gone ({error.strerror or error})") from None


_OPENING_S = 0.1
"""Longest time for each command that opens an adapter, s; chosen."""
_CLOSING_S = 0.05
"""Longest time for the command that closes an adapter, s; chosen."""


class SlcanBus(FrameBus):
    """An adapter on a serial port or pseudo-terminal, or (``adapter``) the adapter itself at the other end of one.

    ``port`` is a path, or an open file descriptor, which then stays open when the bus is closed. An adapter passes frames on
    between the commands ``O`` and ``C``, answers commands, and waits on where nobody is at the other end.
    """

    def __init__(
        self,
        port: str | int,
        timing: BusTiming = BusTiming(),  # noqa: B008 (a tuple)
        baud: int = 3_000_000,
        adapter: bool = False,
    ) -> None:
        super().__init__(f"slcan {port}" if isinstance(port, str) else "slcan")
        self._given, self._timing, self._baud = port, timing, baud
        self._adapter = adapter
        self._port: serial.Serial | None = None
        self._text: TextPort | None = None
        self._on_bus = not adapter
        self._lines = SlcanLines(self.counters)

    def open(self) -> None:
        """Open port and adapter. `DaqRefused` for a bit rate that adapters have no command for."""
        commands = opening(self._timing)
        if isinstance(self._given, int):
            descriptor = self._given
        else:
            from rig.wire.serial.port import open_port

            self._port = open_port(self._given, self._baud)
            descriptor = self._port.fileno()
        self._text = TextPort(self.name, descriptor, self._leave if self._adapter else None)
        if not self._adapter:
            self._text.forget(_OPENING_S)
            self._text.write(b"\r\rC\r", _OPENING_S)
            self._text.write(commands, _OPENING_S)

    def _leave(self) -> None:
        self._on_bus = False

    def _line(self) -> TextPort:
        if self._text is None:
            raise DaqDisconnected(f"{self.name}: is not open")
        return self._text

    def send(self, frame: Frame, timeout_s: float) -> bool:
        """Write the line of a frame; one that is half written when the time is over is ended before the next."""
        if not self._on_bus:
            return True  # as on a bus without listeners
        if self._line().write(encode_line(frame), timeout_s):
            return True
        self.counters["expired_frames"] += 1
        return False

    def receive(self, timeout_s: float) -> Frame | None:
        """The next frame of the line."""
        frames = self._lines.frames
        if frames:
            return frames.popleft()
        text, lines = self._line(), self._lines
        until = time.monotonic() + timeout_s
        left_s = timeout_s
        while True:
            data = text.read(left_s)
            if data:
                lines.feed(data)
            if lines.commands:
                self._obey()
            if frames:
                return frames.popleft()
            left_s = until - time.monotonic()
            if left_s <= 0.0:  # also after half a line
                return None

    def close(self) -> None:
        """Close adapter and port; a descriptor that was given stays open."""
        if self._text is not None and not self._adapter:
            with contextlib.suppress(DaqDisconnected):
                self._text.write(b"C\r", _CLOSING_S)
        port, self._port, self._text = self._port, None, None
        if port is not None:
            try:
                port.close()
            except OSError:
                return

    def _obey(self) -> None:
        while self._lines.commands:
            command = self._lines.commands.popleft()
            if not self._adapter:
                continue
            if command[:1] in b"OLC":
                self._on_bus = command[:1] != b"C"
            reply = {b"V": b"V1013\r", b"N": b"N0001\r", b"F": b"F00\r"}.get(command[:1], b"\r")
            self._line().write(reply, _OPENING_S)

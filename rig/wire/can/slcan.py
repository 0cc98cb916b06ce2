"""CAN adapters on a serial line: frames as lines of text (slcan), classical and FD, read and written whole.

A line is a letter (``t`` classical, ``d`` FD, ``b`` FD with the data at the data bit rate; capitals: identifier of 29 bits),
identifier and length code in hexadecimal digits, the data, and a carriage return. ``S8`` chooses 1 Mbit/s, ``Y2`` 2 Mbit/s for
data, ``O`` opens, ``C`` closes. The text has no checksum: a digit damaged between adapter and computer passes as another digit.
"""

import contextlib
import errno
import os
import select
import time
from collections import deque
from typing import Any

from rig.errors import DaqDisconnected, DaqRefused
from rig.wire.can.bus import FrameBus
from rig.wire.can.frames import FD_LENGTHS, Frame

__all__ = ["LONGEST_LINE", "SlcanBus", "SlcanLines", "encode_line"]

LONGEST_LINE = 2 + 8 + 128
BIT_RATES = {10_000: 0, 20_000: 1, 50_000: 2, 100_000: 3, 125_000: 4, 250_000: 5, 500_000: 6, 750_000: 7, 1_000_000: 8}
DATA_BIT_RATES = (1_000_000, 2_000_000, 4_000_000, 5_000_000, 8_000_000)
_CODES = {length: f"{code:X}" for code, length in enumerate(FD_LENGTHS)}
_KINDS = {ord("t"): (False, False), ord("T"): (False, True)} | {
    ord(letter): (True, letter in "DB") for letter in "dDbB"
}
_REMOTE = b"rR"
_COMMANDS = b"SYOLCXZVNFsmM"
_READ_BYTES = 4096
_OPENING_S = 0.1


def encode_line(frame: Frame) -> bytes:
    """The line of a frame, with its carriage return."""
    letter = "b" if frame.fd else "t"
    head = f"{letter.upper()}{frame.identifier:08X}" if frame.extended else f"{letter}{frame.identifier:03X}"
    return f"{head}{_CODES[len(frame.data)]}{frame.data.hex().upper()}\r".encode("ascii")


def _decode_line(line: bytes) -> Frame | None:
    """The frame of a line without its carriage return; None where it is none."""
    kind = _KINDS.get(line[0])
    if kind is None:
        return None
    fd, extended = kind
    text = line[1:]
    try:
        raw = bytes.fromhex("0" * extended + text.decode("ascii"))
    except ValueError:
        return None
    head = 5 if extended else 2
    if len(raw) < head or 2 * len(raw) != len(text) + extended:  # the latter: blanks, which fromhex passes over
        return None
    word = int.from_bytes(raw[:head], "big")
    identifier, length = word >> 4, FD_LENGTHS[word & 0xF]
    if length != len(raw) - head or identifier > (0x1FFFFFFF if extended else 0x7FF) or (length > 8 and not fd):
        return None
    return Frame(identifier, raw[head:], fd, extended)


class SlcanLines:
    """Cuts a stream of bytes into frames and commands; garbage is counted, and costs no frame behind the next line end."""

    def __init__(self, counters: dict[str, int]) -> None:
        self._counters = counters
        counters.setdefault("garbage_bytes", 0)
        counters.setdefault("damaged_lines", 0)
        self._rest = b""
        self.frames: deque[Frame] = deque()
        self.commands: deque[bytes] = deque(maxlen=64)

    def feed(self, data: bytes) -> None:
        """Take bytes as they come."""
        *lines, rest = (self._rest + data).split(b"\r")
        if len(rest) > LONGEST_LINE:
            self._counters["garbage_bytes"] += len(rest) - LONGEST_LINE
            rest = rest[-LONGEST_LINE:]
        self._rest = rest
        for line in lines:
            line = line.lstrip(b"\a")  # an adapter's word for an error, without a line end
            if line:
                self._take(line)

    def _take(self, line: bytes) -> None:
        frame = _decode_line(line)
        if frame is None and line[0] in _COMMANDS and len(line) < 16:
            self.commands.append(line)
        elif frame is None and line[0] in _REMOTE:
            self._counters["foreign_frames"] = self._counters.get("foreign_frames", 0) + 1
        elif frame is None and line not in (b"z", b"Z"):  # these acknowledge a frame
            self._counters["damaged_lines"] += 1
        elif frame is not None:
            self.frames.append(frame)


class SlcanBus(FrameBus):
    """An adapter on a serial port or pseudo-terminal, or (``adapter``) the adapter itself at the other end of one.

    ``port`` is a path, or an open file descriptor, which then stays open when the bus is closed. An adapter passes frames on
    between the commands ``O`` and ``C``, answers commands, and waits on where nobody is at the other end.
    """

    def __init__(
        self,
        port: str | int,
        fd: bool = False,
        bit_rate_hz: int = 1_000_000,
        data_bit_rate_hz: int = 2_000_000,
        baud: int = 3_000_000,
        adapter: bool = False,
    ) -> None:
        super().__init__(f"slcan {port}" if isinstance(port, str) else "slcan")
        self._given, self._fd, self._baud = port, fd, baud
        self._bit_rate_hz, self._data_bit_rate_hz = bit_rate_hz, data_bit_rate_hz
        self._adapter = adapter
        self._port: Any = None
        self._descriptor = -1
        self._on_bus = not adapter
        self._tail = b""
        self._lines = SlcanLines(self.counters)

    def open(self) -> None:
        """Open port and adapter. `DaqRefused` for a bit rate that adapters have no command for."""
        commands = self._commands()
        if isinstance(self._given, int):
            self._descriptor = self._given
        else:
            from rig.wire.serial.port import open_port

            self._port = open_port(self._given, self._baud)
            self._descriptor = self._port.fileno()
        os.set_blocking(self._descriptor, False)
        self._poll = select.poll()
        self._poll.register(self._descriptor, select.POLLIN)
        self._room = select.poll()
        self._room.register(self._descriptor, select.POLLOUT)
        if not self._adapter:
            self._discard()
            self._write(b"\r\rC\r", _OPENING_S)
            self._write(commands, _OPENING_S)

    def _commands(self) -> bytes:
        if self._bit_rate_hz not in BIT_RATES:
            allowed = ", ".join(str(rate) for rate in BIT_RATES)
            raise DaqRefused(f"driver.options.bitrate = {self._bit_rate_hz}: adapters know {allowed}")
        out = f"S{BIT_RATES[self._bit_rate_hz]}\r"
        if self._fd:
            if self._data_bit_rate_hz not in DATA_BIT_RATES:
                allowed = ", ".join(str(rate) for rate in DATA_BIT_RATES)
                raise DaqRefused(f"driver.options.data_bitrate = {self._data_bit_rate_hz}: adapters know {allowed}")
            out += f"Y{self._data_bit_rate_hz // 1_000_000}\r"
        return (out + "O\r").encode("ascii")

    def send(self, frame: Frame, timeout_s: float) -> bool:
        """Write a line; one that is half written when the time is over is ended before the next one."""
        if not self._on_bus:
            return True  # as on a bus without listeners
        if self._write(encode_line(frame), timeout_s):
            return True
        self.counters["expired_frames"] += 1
        return False

    def receive(self, timeout_s: float) -> Frame | None:
        """The next frame of the line."""
        frames = self._lines.frames
        if frames:
            return frames.popleft()
        until = time.monotonic() + timeout_s
        left_s = timeout_s
        while True:
            self._read(left_s)
            if self._lines.commands:
                self._obey()
            if frames:
                return frames.popleft()
            left_s = until - time.monotonic()
            if left_s <= 0.0:  # also after half a line
                return None

    def close(self) -> None:
        """Close adapter and port; a descriptor that was given stays open."""
        if self._descriptor >= 0 and not self._adapter:
            with contextlib.suppress(DaqDisconnected):
                self._write(b"C\r", 0.05)
        port, self._port, self._descriptor = self._port, None, -1
        if port is not None:
            try:
                port.close()
            except OSError:
                return

    def _obey(self) -> None:
        """Do, as an adapter, what the other end commands."""
        while self._lines.commands:
            command = self._lines.commands.popleft()
            if not self._adapter:
                continue
            if command[:1] in b"OLC":
                self._on_bus = command[:1] != b"C"
            reply = {b"V": b"V1013\r", b"N": b"N0001\r", b"F": b"F00\r"}.get(command[:1], b"\r")
            self._write(reply, _OPENING_S)

    def _discard(self) -> None:
        """Forget what an earlier conversation has left on the line."""
        deadline = time.monotonic() + _OPENING_S
        while time.monotonic() < deadline and self._poll.poll(0):
            if not self._bytes():
                return

    def _read(self, timeout_s: float) -> None:
        ready = self._poll.poll(max(timeout_s, 0.0) * 1e3)
        if ready:
            data = self._bytes()
            if data:
                self._lines.feed(data)
            elif timeout_s > 0:
                time.sleep(min(timeout_s, 0.01))  # nobody at the other end: poll returns at once

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

    def _write(self, line: bytes, timeout_s: float) -> bool:
        """Write all of a line within the time, or nothing of it that counts."""
        deadline = time.monotonic() + timeout_s
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
            left = deadline - time.monotonic()
            if left <= 0:
                self._tail = data if started else data[: len(data) - len(line)]
                return started  # what has begun will be ended before the next line, and so is sent
            self._room.poll(left * 1e3)

    def _gone(self, error: OSError) -> None:
        if self._adapter and error.errno == errno.EIO:
            self._on_bus = False
            return
        raise DaqDisconnected(f"{self.name}: is gone ({error.strerror or error})") from None

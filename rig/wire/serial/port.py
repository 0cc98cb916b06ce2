"""Serial ports, opened and configured by pyserial, and pseudo-terminals."""

import errno
import os
import sys
from contextlib import suppress
from difflib import get_close_matches
from pathlib import Path
from typing import NamedTuple

import serial
from serial.tools import list_ports

from rig.errors import DaqBusy, DaqDisconnected, DaqError, DaqRefused
from rig.wire.serial.reading import wait_of_a_read

if sys.platform != "win32":
    import termios

MASTER_DEVICE = (5, 2)
"""Major and minor number of /dev/ptmx (Linux, admin-guide/devices.txt)."""
SLAVE_MAJORS = range(136, 144)
"""Major numbers of /dev/pts/* (the same list)."""


class PseudoTerminal(NamedTuple):
    """A line whose near end is a descriptor and whose far end is a port that any program can open."""

    descriptor: int
    far_descriptor: int
    """Kept open, so that the near end survives when a program at the far end closes it."""
    path: str

    def close(self) -> None:
        """Close both ends; a program that has the port open sees it unplugged. May be called again."""
        for descriptor in (self.descriptor, self.far_descriptor):
            with suppress(OSError):
                os.close(descriptor)


def open_pseudo_terminal() -> PseudoTerminal:
    """A new line that passes bytes as they are. Raises `OSError` where the system has no pseudo-terminals."""
    import pty
    import tty

    near, far = pty.openpty()
    tty.setraw(far)
    return PseudoTerminal(near, far, os.ttyname(far))


def is_pseudo_terminal(descriptor: int) -> bool:
    """Whether a descriptor is an end of a pseudo-terminal or no terminal at all, so that its baud rate has no meaning."""
    if not os.isatty(descriptor):
        return True
    if sys.platform == "linux":
        device = os.fstat(descriptor).st_rdev
        numbers = os.major(device), os.minor(device)
        return numbers == MASTER_DEVICE or numbers[0] in SLAVE_MAJORS
    return os.ttyname(descriptor).startswith("/dev/ttys")  # macOS names its serial ports /dev/tty.* and /dev/cu.*


BUSY = (errno.EBUSY, errno.EAGAIN, errno.EWOULDBLOCK)
"""Errors of a port that somebody else holds; the last two where another program holds its lock."""
LASTING_NAMES = "/dev/serial/by-id"
ALIKE = 0.8
"""Similarity of two names (0 to 1) from which on one is suggested for the other; chosen."""


def port_names() -> list[str]:
    """Serial ports of this system, by device name and by persistent name; no pseudo-terminals."""
    lasting = (str(path) for path in Path(LASTING_NAMES).glob("*"))
    return sorted({*(str(port.device) for port in list_ports.comports()), *lasting})


def open_port(path: str, baud: int) -> serial.Serial:
    """Open a pyserial port (8N1, exclusive) and discard old input. Reading its descriptor never blocks.

    Raises `DaqBusy`, `DaqDisconnected` or `DaqRefused`. The message says which ports there are and what to do.
    """
    if sys.platform == "win32":
        raise DaqRefused(
            f"port {path!r}: serial ports are driven on Linux and macOS only; on Windows use an interface of python-can"
        )
    try:
        port = serial.Serial(path, baud, timeout=0, exclusive=True)
    except (OSError, ValueError, OverflowError, termios.error) as error:
        raise _refusal(path, baud, error) from error
    try:
        # some adapters otherwise hold bytes back for 16 ms; others have no such setting
        with suppress(ValueError, OSError):
            port.set_low_latency_mode(True)
        os.set_blocking(port.fileno(), False)
        wait_of_a_read(port.fileno(), 1, 0)  # a read without input raises EAGAIN: 0 bytes mean that the port is gone
        port.reset_input_buffer()
    except (OSError, termios.error) as error:
        port.close()
        raise DaqDisconnected.of(error, where=f"port {path!r}: it disappeared while it was being opened") from error
    return port


def second_descriptor(path: str) -> int:
    """A second descriptor of an open port, for writing: writing then never blocks, while reading may."""
    try:
        return os.open(path, os.O_WRONLY | os.O_NOCTTY | os.O_NONBLOCK)
    except OSError as error:
        raise _refusal(path, 0, error) from error


def _refusal(path: str, baud: int, error: Exception) -> DaqError:
    cause = error.__context__  # pyserial drops the number of a termios error
    is_of_termios = isinstance(cause, termios.error) and bool(cause.args)
    number = int(cause.args[0]) if cause and is_of_termios else getattr(error, "errno", None)
    if number in BUSY:
        return DaqBusy("another program has it open", where=f"port {path!r}", hint="close the other program")
    if number in (errno.ENOENT, errno.ENODEV, errno.ENXIO, errno.EIO):
        names = port_names()
        there = ", ".join(names) or "none"
        like = get_close_matches(path, names, 1, ALIKE)
        return DaqDisconnected(
            f"port {path!r}: it is not there; serial ports here: {there}" + (f"; is it {like[0]!r}?" if like else "")
        )
    if number in (errno.EACCES, errno.EPERM):
        return DaqRefused(f"port {path!r}: no permission to open it; on Linux, join the group that owns it (dialout)")
    if number in (errno.ENOTTY, errno.EISDIR):
        return DaqRefused("it is no serial port", where=f"port {path!r}")
    if number is None:
        return DaqRefused(f"port {path!r} at {baud} baud: {error}")
    return DaqRefused(f"port {path!r}: it cannot be opened as a serial port: {error}")

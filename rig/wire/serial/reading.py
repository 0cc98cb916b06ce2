"""Reading a descriptor with a time-out, in as few system calls as each kind of descriptor allows.

An input's ``read(timeout_s)`` returns up to `CHUNK` bytes as soon as there are any, and no bytes after the time-out. It raises
`OSError` once the descriptor is at its end.
"""

import errno
import os
import select

CHUNK = 4096
"""Most bytes of a read: a pseudo-terminal holds no more."""
CONTROL_CHARACTERS = 6
"""Index of the control characters in the list that termios returns."""
COARSE_S = 0.01
"""Wait from which on the milliseconds of epoll are fine enough, s; chosen."""
MILLISECOND_S = 0.001
"""Resolution of epoll's time-out, s."""
SYSTEM_WAIT_S = 0.1
"""Time-out of a read with VTIME = 1, s (termios counts tenths of a second)."""
SYSTEM_SLACK_S = 0.02
"""Largest delay of that time-out, s: the system counts clock ticks, of 10 ms at most."""


def wait_of_a_read(descriptor: int, least_bytes: int, tenths_s: int) -> None:
    """VMIN and VTIME of a terminal: how many bytes a read waits for, and for how long, in tenths of a second."""
    import termios  # not on Windows, where this module is imported all the same

    attributes = termios.tcgetattr(descriptor)
    characters = attributes[CONTROL_CHARACTERS]
    characters[termios.VMIN], characters[termios.VTIME] = least_bytes, tenths_s
    termios.tcsetattr(descriptor, termios.TCSANOW, attributes)


class Input:
    """What a link reads from; this one is a port that is not open."""

    def read(self, timeout_s: float) -> bytes:
        """Bytes that have arrived within the time. Raise `OSError` once there are none to come."""
        raise OSError(errno.EBADF, os.strerror(errno.EBADF))


class PolledInput(Input):
    """Waits for any descriptor, then reads it; sets the descriptor to non-blocking.

    The wait is edge-triggered, which costs the system less. Every wait is followed by a read, so that no bytes that have
    arrived stay unread.
    """

    def __init__(self, descriptor: int) -> None:
        os.set_blocking(descriptor, False)
        self._descriptor = descriptor
        self._watched = (descriptor,)
        self._epoll = select.epoll() if hasattr(select, "epoll") else None
        if self._epoll is not None:
            try:
                self._epoll.register(descriptor, select.EPOLLIN | select.EPOLLET)
            except OSError:  # a file, which is always ready
                self.close()

    def read(self, timeout_s: float) -> bytes:
        """Bytes that have arrived within the time; a long wait may end a millisecond early."""
        if timeout_s >= COARSE_S and self._epoll is not None:
            self._epoll.poll(timeout_s - MILLISECOND_S)  # which it rounds up
        elif timeout_s > 0.0 and not select.select(self._watched, (), (), timeout_s)[0]:
            return b""
        try:
            data = os.read(self._descriptor, CHUNK)
        except BlockingIOError:
            return b""
        if not data:
            raise OSError(errno.EIO, "end of file")
        return data

    def close(self) -> None:
        """Close the epoll object."""
        epoll, self._epoll = self._epoll, None
        if epoll is not None:
            epoll.close()


class TimedInput(Input):
    """A terminal whose reads wait in the system for up to 0.1 s (VMIN = 0, VTIME = 1): one call per block.

    A read of no bytes is either that time-out or a port that is gone; a further call tells which. The descriptor blocks, so
    write through another one (`rig.wire.serial.port.second_descriptor`).
    """

    def __init__(self, descriptor: int) -> None:
        wait_of_a_read(descriptor, 0, 1)
        os.set_blocking(descriptor, True)
        self._descriptor = descriptor
        self._watched = (descriptor,)

    def read(self, timeout_s: float) -> bytes:
        """Read available bytes; return after at most 0.1 s, possibly empty."""
        if timeout_s < SYSTEM_WAIT_S + SYSTEM_SLACK_S and not self._ready(timeout_s):
            return b""
        data = os.read(self._descriptor, CHUNK)
        if not data and self._ready(0.0):
            data = os.read(self._descriptor, CHUNK)
            if not data:  # ready, and yet nothing to read
                raise OSError(errno.EIO, "end of file")
        return data

    def _ready(self, timeout_s: float) -> bool:
        return bool(select.select(self._watched, (), (), max(timeout_s, 0.0))[0])

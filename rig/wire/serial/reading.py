"""Reading a descriptor with a time-out, in as few calls of the system as each kind of descriptor allows.

An input's ``read(timeout_s)`` returns what there is, at most `CHUNK` bytes, as soon as there is any; nothing once the time is
over; and raises `OSError` once nothing can come any more.
"""

import errno
import os
import select
from typing import Any, Protocol

__all__ = ["CHUNK", "Input", "NoInput", "PolledInput", "TimedInput", "wait_of_a_read"]

CHUNK = 4096  # bytes a read; a pseudo-terminal holds no more
CONTROL_CHARACTERS = 6  # in the list that termios returns
COARSE_S = 0.01  # a wait from which on the milliseconds that epoll counts in are fine enough
MILLISECOND_S = 0.001
SYSTEM_WAIT_S = 0.1  # VTIME = 1
SYSTEM_SLACK_S = 0.02  # by which the system's own time-out may come late: ticks of its clock


def wait_of_a_read(descriptor: int, least_bytes: int, tenths_s: int) -> None:
    """VMIN and VTIME of a terminal: how many bytes a read waits for, and for how long, in tenths of a second."""
    import termios  # not on Windows, where this module is imported all the same

    attributes = termios.tcgetattr(descriptor)
    characters = attributes[CONTROL_CHARACTERS]
    characters[termios.VMIN], characters[termios.VTIME] = least_bytes, tenths_s
    termios.tcsetattr(descriptor, termios.TCSANOW, attributes)


class Input(Protocol):
    """What a link reads from."""

    def read(self, timeout_s: float) -> bytes:
        """What there is, or has come within the time."""


class NoInput:
    """That of a port that is not open."""

    def read(self, timeout_s: float) -> bytes:
        """Nothing can come."""
        raise OSError(errno.EBADF, os.strerror(errno.EBADF))


class PolledInput:
    """Any descriptor: waited for, then read. Makes it a descriptor that never blocks.

    A wait ends at news (edges: the system need not look twice), and whatever ends it, what has come is read: so
    nothing stays unread beyond the wait.
    """

    def __init__(self, descriptor: int) -> None:
        os.set_blocking(descriptor, False)
        self._descriptor = descriptor
        self._watched = (descriptor,)
        self._epoll: Any = select.epoll() if hasattr(select, "epoll") else None
        if self._epoll is not None:
            try:
                self._epoll.register(descriptor, select.EPOLLIN | select.EPOLLET)
            except OSError:  # a file, which is always ready
                self.close()

    def read(self, timeout_s: float) -> bytes:
        """What there is, or has come within the time; a long wait may end a millisecond early."""
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
        """Let go of what waits."""
        epoll, self._epoll = self._epoll, None
        if epoll is not None:
            epoll.close()


class TimedInput:
    """A terminal whose reads wait by themselves, for a tenth of a second at most (VMIN = 0, VTIME = 1): one call a block.

    A read of no bytes is then such a time-out, or a port that is gone; which of the two, is asked only then. The
    descriptor blocks, so it is not to be written to by somebody in a hurry.
    """

    def __init__(self, descriptor: int) -> None:
        wait_of_a_read(descriptor, 0, 1)
        os.set_blocking(descriptor, True)
        self._descriptor = descriptor
        self._watched = (descriptor,)

    def read(self, timeout_s: float) -> bytes:
        """What there is, or has come within the time; may be back after a tenth of a second already."""
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

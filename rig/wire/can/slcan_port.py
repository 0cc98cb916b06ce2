"""Text over a serial line: read as it comes, written in whole lines, without ever waiting longer than is allowed."""

import errno
import os
import time
from collections.abc import Callable
from select import select

from rig.errors import DaqDisconnected

__all__ = ["TextPort"]

_READ_BYTES = 4096
_NOBODY_S = 0.01


class TextPort:
    """An open file descriptor, which stays the caller's.

    ``on_hang_up`` is called where nobody is at the other end any more, and the port waits on; without it `DaqDisconnected` is
    raised then.
    """

    def __init__(self, name: str, descriptor: int, on_hang_up: Callable[[], None] | None = None) -> None:
        self.name = name
        self._descriptor, self._on_hang_up = descriptor, on_hang_up
        self._tail = b""
        """What is left of a line of which the beginning is written."""
        os.set_blocking(descriptor, False)

    def forget(self, longest_s: float) -> None:
        """Read what an earlier conversation has left on the line."""
        deadline = time.monotonic() + longest_s
        while time.monotonic() < deadline and self._has_come(0.0):
            if not self._bytes():
                return

    def read(self, timeout_s: float) -> bytes:
        """What has come; waits at most so long for something."""
        if timeout_s > 0.0 and not self._has_come(timeout_s):
            return b""
        data = self._bytes()
        if not data and timeout_s > 0.0:
            time.sleep(min(timeout_s, _NOBODY_S))  # nobody at the other end: select returns at once
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
        """Write all of a line within the time, or nothing of it that counts."""
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
                return started  # what has begun will be ended before the next line, and so is sent
            select((), (self._descriptor,), (), left)

    def _gone(self, error: OSError) -> None:
        if self._on_hang_up is not None and error.errno == errno.EIO:
            self._on_hang_up()
            return
        raise DaqDisconnected(f"{self.name}: is gone ({error.strerror or error})") from None

"""Pseudo-terminals: a serial line between two programs of one computer."""

import os
import sys
from contextlib import suppress
from typing import NamedTuple

__all__ = ["PseudoTerminal", "is_pseudo_terminal", "open_pseudo_terminal"]

MASTER_DEVICE = (5, 2)  # /dev/ptmx in Linux's list of devices
SLAVE_MAJORS = range(136, 144)  # /dev/pts/*


class PseudoTerminal(NamedTuple):
    """A line whose near end is a descriptor and whose far end is a port that any program can open."""

    descriptor: int
    far_descriptor: int
    """Kept open, so that the near end lives on when the program at the far end comes and goes."""
    path: str

    def close(self) -> None:
        """Close both ends; whoever has opened the port sees it unplugged. Any number of times."""
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
    """Whether a descriptor is an end of a pseudo-terminal, or no terminal at all: then its baud rate means nothing."""
    if not os.isatty(descriptor):
        return True
    if sys.platform == "linux":
        device = os.fstat(descriptor).st_rdev
        numbers = os.major(device), os.minor(device)
        return numbers == MASTER_DEVICE or numbers[0] in SLAVE_MAJORS
    return os.ttyname(descriptor).startswith("/dev/ttys")  # macOS names its serial ports /dev/tty.* and /dev/cu.*

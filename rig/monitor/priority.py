"""The loop goes first where processors are few."""

import os
from contextlib import suppress

NICE = 5  # niceness (0 to 19); chosen: the loop goes first


def lower_priority() -> None:
    """Let this process, and what it starts, stand back behind those that drive."""
    with suppress(OSError, AttributeError):  # not on Windows
        os.nice(NICE)

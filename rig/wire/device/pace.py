"""A device at the pace of the clock: it waits for messages until its next deadline, and never otherwise."""

import gc
import os
import time
from collections.abc import Callable
from contextlib import suppress

from rig.wire.device.device import Device

__all__ = ["ask_for_priority", "keep_serving"]

PRIORITY = 60
"""Of SCHED_FIFO: below the wall-clock loop's, above the kernel's interrupt threads."""


def keep_serving(device: Device, should_end: Callable[[], bool], clock: Callable[[], float] = time.monotonic) -> None:
    """Serve a host until ``should_end`` says so, which is asked at every message and ten times a second.

    Deadlines are absolute times of ``clock``. Raises `rig.errors.DaqDisconnected` once the link is gone for good.
    """
    receive, handle, advance = device.link.receive, device.handle, device.advance
    while not should_end():
        message = receive(max(0.0, device.wake_s - clock()))
        now_s = clock()
        if message is not None:
            handle(message, now_s)
        advance(now_s)
    device.switch_off(clock())


def ask_for_priority() -> str:
    """Ask for real-time scheduling; says what was granted."""
    gc.collect()
    gc.freeze()
    with suppress(AttributeError, OSError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PRIORITY))
        return f"SCHED_FIFO {PRIORITY}"
    return "ordinary scheduling"

"""A device at the pace of the clock: it waits for messages until its next deadline, and never otherwise."""

import time
from collections.abc import Callable

from rig.emulator.device import Device
from rig.system.privileges import prepare

__all__ = ["ask_for_priority", "keep_serving"]

PRIORITY = 60
"""Of SCHED_FIFO: below the wall-clock loop's, above the kernel's interrupt threads."""
MOST_AT_ONCE = 64


def keep_serving(device: Device, should_end: Callable[[], bool], clock: Callable[[], float] = time.monotonic) -> None:
    """Serve a host until ``should_end`` says so, which is asked at every message and ten times a second.

    Deadlines are absolute times of ``clock``. What has come by the time that a deadline is seen to be over counts as come in
    time: who is late himself cannot know better, and must not hold it against the host. Raises
    `rig.errors.DaqDisconnected` once the link is gone for good.
    """
    receive, handle, advance = device.link.receive, device.handle, device.advance
    advance(clock())
    while not should_end():
        wake_s = device.wake_s
        message = receive(max(0.0, wake_s - clock()))
        now_s = clock()
        if message is not None:
            handle(message, min(now_s, wake_s))
            if now_s >= wake_s:
                for _ in range(MOST_AT_ONCE):
                    message = receive(0.0)
                    if message is None:
                        break
                    handle(message, wake_s)
                now_s = clock()
        advance(now_s)
    device.switch_off(clock())


def ask_for_priority() -> str:
    """Ask for real-time scheduling, memory that stays, and no garbage collector; says which scheduling was granted."""
    scheduling = prepare(priority=PRIORITY)["scheduling"]
    return scheduling if scheduling.startswith("SCHED") else "ordinary scheduling"

"""Waiting for what must come, however busy the machine is."""

import time
from collections.abc import Callable

LONG_S = 900.0
"""After which a test gives up. No test is about it: a machine with ten busy processes a core comes nowhere near."""


def wait_until(has_come: Callable[[], bool], what: str, *, every_s: float = 0.02) -> None:
    """Return once it has come; fail with ``what`` where it never does. Looking costs something: choose ``every_s`` by it."""
    until_s = time.monotonic() + LONG_S
    while not has_come():
        assert time.monotonic() < until_s, f"{what}: not within {LONG_S:g} s"
        time.sleep(every_s)

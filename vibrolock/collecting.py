"""Python's collector of garbage in processes that import much and then end."""

import atexit
import gc

RARELY = 50_000
"""New objects after which the collector looks through them. Chosen: what is imported stays, and is not looked through."""


def collect_rarely() -> None:
    """Look through objects rarely, and not at all when the process ends: what is imported is a tenth of a command each time."""
    gc.set_threshold(RARELY)
    atexit.register(gc.freeze)

"""How many connections the page's server may hold: as many as it has descriptors for, less those for everything else."""

from contextlib import suppress
from typing import NamedTuple

from rig.monitor.visits import MOST_FEEDS, MOST_KNOWN

FILES = 64
"""Descriptors for everything but connections."""
LEAST = 8  # connections that are held however few descriptors there are; chosen


class Capacity(NamedTuple):
    """For how many connections without a key there is room."""

    waiting: int = 2048
    """Those that have not had their turn."""
    strangers: int = 128
    """Those that are listened to. By TLS each takes a quarter of a megabyte."""


def capacity() -> Capacity:
    """Return how many connections there may be; raise the process's limit of descriptors as far as the system allows."""
    kept, wanted = MOST_KNOWN + MOST_FEEDS + FILES, Capacity()
    found = _raised(kept + sum(wanted)) - kept
    strangers = max(min(wanted.strangers, found // 4), LEAST)
    return Capacity(max(min(wanted.waiting, found - strangers), LEAST), strangers)


def _raised(wanted: int) -> int:
    """Return how many descriptors there are, at most ``wanted``."""
    try:
        import resource
    except ImportError:  # Windows, which has no such limit
        return wanted
    soft, hard = (
        wanted if one == resource.RLIM_INFINITY else one for one in resource.getrlimit(resource.RLIMIT_NOFILE)
    )
    if soft < min(wanted, hard):
        with suppress(OSError, ValueError):
            resource.setrlimit(
                resource.RLIMIT_NOFILE, (min(wanted, hard), resource.getrlimit(resource.RLIMIT_NOFILE)[1])
            )
            soft = min(wanted, hard)
    return min(soft, wanted)

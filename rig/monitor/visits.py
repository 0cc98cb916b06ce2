"""Connections that have had their turn: strangers, of which so many are listened to at a time, and those with a key."""

import asyncio
from collections.abc import Callable
from contextlib import suppress
from typing import NamedTuple

TURN_S = 0.2
"""Time that every stranger has for its handshake and its first request, however many others there are."""
MOST_KNOWN = 64
"""Connections with a key that are no sockets."""
MOST_SOCKETS = 32
"""Sockets that are sent the feed."""
MOST_FEEDS = 2 * MOST_SOCKETS
"""All sockets with a key, also those that are being told that they are too many."""
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


class Visit:
    """A connection from its handshake on."""

    def __init__(self, visits: "Visits", began_s: float) -> None:
        self._visits, self.began_s = visits, began_s
        self._handshake: asyncio.Task[object] | None = None
        self._transport: asyncio.Transport | None = None

    def shakes_hands(self, handshake: "asyncio.Task[object]") -> None:
        """It is being opened, with a TLS handshake if there is to be one."""
        self._handshake = handshake
        handshake.add_done_callback(self._shaken)

    def opened(self, transport: asyncio.Transport) -> None:
        """It is open."""
        self._transport = transport

    def shows_key(self) -> None:
        """Count it as known, and as the one used last: a request on it had the cookie, or the token of the address."""
        known = self._visits.known
        known.pop(self, None)
        known[self] = None
        while len(known) > MOST_KNOWN:
            next(iter(known)).drop()
        self._visits.leaves(self)

    def becomes_feed(self) -> None:
        """Count it as a socket; one without a key stays a stranger until it is refused."""
        if self not in self._visits.known:
            return
        del self._visits.known[self]
        self._visits.feeds[self] = None
        if len(self._visits.feeds) > MOST_FEEDS:
            self.drop()

    def gone(self) -> None:
        """Forget it, because it is closed."""
        self._visits.known.pop(self, None)
        self._visits.feeds.pop(self, None)
        self._visits.leaves(self)

    def drop(self) -> None:
        """Close it at once, whatever it does."""
        self.gone()
        if self._transport is not None:
            self._transport.abort()
        elif self._handshake is not None:
            self._handshake.cancel()

    def _shaken(self, handshake: "asyncio.Task[object]") -> None:
        self._handshake = None  # it may hold what failed, with all buffers
        if handshake.cancelled() or handshake.exception() is not None:  # asked, so that it is not logged
            self.gone()


class Visits:
    """All of them, the oldest first; ``on_room`` is called when one of the places for ``most_strangers`` has become free."""

    def __init__(self, most_strangers: int) -> None:
        self._most_strangers = most_strangers
        self.strangers: dict[Visit, None] = {}
        self.known: dict[Visit, None] = {}
        self.feeds: dict[Visit, None] = {}
        self.on_room: Callable[[], None] = lambda: None

    def until_room_s(self, now_s: float) -> float:
        """Return how long it takes until another stranger can be taken; 0 if there is room, or it can be made."""
        if len(self.strangers) < self._most_strangers:
            return 0.0
        return max(next(iter(self.strangers)).began_s + TURN_S - now_s, 0.0)

    def begin(self, now_s: float) -> Visit:
        """Return a new stranger, for which the oldest is dropped where there are too many."""
        while len(self.strangers) >= self._most_strangers:
            oldest = next(iter(self.strangers))
            del self.strangers[oldest]  # its place is taken
            oldest.drop()
        visit = Visit(self, now_s)
        self.strangers[visit] = None
        return visit

    def known_at_once(self) -> Visit:
        """Return a connection that has shown a key before it was opened."""
        visit = Visit(self, 0.0)
        visit.shows_key()
        return visit

    def leaves(self, stranger: Visit) -> None:
        """Give the place of a stranger to another, if it has one."""
        if stranger in self.strangers:
            del self.strangers[stranger]
            self.on_room()
